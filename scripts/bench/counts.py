"""Method `counts`, and counts that are given, against `nee` and `auto`, at equal samples per pixel:

    python scripts/bench/counts.py [SCENE ...] [--spp 64] [--seeds 12] [--given 1,2 2,2] [--json FILE]

A SCENE is a folder of usd_scenes, or a stage. Variance is relMSE with the reference's own noise taken off, the mean
over the seeds; time is CPU seconds on one thread, pilots included, the mean as well. Both are over those of `nee`.
Efficiency is 1 / (variance x time), over `nee` and over `auto`, and ± is its standard error from the seeds' variances.
`counts L,P` takes L light samples and P paths at each first vertex, in place of what the pilot finds.
"""

from __future__ import annotations

import argparse
import json
from contextlib import nullcontext
from pathlib import Path
from unittest import mock

import numpy as np
from methods import CpuClock

import warpmis
from warpmis.film.metrics import estimated_relative_error, relative_mse
from warpmis.rendering import counted

USD_SCENES = Path(__file__).parents[2] / "usd_scenes"
SCENES = ("cornell_box", "ajar_door", "veach_plates", "open_terrace")
Runs = dict[str, tuple[list[float], list[float]]]


def render(scene: warpmis.Scene, label: str, spp: int, seed: int) -> tuple[warpmis.RenderResult, float]:
    method, _, given = label.partition(" ")
    counts = tuple(int(count) for count in given.split(",")) if given else None
    clock = CpuClock()
    with mock.patch.object(counted, "best_counts", lambda *_: counts) if counts else nullcontext():
        result = warpmis.render(scene, method=method, spp=spp, seed=seed, threads=1, progress=clock)
    return result, clock.seconds()


def measure(scene: warpmis.Scene, labels: list[str], spp: int, seeds: int, reference_spp: int) -> Runs:
    """Variances and seconds, seed by seed in turn."""
    reference = warpmis.render(scene, method="nee", spp=reference_spp, seed=10_000, sampler="independent")
    noise = estimated_relative_error(reference.image, reference.variance / reference.samples) ** 2
    runs: Runs = {label: ([], []) for label in labels}
    for label in labels:  # compiles
        render(scene, label, spp, 0)
    for seed in range(seeds):
        for label in labels:
            result, seconds = render(scene, label, spp, seed)
            runs[label][0].append(relative_mse(result.image, reference.image) - noise)
            runs[label][1].append(seconds)
    return runs


def over(runs: Runs, label: str, other: str) -> tuple[float, float]:
    """Efficiency over another's, and its standard error."""
    ours, theirs = np.array(runs[label][0]), np.array(runs[other][0])
    ratio = ours.mean() / theirs.mean()
    spread = (ours - ratio * theirs).std(ddof=1) / theirs.mean() / len(ours) ** 0.5 / ratio
    efficiency = 1.0 / (ratio * np.mean(runs[label][1]) / np.mean(runs[other][1]))
    return float(efficiency), float(efficiency * spread)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=SCENES)
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--width", type=int, default=64)
    parser.add_argument("--seeds", type=int, default=12)
    parser.add_argument("--given", nargs="*", default=[], help="counts of light samples and paths, such as 1,2")
    parser.add_argument("--reference-spp", type=int, default=4096)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    labels = ["nee", "auto", "counts", *(f"counts {given}" for given in arguments.given)]
    report: dict[str, dict[str, dict[str, object]]] = {}
    for name in arguments.scenes:
        path = USD_SCENES / name / "scene.usda"
        scene = warpmis.load_stage(path if path.is_file() else name, width=arguments.width)
        runs = measure(scene, labels, arguments.spp, arguments.seeds, arguments.reference_spp)
        label = name if path.is_file() else Path(name).parent.name
        print(f"\n{label}, {arguments.spp} samples per pixel, {arguments.seeds} seeds")
        print("| method | variance | time | over nee | over auto |\n|---|---|---|---|---|")
        rows = report[label] = {}
        for method in labels:
            variance = np.mean(runs[method][0]) / np.mean(runs["nee"][0])
            seconds = np.mean(runs[method][1]) / np.mean(runs["nee"][1])
            figures = over(runs, method, "nee"), over(runs, method, "auto")
            rows[method] = {"variance": float(variance), "time": float(seconds), "over": figures}
            cells = " | ".join(f"{efficiency:.2f} ± {error:.2f}" for efficiency, error in figures)
            print(f"| {method} | {variance:.2f} | {seconds:.2f} | {cells} |", flush=True)
    if arguments.json:
        arguments.json.write_text(json.dumps(report, indent=1))


if __name__ == "__main__":
    main()
