"""Methods `counts`, `variance_aware` and `optimal`, and counts that are given, against `nee` and `auto`, at as many
samples per pixel of the picture:

    python scripts/bench/counts.py [SCENE ...] [--spp 64] [--seeds 12] [--given 1,2 2,2] [--json FILE]

A SCENE is a folder of usd_scenes, or a stage. Variance is that between the seeds' pictures, relative to the squared
brightness and without the worst pixels as in relMSE; it needs no reference. Time is CPU seconds on one thread, pilots
included, the mean as well. Both are over those of `nee`. Efficiency is 1 / (variance x time), over `nee` and over
`auto`, and ± is its standard error by a jackknife over the seeds. `counts L,P` takes L light samples and P paths at
each first vertex, in place of what a pilot finds.
"""

from __future__ import annotations

import argparse
import json
from contextlib import nullcontext
from pathlib import Path
from unittest import mock

import numpy as np
from methods import CpuClock
from numpy.typing import NDArray

import warpmis
from warpmis.film.metrics import LUMINANCE, squared_scale, without_outliers
from warpmis.rendering import counted

USD_SCENES = Path(__file__).parents[2] / "usd_scenes"
SCENES = ("cornell_box", "ajar_door", "veach_plates", "open_terrace")
Runs = dict[str, tuple[list[NDArray[np.float32]], list[float]]]


def render(scene: warpmis.Scene, label: str, spp: int, seed: int) -> tuple[warpmis.RenderResult, float]:
    method, _, given = label.partition(" ")
    counts = tuple(int(count) for count in given.split(",")) if given else None
    clock = CpuClock()
    # One round of a pilot that is not asked.
    given_counts = mock.patch.multiple(counted, best_counts=lambda *_: counts, FEWEST_PIXELS=1, PILOT_ROUNDS=1)
    with given_counts if counts else nullcontext():
        result = warpmis.render(scene, method=method, spp=spp, seed=seed, threads=1, progress=clock)
    return result, clock.seconds()


def measure(scene: warpmis.Scene, labels: list[str], spp: int, seeds: int) -> Runs:
    """Pictures and seconds, seed by seed in turn."""
    runs: Runs = {label: ([], []) for label in labels}
    for label in labels:  # compiles
        render(scene, label, spp, 0)
    for seed in range(seeds):
        for label in labels:
            result, seconds = render(scene, label, spp, seed)
            runs[label][0].append(result.image)
            runs[label][1].append(seconds)
    return runs


def variance(pictures: list[NDArray[np.float32]], scale: NDArray[np.float64]) -> float:
    """Mean over the pixels of the variance between the pictures, relative to the squared brightness."""
    apart = np.array(pictures, np.float64)
    apart -= apart.mean(axis=0)
    of_pixels = (apart**2 @ LUMINANCE).sum(axis=0) / (len(pictures) - 1)
    return float(without_outliers(of_pixels / scale).mean())


def over(runs: Runs, label: str, other: str) -> tuple[float, float]:
    """Efficiency over another's, and its standard error."""
    scale = squared_scale(np.mean(runs["nee"][0], axis=0))
    seconds = float(np.mean(runs[label][1]) / np.mean(runs[other][1]))

    def efficiency(kept: list[int]) -> float:
        ours, theirs = (variance([runs[name][0][i] for i in kept], scale) for name in (label, other))
        return theirs / ours / seconds

    every = list(range(len(runs[label][0])))
    parts = [efficiency([i for i in every if i != left]) for left in every]
    return efficiency(every), float(np.std(parts) * (len(every) - 1) ** 0.5)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=SCENES)
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--width", type=int, default=64)
    parser.add_argument("--seeds", type=int, default=12)
    parser.add_argument("--given", nargs="*", default=[], help="counts of light samples and paths, such as 1,2")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    labels = ["nee", "auto", "counts", "variance_aware", "optimal", *(f"counts {given}" for given in arguments.given)]
    report: dict[str, dict[str, dict[str, object]]] = {}
    for name in arguments.scenes:
        path = USD_SCENES / name / "scene.usda"
        scene = warpmis.load_stage(path if path.is_file() else name, width=arguments.width)
        runs = measure(scene, labels, arguments.spp, arguments.seeds)
        label = name if path.is_file() else Path(name).parent.name
        print(f"\n{label}, {arguments.spp} samples per pixel, {arguments.seeds} seeds")
        print("| method | variance | time | over nee | over auto |\n|---|---|---|---|---|")
        rows = report[label] = {}
        scale = squared_scale(np.mean(runs["nee"][0], axis=0))
        for method in labels:
            of_nee = variance(runs["nee"][0], scale)
            ratio = variance(runs[method][0], scale) / of_nee
            seconds = np.mean(runs[method][1]) / np.mean(runs["nee"][1])
            figures = over(runs, method, "nee"), over(runs, method, "auto")
            rows[method] = {"variance": ratio, "time": float(seconds), "over": figures}
            cells = " | ".join(f"{efficiency:.2f} ± {error:.2f}" for efficiency, error in figures)
            print(f"| {method} | {ratio:.2f} | {seconds:.2f} | {cells} |", flush=True)
    if arguments.json:
        arguments.json.write_text(json.dumps(report, indent=1))


if __name__ == "__main__":
    main()
