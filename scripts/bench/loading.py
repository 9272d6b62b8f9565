"""What loading a large stage costs, in time and memory:

    python scripts/bench/loading.py [--meshes N] [--triangles N] [--scheme NAME] [--complexity NAME] [--json FILE]

Writes a stage of equal meshes into a temporary folder and loads it in a fresh process, which reports the seconds of
warpmis.load_stage and the process's peak memory [MiB] before and after. The default, a million triangles in a thousand
meshes, is to load in less than 20 s and 3 GiB on two cores.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from pxr import Usd, UsdGeom, Vt

LOAD = """
import json, resource, sys, time
import warpmis
from warpmis.usd import load_stage
peak = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
imported, start = peak(), time.perf_counter()
scene = load_stage(sys.argv[1], complexity=sys.argv[2])
seconds = time.perf_counter() - start
print(json.dumps({
    "triangles": len(scene.geometry.triangles), "prims": len(scene.prims), "warnings": len(scene.warnings),
    "seconds": seconds, "peak_MiB": peak(), "peak_before_MiB": imported,
}))
"""


def write_stage(path: Path, meshes: int, triangles: int, scheme: str) -> None:
    """Bumpy square grids of quadrilaterals, `triangles` in all when two make a quadrilateral, in rows."""
    side = math.ceil(math.sqrt(triangles / (2 * meshes))) + 1
    vertex = np.arange(side * side, dtype=np.int32).reshape(side, side)
    quads = np.stack([vertex[:-1, :-1], vertex[:-1, 1:], vertex[1:, 1:], vertex[1:, :-1]], axis=-1).reshape(-1, 4)
    y, x = np.divmod(np.arange(side * side), side)
    flat = np.stack([x, y, 0 * x], axis=-1) / (side - 1)
    bumps = np.random.default_rng(0)
    columns = math.ceil(math.sqrt(meshes))
    stage = Usd.Stage.CreateNew(str(path))
    for number in range(meshes):
        mesh = UsdGeom.Mesh.Define(stage, f"/World/Group{number // 100}/Mesh{number}")
        points = flat + np.array([1.1 * (number % columns), 1.1 * (number // columns), 0.0])
        points[:, 2] = 0.05 * bumps.random(len(points))
        mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.astype(np.float32)))
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(quads.reshape(-1)))
        mesh.CreateFaceVertexCountsAttr(Vt.IntArray(len(quads), 4))
        mesh.CreateSubdivisionSchemeAttr(scheme)
    stage.Save()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--meshes", type=int, default=1000)
    parser.add_argument("--triangles", type=int, default=1_000_000, help="of all meshes, before refinement")
    parser.add_argument("--scheme", default="none", help="subdivisionScheme of the meshes (none)")
    parser.add_argument("--complexity", default="high", help="refinement of the meshes, unless --scheme is none (high)")
    parser.add_argument("--json", metavar="FILE")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "stage.usdc"
        write_stage(path, options.meshes, options.triangles, options.scheme)
        size = path.stat().st_size / 2**20
        command = [sys.executable, "-c", LOAD, str(path), options.complexity]
        figures = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    figures = {"stage_MiB": size, **figures}
    for name, value in figures.items():
        print(f"{name:16} {value:12.1f}")
    if options.json:
        Path(options.json).write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
