"""What loading a large stage costs, in time and memory:

    python scripts/bench/loading.py [--shape grids|pieces] [--meshes N] [--triangles N] [--scheme NAME]
        [--complexity NAME] [--width PIXELS] [--profile] [--json FILE]

Writes a stage of equal meshes into a temporary folder and loads it in a fresh process, which reports the seconds of
warpmis.load_stage and the process's peak memory [MiB] before and after. The default, a million triangles in a thousand
meshes, is to load in less than 20 s and 3 GiB on two cores.

`--shape pieces` are turned pieces on a board before a camera, with texture coordinates, as dense chess sets have them:
`--shape pieces --meshes 200 --triangles 2800000 --scheme unauthored` is 1.4 million faces without a scheme, so
that each would be split in sixteen if none were too small to see.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, Vt

LOAD = """
import json, resource, sys, time
import warpmis
from warpmis.usd import load_stage
peak = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
imported, start = peak(), time.perf_counter()
scene = load_stage(sys.argv[1], complexity=sys.argv[2], width=int(sys.argv[3]))
seconds = time.perf_counter() - start
print(json.dumps({
    "triangles": len(scene.geometry.triangles), "prims": len(scene.prims), "warnings": len(scene.warnings),
    "seconds": seconds, "peak_MiB": peak(), "peak_before_MiB": imported,
}))
"""


PROFILED = """
import cProfile, pstats, sys
from warpmis.usd import load_stage
profile = cProfile.Profile()
profile.runcall(load_stage, sys.argv[1], complexity=sys.argv[2], width=int(sys.argv[3]))
pstats.Stats(profile).sort_stats("tottime").print_stats(25)
"""


def write_stage(path: Path, meshes: int, triangles: int, scheme: str, shape: str) -> None:
    """Meshes of quadrilaterals in rows, `triangles` in all when two make a quadrilateral."""
    side = math.ceil(math.sqrt(triangles / (2 * meshes))) + 1
    y, x = np.divmod(np.arange(side * side), side)
    vertex = np.arange(side * side, dtype=np.int32).reshape(side, side)
    quads = np.stack([vertex[:-1, :-1], vertex[:-1, 1:], vertex[1:, 1:], vertex[1:, :-1]], axis=-1).reshape(-1, 4)
    st = np.stack([x, y], axis=-1) / (side - 1)
    points_of = grids(st) if shape == "grids" else pieces(st)
    if shape == "pieces":
        quads = quads - (quads % side == side - 1) * (side - 1)  # the last meridian is the first
    columns = math.ceil(math.sqrt(meshes))
    stage = Usd.Stage.CreateNew(str(path))
    for number in range(meshes):
        mesh = UsdGeom.Mesh.Define(stage, f"/World/Group{number // 100}/Mesh{number}")
        points = points_of(number) + 1.1 * np.array([number % columns, number // columns, 0.0])
        mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.astype(np.float32)))
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(quads.reshape(-1)))
        mesh.CreateFaceVertexCountsAttr(Vt.IntArray(len(quads), 4))
        if scheme != "unauthored":
            mesh.CreateSubdivisionSchemeAttr(scheme)
        if shape == "pieces":
            coordinates = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
                "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying
            )
            coordinates.Set(Vt.Vec2fArray.FromNumpy(st[quads.reshape(-1)].astype(np.float32)))
    if shape == "pieces":
        UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
        place_camera(stage, 1.1 * columns)
    stage.Save()


def grids(st: NDArray[np.float64]) -> Callable[[int], NDArray[np.float64]]:
    """Bumpy unit squares."""
    bumps = np.random.default_rng(0)
    return lambda _number: np.column_stack([st, 0.05 * bumps.random(len(st))])


def pieces(st: NDArray[np.float64]) -> Callable[[int], NDArray[np.float64]]:
    """Bodies of revolution about Z, turned to one of six profiles; rings stand closer where the profile bends."""

    def turned(number: int) -> NDArray[np.float64]:
        around, height = 2.0 * np.pi * st[:, 0], st[:, 1] - 0.05 * np.sin(4.0 * np.pi * st[:, 1])
        radius = 0.3 * (1.0 - 0.6 * height) * (1.0 + 0.35 * np.sin((3 + number % 6) * np.pi * height))
        return np.column_stack([radius * np.cos(around), radius * np.sin(around), 1.5 * height])

    return turned


def place_camera(stage: Usd.Stage, size: float) -> None:
    """A camera that sees the whole board, `size` along each side, from above and before it."""
    camera = UsdGeom.Camera.Define(stage, "/Camera")
    look = Gf.Matrix4d().SetLookAt(
        Gf.Vec3d(size / 2, -1.6 * size, 1.3 * size), Gf.Vec3d(size / 2, size / 2, 0), Gf.Vec3d(0, 0, 1)
    )
    camera.AddTransformOp().Set(look.GetInverse())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--meshes", type=int, default=1000)
    parser.add_argument("--triangles", type=int, default=1_000_000, help="of all meshes, before refinement")
    parser.add_argument("--scheme", default="none", help="subdivisionScheme of the meshes, or unauthored (none)")
    parser.add_argument("--complexity", default="high", help="refinement of the meshes, unless --scheme is none (high)")
    parser.add_argument("--shape", choices=("grids", "pieces"), default="grids")
    parser.add_argument(
        "--width", type=int, default=960, help="of the picture, which says what is worth refining (960)"
    )
    parser.add_argument("--profile", action="store_true", help="print where the time goes, instead of measuring it")
    parser.add_argument("--json", metavar="FILE")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "stage.usdc"
        write_stage(path, options.meshes, options.triangles, options.scheme, options.shape)
        size = path.stat().st_size / 2**20
        command = [sys.executable, "-c", LOAD, str(path), options.complexity, str(options.width)]
        if options.profile:
            subprocess.run([sys.executable, "-c", PROFILED, *command[3:]], check=True)
            return
        figures = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    figures = {"stage_MiB": size, **figures}
    for name, value in figures.items():
        print(f"{name:16} {value:12.1f}")
    if options.json:
        Path(options.json).write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
