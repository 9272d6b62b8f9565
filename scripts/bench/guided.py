"""The method guided against nee and today's default, at equal samples:

    python scripts/bench/guided.py [SCENE ...] [--spp 64 256] [--width 96] [--seeds 4] [--json FILE]

A scene is a folder of usd_scenes or the path of a stage. The squared error is (x - R0).(x - R1) with two independent
references, so that their noise does not enter it, without the worst 0.1 % of the pixels.

error   relMSE of the other method over that of guided: how many times as much squared error it leaves
time    CPU seconds of learning and tracing on one thread, theirs over those of guided: below 1 guided takes longer
work    error x time: how many times as efficient guided is
guided  share of the seeds whose pilot found that the picture gains
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np
from denoise import Reference, stage_of
from methods import CpuClock

import warpmis

SCENES = ("cornell_box", "veach_plates", "open_terrace", "ajar_door")
OTHERS = ("nee", "auto")


def measure(scene: warpmis.Scene, reference: Reference, method: str, spp: int, seed: int) -> tuple[float, float, bool]:
    """relMSE, CPU seconds, and whether the picture was guided."""
    clock = CpuClock()
    result = warpmis.render(scene, method=method, spp=spp, seed=seed, threads=1, progress=clock)
    return reference.relative_mse(result.image), clock.seconds(), result.stats["next_event_pixels"] == 0.0


def row_of(scene: warpmis.Scene, reference: Reference, spp: int, seeds: int) -> dict[str, float]:
    found: dict[str, list[tuple[float, float, bool]]] = {method: [] for method in (*OTHERS, "guided")}
    for seed in range(seeds):
        for method, results in found.items():  # in turns, so that a change of the machine's speed falls on all
            results.append(measure(scene, reference, method, spp, seed))
    error = {method: float(np.mean([one[0] for one in results])) for method, results in found.items()}
    seconds = {method: float(np.median([one[1] for one in results])) for method, results in found.items()}
    row = {"spp": float(spp), "guided": float(np.mean([one[2] for one in found["guided"]])), "relMSE": error["guided"]}
    for method in OTHERS:
        row[f"error {method}"] = error[method] / error["guided"]
        row[f"time {method}"] = seconds[method] / seconds["guided"]
        row[f"work {method}"] = row[f"error {method}"] * row[f"time {method}"]
    return row


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=SCENES, help="folders in usd_scenes, or paths of stages")
    parser.add_argument("--spp", type=int, nargs="+", default=[64, 256])
    parser.add_argument("--width", type=int, default=96)
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--reference-spp", type=int, default=4096)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    report: dict[str, list[dict[str, float]]] = {}
    print(
        "| scene, spp | guided | relMSE | error, time, **work** over nee | over auto |\n|---|---|---|---|---|",
        flush=True,
    )
    for name in arguments.scenes:
        start = time.perf_counter()
        scene = warpmis.load_stage(stage_of(name), width=arguments.width)
        reference = Reference(scene, arguments.reference_spp, "guided")
        for method in (*OTHERS, "guided"):  # compiles
            warpmis.render(scene, method=method, spp=128, seed=1)
        label = Path(name).parent.name if Path(name).exists() else name
        rows = report[label] = []
        for spp in arguments.spp:
            row = row_of(scene, reference, spp, arguments.seeds)
            rows.append(row)
            cells = [
                f"{row[f'error {one}']:.2f}, {row[f'time {one}']:.2f}, **{row[f'work {one}']:.2f}**" for one in OTHERS
            ]
            print(f"| {label}, {spp} | {row['guided']:.0%} | {row['relMSE']:.5f} | {' | '.join(cells)} |", flush=True)
        print(f"({time.perf_counter() - start:.0f} s)", flush=True)
    if arguments.json:
        arguments.json.write_text(json.dumps(report, indent=1))


if __name__ == "__main__":
    main()
