"""Whether time grows with the samples, and memory with pixels and triangles, as docs/effects.md says:

    python scripts/bench/scaling.py [SCENE ...] [--json FILE]

time    of a sample in a round of 16, 64, 256 and 1024 samples per pixel, over that of all rounds together: 1 if linear
memory  bytes of the scene by what they are for, and of a pixel

CPU time of one thread, medians of interleaved rounds with their quartiles. A round costs a part of a millisecond
whatever it traces: of a picture 24 pixels wide that is several percent of 16 samples.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from pathlib import Path
from typing import Any

import warpmis
from warpmis.config import RenderConfig
from warpmis.device.upload import upload
from warpmis.learn.schedule import Round
from warpmis.rendering.integrator import Integrator, allocation_of
from warpmis.rendering.specialise import features_of

USD_SCENES = Path(__file__).parents[2] / "usd_scenes"
SAMPLES = (16, 64, 256, 1024)


def seconds_per_sample(run: Integrator, samples: int) -> float:
    start = time.process_time()
    run.trace(Round(0, samples, learn=False), lambda done: None)
    return (time.process_time() - start) / (samples * run.pixels)


def scaling(scene: warpmis.Scene, method: str, repeats: int) -> dict[str, Any]:
    config = RenderConfig(method=method, threads=1)
    run = Integrator(upload(scene, "cpu"), features_of(scene, config), config, allocation_of(config, *scene.resolution))
    seconds_per_sample(run, SAMPLES[0])
    rows = [[seconds_per_sample(run, samples) for samples in SAMPLES] for _ in range(repeats)]
    columns = list(zip(*([value / statistics.mean(row) for value in row] for row in rows), strict=True))
    memory = run.bytes()
    return {
        "time": {str(n): statistics.quantiles(column, n=4) for n, column in zip(SAMPLES, columns, strict=True)},
        "scene": memory["scene"],
        "pixel": memory["picture"] / run.pixels,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=["cornell_box", "veach_plates"], help="folders in usd_scenes")
    parser.add_argument("--method", default="balance")
    parser.add_argument("--width", type=int, default=64)
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    report = {}
    for name in arguments.scenes:
        scene = warpmis.load_stage(USD_SCENES / name / "scene.usda", width=arguments.width)
        report[name] = scaling(scene, arguments.method, arguments.repeats)
        for samples, (low, median, high) in report[name]["time"].items():
            print(f"{name:14} {samples:>5} samples: {median:.3f} ({low:.3f} to {high:.3f})", flush=True)
        print(f"{name:14} bytes a pixel {report[name]['pixel']:.0f}, of the scene {report[name]['scene']}", flush=True)
    if arguments.json:
        arguments.json.write_text(json.dumps(report, indent=2))


if __name__ == "__main__":
    main()
