"""What textures cost: the CPU time of a frame with them over that of the same frame with constant inputs.

    python scripts/bench/textures.py [--size 2048] [--repeats 9]

A wavy surface under a dome and a lamp, all in view; rounds of the same samples, the variants in turn, one thread.
Medians over the repeats.
"""

from __future__ import annotations

import argparse
import dataclasses
import statistics
import time

import numpy as np

from warpmis.config import RenderConfig
from warpmis.device.upload import upload
from warpmis.features import detect
from warpmis.geometry import Geometry
from warpmis.integrator import Integrator, allocation_of
from warpmis.learn.schedule import Round
from warpmis.scene import Camera, DomeLight, Material, Prim, RectLight, Scene
from warpmis.texture import Texture, TextureLookup

SPP = 16


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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", type=int, default=2048, help="of the square pictures (2048)")
    parser.add_argument("--width", type=int, default=96)
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("--method", default="nee")
    options = parser.parse_args()
    geometry = wavy_surface(300)
    config = RenderConfig(method=options.method, max_depth=4, threads=1)
    runs = {}
    for name, material in materials(options.size).items():
        scene = scene_of(geometry, material, options.width)
        features = detect(scene).with_strategies(() if options.method == "nee" else config.strategies)
        runs[name] = Integrator(upload(scene, "cpu"), features, config, allocation_of(config, *scene.resolution))
    spent: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(options.repeats + 1):
        for name, run in runs.items():
            start = time.process_time()
            run.trace(Round(0, SPP, learn=False), lambda samples: None)
            spent[name].append(time.process_time() - start)
    base = spent["constant"]
    for name, seconds in spent.items():
        ratio = statistics.median(one / other for one, other in zip(seconds[1:], base[1:], strict=True))
        print(f"{name:28} {statistics.median(seconds[1:]):7.3f} s   {ratio:.3f}")


if __name__ == "__main__":
    main()
