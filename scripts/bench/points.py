"""Memory and time of many points: writes a stage, reads it in a process of its own, and tells its peak memory.

python scripts/bench/points.py [--points 1000000] [--colors constant|vertex] [--render] [--json FILE]
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from pxr import Gf, Usd, UsdGeom, Vt

# What the process of its own does.
LOAD = "import sys, warpmis; scene = warpmis.load_stage(sys.argv[1]); print(scene.geometry.nbytes)"
RENDER = "import sys, warpmis; print(warpmis.render(sys.argv[1], width=480, spp=16, method='nee').stats['triangles'])"


def write_stage(path: Path, count: int, interpolation: str) -> None:
    """Points spread evenly in a cube, one unit of space each, seen from outside."""
    rng = np.random.default_rng(0)
    side = count ** (1.0 / 3.0)
    stage = Usd.Stage.CreateNew(str(path))
    points = UsdGeom.Points.Define(stage, "/Points")
    points.CreatePointsAttr(Vt.Vec3fArray.FromNumpy((side * rng.random((count, 3))).astype(np.float32)))
    points.CreateWidthsAttr(Vt.FloatArray(count, 0.5))
    colors = rng.random((count if interpolation == "vertex" else 1, 3)).astype(np.float32)
    points.CreateDisplayColorPrimvar(interpolation).Set(Vt.Vec3fArray.FromNumpy(colors))
    camera = UsdGeom.Camera.Define(stage, "/Camera")
    camera.AddTranslateOp().Set(Gf.Vec3d(side / 2, side / 2, 3.5 * side))
    stage.Save()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, default=1_000_000)
    parser.add_argument("--colors", choices=["constant", "vertex"], default="vertex")
    parser.add_argument("--render", action="store_true", help="render the stage, not only read it")
    parser.add_argument("--json", metavar="FILE")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "points.usdc"
        write_stage(path, options.points, options.colors)
        start = time.perf_counter()
        command = [sys.executable, "-c", RENDER if options.render else LOAD, str(path)]
        output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        seconds = time.perf_counter() - start
    figures = {
        "triangles" if options.render else "geometry_bytes": int(output),
        "wall_seconds": round(seconds, 1),
        "peak_MiB": round(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024),
    }
    for name, value in figures.items():
        print(f"{name:16} {value:14,}")
    if options.json:
        Path(options.json).write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
