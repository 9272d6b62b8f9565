"""Memory and time of many instances: writes a stage, renders it in a process of its own, and tells its peak memory.

    python scripts/bench/instances.py [--instances 10000] [--triangles 10000] [--native] [--nested N] [--emissive]
        [--flatten] [--json FILE]

The peak is that of the whole process of `warpmis render`, pxr, Warp and the compiler included. device_MiB is what the
scene takes on the device, but for the nodes of Warp's trees.
"""

from __future__ import annotations

import argparse
import json
import math
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt

from warpmis.device.footprint import scene_bytes
from warpmis.device.upload import upload
from warpmis.usd import load_stage, placing

# What flattens whatever the stage holds, in the process that renders.
FLATTENING = "import warpmis.usd.placing as p, sys; p.MAX_COPIES = p.MAX_EMISSIVE_COPIES = 10**9; "
RENDER = "from warpmis.cli import main; sys.exit(main(sys.argv[1:]))"


def define_mesh(stage: Usd.Stage, path: str, triangles: int) -> None:
    """A bumpy ball of about so many triangles, with texture coordinates."""
    rows = max(3, round(math.sqrt(triangles / 4)))
    v, u = np.mgrid[0 : rows + 1, 0 : 2 * rows + 1].reshape(2, -1) / np.array([[rows], [2 * rows]])
    radius = 0.4 + 0.03 * np.sin(16 * np.pi * u) * np.sin(8 * np.pi * v)
    sin_v = np.sin(np.pi * v)
    points = np.stack([sin_v * np.cos(2 * np.pi * u), np.cos(np.pi * v), sin_v * np.sin(2 * np.pi * u)], axis=-1)
    index = np.arange(len(points)).reshape(rows + 1, 2 * rows + 1)
    quads = np.stack([index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]], axis=-1).reshape(-1, 4)
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy((radius[:, None] * points).astype(np.float32)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(quads.astype(np.int32).ravel()))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray(len(quads), 4))
    mesh.CreateSubdivisionSchemeAttr("none")
    mesh.CreateDisplayColorAttr([(0.6, 0.5, 0.4)])


def define_glow(stage: Usd.Stage, mesh: str) -> None:
    """A material that emits, on the mesh."""
    material = UsdShade.Material.Define(stage, mesh + "/Glow")
    shader = UsdShade.Shader.Define(stage, mesh + "/Glow/Surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("emissiveColor", Sdf.ValueTypeNames.Color3f).Set((2.0, 1.5, 1.0))
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    UsdShade.MaterialBindingAPI.Apply(stage.GetPrimAtPath(mesh)).Bind(material)


def define_floor(stage: Usd.Stage, extent: float) -> None:
    """What lamps shine at."""
    mesh = UsdGeom.Mesh.Define(stage, "/Floor")
    mesh.CreatePointsAttr([(x * extent, -0.6, z * extent) for x, z in ((-1, 1), (1, 1), (1, -1), (-1, -1))])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
    mesh.CreateFaceVertexCountsAttr([4])
    mesh.CreateSubdivisionSchemeAttr("none")


def places(count: int) -> np.ndarray:
    """Positions on a square lattice, shape (count, 3)."""
    side = math.ceil(math.sqrt(count))
    row, column = np.divmod(np.arange(count), side) - np.float32((side - 1) / 2)
    return np.stack([column, 0 * row, row], axis=-1)


def define_instancer(stage: Usd.Stage, path: str, prototype: str, count: int, spacing: float) -> None:
    instancer = UsdGeom.PointInstancer.Define(stage, path)
    instancer.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(spacing * places(count)))
    instancer.CreateProtoIndicesAttr(Vt.IntArray(count, 0))
    instancer.CreatePrototypesRel().SetTargets([prototype])


def write_stage(path: Path, instances: int, triangles: int, native: bool, nested: int, emissive: bool) -> None:
    stage = Usd.Stage.CreateNew(str(path))
    stage.CreateClassPrim("/Class")
    define_mesh(stage, "/Class/Ball", triangles)
    if emissive:
        define_glow(stage, "/Class/Ball")
        define_floor(stage, math.sqrt(instances))
    if native:
        for number, position in enumerate(places(instances)):
            prim = UsdGeom.Xform.Define(stage, f"/World/Ball{number}")
            prim.AddTranslateOp().Set(Gf.Vec3d(*position.tolist()))
            prim.GetPrim().GetInherits().AddInherit("/Class")
            prim.GetPrim().SetInstanceable(True)
    else:
        outer = max(1, nested)
        define_instancer(stage, "/Class/Patch", "/Class/Ball", instances // outer, 1.0)
        define_instancer(stage, "/World/Patches", "/Class/Patch", outer, math.ceil(math.sqrt(instances / outer)))
    camera = UsdGeom.Camera.Define(stage, "/Camera")
    extent = math.sqrt(instances)
    camera.AddTranslateOp().Set(Gf.Vec3d(0, 0.25 * extent, 0.6 * extent))
    camera.AddRotateXOp().Set(-25.0)
    stage.Save()


def bytes_on_device(path: Path, flatten: bool) -> int:
    """What the stage's scene takes there."""
    if flatten:
        placing.MAX_COPIES = placing.MAX_EMISSIVE_COPIES = 10**9
    return sum(scene_bytes(upload(load_stage(path, width=480), "cpu")).values())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--instances", type=int, default=10_000)
    parser.add_argument("--triangles", type=int, default=10_000, help="of the mesh (10000)")
    parser.add_argument("--native", action="store_true", help="native instances instead of a PointInstancer")
    parser.add_argument("--nested", type=int, default=1, help="instances of the PointInstancer itself (1)")
    parser.add_argument("--emissive", action="store_true", help="the mesh is a lamp, and there is a floor")
    parser.add_argument("--flatten", action="store_true", help="flatten all instances, whatever that takes")
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--png", metavar="FILE", help="keep the picture")
    parser.add_argument("--json", metavar="FILE")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "stage.usdc"
        write_stage(path, options.instances, options.triangles, options.native, options.nested, options.emissive)
        program = (FLATTENING if options.flatten else "import sys; ") + RENDER
        command = [sys.executable, "-c", program, "render", str(path), str(Path(folder) / "out.exr"), "--json"]
        command += ["-w", "480", "--spp", str(options.spp)] + (["--png", options.png] if options.png else [])
        start = time.perf_counter()
        output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        wall = time.perf_counter() - start
        device_bytes = bytes_on_device(path, options.flatten)
    report = json.loads(output)
    figures = {
        "triangles": report["stats"]["triangles"],
        "wall_seconds": wall,
        "load_seconds": report["stats"]["seconds"]["load"],
        "render_seconds": report["stats"]["seconds"]["render"],
        "device_MiB": device_bytes / 2**20,
        "peak_MiB": resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024,
    }
    for name, value in figures.items():
        print(f"{name:16} {value:14.2f}")
    if options.json:
        Path(options.json).write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
