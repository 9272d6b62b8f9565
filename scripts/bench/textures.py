"""What textures cost: the CPU time of a frame with them over that of the same frame with constant inputs.

    python scripts/bench/textures.py [--size 2048] [--repeats 9] [--method auto]
    python scripts/bench/textures.py --files [--size 8192]     reading and memory of four pictures, nothing else
    python scripts/bench/textures.py --lookups [--size 1024]   one evaluation of each material, nothing else

A wavy surface under a dome and a lamp, all in view; whole frames, learning included, the variants in turn, one thread.
Medians over the repeats. --files writes a colour (JPEG), roughness, metallic (grey PNG) and normals (RGB PNG), reads
them by a stage, and renders one small frame. --lookups takes the shortest of 400 short runs, in turn, which other
programs disturb less than a frame.
"""

from __future__ import annotations

import argparse
import dataclasses
import multiprocessing
import resource
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import warp as wp

from warpmis import Progress, load_stage, render
from warpmis.device.upload import upload
from warpmis.device.views import SceneView
from warpmis.kernels.hit import NO_INSTANCE
from warpmis.kernels.material import make_material
from warpmis.scene import Camera, DomeLight, Material, Prim, RectLight, Scene
from warpmis.scene.features import detect
from warpmis.scene.geometry import Geometry
from warpmis.scene.texture import Texture, TextureLookup

SPP = 64

# Evaluations of a material in one short run.
POINTS = 64 * 600


def wavy_surface(side: int) -> Geometry:
    """Some 2 side^2 triangles about the xz plane with smooth normals and texture coordinates."""
    z, x = np.mgrid[0 : side + 1, 0 : side + 1].reshape(2, -1) / side
    points = np.stack([2 * x - 1, 0.1 * np.sin(20 * x) * np.sin(20 * z), 2 * z - 1], axis=-1)
    slope_x, slope_z = np.cos(20 * x) * np.sin(20 * z), np.sin(20 * x) * np.cos(20 * z)
    normals = np.stack([-slope_x, np.ones_like(x), -slope_z], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    index = np.arange(len(points)).reshape(side + 1, side + 1)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    triangles = np.stack([a, c, b, a, d, c], axis=-1).reshape(-1, 3).astype(np.int32)
    return Geometry(
        points=points.astype(np.float32),
        triangles=triangles,
        normals=normals.astype(np.float32),
        normal_indices=triangles,
        materials=np.zeros(len(triangles), np.int32),
        prims=np.zeros(len(triangles), np.int32),
        primvars=np.stack([x, z], axis=-1)[triangles].astype(np.float32),
    )


def materials(size: int) -> dict[str, Material]:
    """The same material with more and more of its inputs looked up."""
    random = np.random.default_rng(0)
    pixels = random.integers(80, 200, (size, size, 4), dtype=np.uint8)
    wrap = {"wrap_s": "repeat", "wrap_t": "repeat"}
    color = TextureLookup(Texture({1001: pixels[..., :3]}, is_srgb=True), **wrap)
    packed = TextureLookup(Texture({1001: pixels}), **wrap)
    rough, metal = (dataclasses.replace(packed, channels=channel) for channel in "gb")
    bumps = random.integers(118, 138, (size, size, 3), dtype=np.uint8)
    bumps[..., 2] = 255
    normal = TextureLookup(Texture({1001: bumps}), scale=(2.0,) * 4, bias=(-1.0,) * 4, **wrap)
    textured = Material(diffuse_color=color)
    packed_too = dataclasses.replace(textured, roughness=rough, metallic=metal)
    return {
        "constant": textured.mean,
        "color": textured,
        "color, roughness, metallic": packed_too,
        "color, normal": dataclasses.replace(textured, normal=normal),
        "all four": dataclasses.replace(packed_too, normal=normal),
    }


def scene_of(geometry: Geometry, material: Material, width: int) -> Scene:
    down = np.array([0.0, -0.9, -0.436])
    camera = Camera(
        "/camera", np.array([0, 1.9, 0.9]), np.array([1.0, 0, 0]), np.array([0, 0.436, -0.9]), down,
        (-0.4, 0.4, -0.4, 0.4),
    )  # fmt: skip
    lights = (
        DomeLight("/sky", np.eye(3), np.full(3, 0.5)),
        RectLight("/lamp", np.array([0, 3.0, 0]), np.array([0.5, 0, 0]), np.array([0, 0, -0.5]), np.full(3, 5.0)),
    )
    return Scene("textures", camera, (width, width), geometry, (material,), (Prim("/surface"),), lights)


def cpu_seconds(scene: Scene, method: str, seed: int) -> float:
    """Of tracing and learning."""
    began: list[float] = []

    def clock(progress: Progress) -> None:
        if not began and progress.phase in ("learn", "render"):
            began.append(time.process_time())

    render(scene, method=method, spp=SPP, max_depth=4, seed=seed, threads=1, progress=clock)
    return time.process_time() - began[0]


FILES = {"color": ("color.jpg", 3), "rough": ("rough.png", 1), "metal": ("metal.png", 1), "normal": ("normal.png", 3)}

STAGE = """#usda 1.0
def Camera "Camera"
{
    double3 xformOp:translate = (0, 2, 0)
    float xformOp:rotateX = -90
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]
}
def DomeLight "Sky"
{
}
def Mesh "Floor" (
    prepend apiSchemas = ["MaterialBindingAPI"]
)
{
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-1, 0, 1), (1, 0, 1), (1, 0, -1), (-1, 0, -1)]
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (
        interpolation = "vertex"
    )
    rel material:binding = </Material>
}
def Material "Material"
{
    token outputs:surface.connect = </Material/Surface.outputs:surface>
    def Shader "Surface"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </Material/color.outputs:rgb>
        float inputs:roughness.connect = </Material/rough.outputs:r>
        float inputs:metallic.connect = </Material/metal.outputs:r>
        normal3f inputs:normal.connect = </Material/normal.outputs:rgb>
        token outputs:surface
    }
    def Shader "st"
    {
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "st"
        float2 outputs:result
    }
%s}
"""

NODE = """    def Shader "{name}"
    {{
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @{file}@
        token inputs:sourceColorSpace = "{space}"
        float4 inputs:scale = ({scale}, {scale}, {scale}, 1)
        float4 inputs:bias = ({bias}, {bias}, {bias}, 0)
        float2 inputs:st.connect = </Material/st.outputs:result>
        float3 outputs:rgb
        float outputs:r
    }}
"""


def write_stage(folder: Path, size: int) -> None:
    """Four pictures that do not compress much, and a floor that shows them."""
    import OpenImageIO as oiio

    random, nodes = np.random.default_rng(0), ""
    for name, (file, channels) in FILES.items():
        coarse = random.integers(60, 200, (size // 16, size // 16, channels), dtype=np.uint8)
        pixels = coarse.repeat(16, axis=0).repeat(16, axis=1)
        pixels += random.integers(0, 16, pixels.shape, dtype=np.uint8)
        output = oiio.ImageOutput.create(str(folder / file))
        output.open(str(folder / file), oiio.ImageSpec(size, size, channels, "uint8"))
        output.write_image(pixels)
        output.close()
        scale, bias = (2, -1) if name == "normal" else (1, 0)
        space = "sRGB" if name == "color" else "raw"
        nodes += NODE.format(name=name, file=file, space=space, scale=scale, bias=bias)
    (folder / "scene.usda").write_text(STAGE % nodes)


def measure_files(size: int) -> None:
    with tempfile.TemporaryDirectory() as folder:
        # In a process of its own, whose memory is not in the peak.
        writer = multiprocessing.get_context("spawn").Process(target=write_stage, args=(Path(folder), size))
        writer.start()
        writer.join()
        stage = Path(folder) / "scene.usda"
        start, cpu = time.perf_counter(), time.process_time()
        scene = load_stage(stage, width=64)
        print(f"read:   {time.perf_counter() - start:6.2f} s, {time.process_time() - cpu:.2f} CPU s")
        began = [time.perf_counter(), time.process_time()]
        stats = render(scene, spp=4, method="nee").stats
        spent = [time.perf_counter() - began[0], time.process_time() - began[1]]
        seconds = stats["seconds"]
        print(f"upload: {seconds['load']:6.2f} s; the whole frame {spent[0]:.2f} s, {spent[1]:.2f} CPU s")
        print(f"device: {stats['bytes']['scene']['textures'] / 2**20:6.0f} MiB of textures")
        print(f"peak:   {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**10:6.0f} MiB of the process")


def evaluation(scene: Scene) -> tuple[Callable[[], float], object]:
    """A function that evaluates the material at POINTS points and tells the seconds of one; and what it reads.

    64 points each are in one triangle, as the samples of a pixel are.
    """
    at = make_material(detect(scene)).at

    @wp.kernel(enable_backward=False, module="unique")
    def evaluate(
        scene: SceneView, triangles: wp.array(dtype=int), points: wp.array(dtype=wp.vec2), out: wp.array(dtype=wp.vec3)
    ):  # type: ignore[no-untyped-def]
        i = wp.tid()
        m = at(scene, triangles[i], NO_INSTANCE, points[i][0], points[i][1])
        out[i] = m.diffuse + m.specular_f0 + m.normal + wp.vec3(m.alpha)

    random = np.random.default_rng(0)
    triangles = random.integers(0, len(scene.geometry.triangles), POINTS // 64).repeat(64).astype(np.int32)
    data = upload(scene, "cpu")
    inputs = [data.view, wp.array(triangles, dtype=int), wp.array(0.5 * random.random((POINTS, 2)), dtype=wp.vec2)]
    out = wp.zeros(POINTS, dtype=wp.vec3)

    def run() -> float:
        start = time.perf_counter()
        wp.launch(evaluate, POINTS, [*inputs, out])
        return (time.perf_counter() - start) / POINTS

    return run, data


def measure_lookups(size: int) -> None:
    runs = {name: evaluation(scene_of(wavy_surface(100), one, 16)) for name, one in materials(size).items()}
    best = dict.fromkeys(runs, 1.0)
    for _ in range(401):
        for name, (run, _) in runs.items():
            best[name] = min(best[name], run())
    for name, seconds in best.items():
        print(f"{name:28} {1e9 * seconds:6.1f} ns")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", type=int, help="of the square pictures (2048; with --files 8192, --lookups 1024)")
    parser.add_argument("--lookups", action="store_true", help="measure one evaluation of each material")
    parser.add_argument("--files", action="store_true", help="measure reading and memory of four pictures")
    parser.add_argument("--width", type=int, default=96)
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("--method", default="auto")
    options = parser.parse_args()
    if options.lookups:
        measure_lookups(options.size or 1024)
        return
    if options.files:
        measure_files(options.size or 8192)
        return
    geometry = wavy_surface(300)
    scenes = {name: scene_of(geometry, one, options.width) for name, one in materials(options.size or 2048).items()}
    spent: dict[str, list[float]] = {name: [] for name in scenes}
    for seed in range(options.repeats + 1):
        for name, scene in scenes.items():
            spent[name].append(cpu_seconds(scene, options.method, seed))
    base = spent["constant"]
    for name, seconds in spent.items():
        ratio = statistics.median(one / other for one, other in zip(seconds[1:], base[1:], strict=True))
        print(f"{name:28} {statistics.median(seconds[1:]):7.3f} s   {ratio:.3f}")


if __name__ == "__main__":
    main()
