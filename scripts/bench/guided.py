"""The spatial cache against next-event estimation, and `auto` against that of another version of warpmis:

    python scripts/bench/guided.py [SCENE ...] [--spp 64 256] [--width 64] [--seeds 6] [--before PATH] [--json FILE]

A scene is a folder of usd_scenes, a name of interiors.py, or the path of a stage. The error is the relative variance
over the seeds, the squares over those of the mean of all pictures, without the worst 0.1 % of the pixels: all methods
have the same mean, as tests/statistical show. Time is CPU time of one thread, learning included.

guided, auto  how many times as efficient as `nee`: error x time
before        how many times as efficient `auto` is as the `auto` of the checkout at PATH, whose pictures are made as
              bright as ours; in brackets how bright they are: by other materials paths are longer or shorter
chosen        share of the seeds that `auto` guides
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from interiors import STAGES, write_interior

ROOT = Path(__file__).parents[2]
SCENES = ("cornell_box", "ajar_door", "veach_plates", "open_terrace", *STAGES)
METHODS = ("nee", "guided", "auto")
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
DARK = 0.1
OUTLIERS = 1e-3


def work(stage: str, width: int, spp: int, seeds: int, methods: list[str], out: str) -> None:
    """In a process of its own, by whichever version of warpmis is on the path: render, and store pictures and times."""
    import warpmis

    scene = warpmis.load_stage(stage, width=width)
    found: dict[str, Any] = {}
    for method in methods:
        warpmis.render(scene, method=method, spp=128, seed=10_000)  # compiles
        found |= {f"{method} pictures": [], f"{method} seconds": [], f"{method} guided": []}
    for seed in range(seeds):
        for method in methods:  # in turns, so that a change of the machine's speed falls on all
            begun = time.process_time()
            result = warpmis.render(scene, method=method, spp=spp, seed=seed, threads=1)
            found[f"{method} seconds"].append(time.process_time() - begun)
            found[f"{method} pictures"].append(result.image @ LUMINANCE)
            found[f"{method} guided"].append(result.stats["next_event_pixels"] == 0.0)
    np.savez(out, **found)


def rendered(program: Path, *arguments: Any) -> dict[str, np.ndarray]:
    """What `work` stores, by the program in this checkout."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "found.npz"
        call = json.dumps([*arguments, str(out)])
        environment = {**os.environ, "PYTHONPATH": str(program)}
        subprocess.run([sys.executable, __file__, "--work", call], env=environment, check=True)
        with np.load(out) as found:
            return dict(found)


def relative_variance(pictures: np.ndarray, mean: np.ndarray) -> float:
    scale = mean**2 + (DARK * mean.mean()) ** 2
    values = np.sort((pictures.var(axis=0, ddof=1) / scale).ravel())
    return float(values[: math.ceil(len(values) * (1.0 - OUTLIERS))].mean())


def row_of(stage: str, arguments: argparse.Namespace, spp: int) -> dict[str, float]:
    settings = (stage, arguments.width, spp, arguments.seeds)
    ours = rendered(ROOT, *settings, list(METHODS))
    mean = np.mean([ours[f"{method} pictures"].mean(axis=0) for method in METHODS], axis=0)
    effort = {
        method: relative_variance(ours[f"{method} pictures"], mean) * float(np.median(ours[f"{method} seconds"]))
        for method in METHODS
    }
    row = {method: effort["nee"] / effort[method] for method in ("guided", "auto")}
    row |= {"chosen": float(ours["auto guided"].mean()), "seconds": float(np.median(ours["auto seconds"]))}
    if arguments.before:
        theirs = rendered(arguments.before, *settings, ["auto"])
        brightness = float(theirs["auto pictures"].mean() / mean.mean())
        before = relative_variance(theirs["auto pictures"] / brightness, mean)
        row |= {"before": before * float(np.median(theirs["auto seconds"])) / effort["auto"], "brightness": brightness}
    return row


def stage_of(name: str, folder: Path) -> Path:
    if name in STAGES:
        return write_interior(name, folder)
    return Path(name) if Path(name).exists() else ROOT / "usd_scenes" / name / "scene.usda"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=SCENES, help="folders in usd_scenes, interiors, or paths")
    parser.add_argument("--spp", type=int, nargs="+", default=[64, 256])
    parser.add_argument("--width", type=int, default=64)
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--before", type=Path, help="another checkout of warpmis")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--work", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.work:
        work(*json.loads(arguments.work))
        return
    report: dict[str, dict[int, dict[str, float]]] = {}
    print(
        "| scene, spp | guided over nee | auto over nee | chosen | auto over before |\n|---|---|---|---|---|",
        flush=True,
    )
    with tempfile.TemporaryDirectory() as folder:
        for name in arguments.scenes:
            stage = stage_of(name, Path(folder))
            label = stage.parent.name if Path(name).exists() else name
            for spp in arguments.spp:
                row = report.setdefault(label, {})[spp] = row_of(str(stage), arguments, spp)
                before = f"{row['before']:.2f} (brightness {row['brightness']:.2f})" if "before" in row else ""
                cells = f"{row['guided']:.2f} | {row['auto']:.2f} | {row['chosen']:.0%} | {before}"
                print(f"| {label}, {spp} | {cells} |", flush=True)
    if arguments.before:
        for spp in arguments.spp:
            gains = [rows[spp]["before"] for rows in report.values()]
            print(f"{spp} samples: geometric mean {math.exp(np.log(gains).mean()):.2f} over before", flush=True)
    if arguments.json:
        arguments.json.write_text(json.dumps(report, indent=1))


if __name__ == "__main__":
    main()
