"""Every method on every scene, at equal samples:

    python scripts/bench/methods.py [SCENE ...] [--budget 64] [--seeds 24] [--only METHOD ...] [--json FILE]

A budget of 64 samples per pixel takes each method as it comes. One of 2304 takes rounds of 256 samples, as Murray et
al. (2020) do, 1 and 8 of them. All figures are relative to `balance` in the same run, medians over the seeds:

variance    relMSE of the picture, learning samples included (warpmis/metrics.py), the reference's own noise taken off
time        CPU seconds of tracing and learning on one thread; the lower quartile, for others only ever add to it
efficiency  1 / (variance x time), with its standard error: that of the variance, whose noise is by far the greater

The methods take turns seed by seed, so that a change of the machine's speed falls on all of them. At the end of each
scene: `auto` over the best of the others, chosen by one half of the seeds and judged by the other, and over `murray20`
with two strategies.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import warpmis
from warpmis.config import CELL_STRATEGIES, STRATEGIES
from warpmis.film.metrics import estimated_relative_error, relative_mse
from warpmis.methods import METHODS

USD_SCENES = Path(__file__).parents[2] / "usd_scenes"
SCENES = ("cornell_box", "ajar_door", "veach_plates", "open_terrace")
LEARN_SPP = 256
ROUNDS = (1, 8)
BASELINE = "balance"
STRATEGY_SETS = {
    "murray20": (("bsdf", "light"), ("bsdf", "light", "uniform"), ("bsdf", "light", "cosine")),
    "pooled": (("bsdf", "light"), ("bsdf", "light", "uniform"), ("diffuse", "specular", "light"), STRATEGIES),
    "cells": (("bsdf", "light"), ("bsdf", "light", "uniform"), ("bsdf", "light", "guide"), CELL_STRATEGIES),
}
ALL = {STRATEGIES: "all eight", CELL_STRATEGIES: "all nine"}


@dataclass(frozen=True)
class Variant:
    label: str
    settings: dict[str, Any] = field(default_factory=dict)


def variants(budget: int) -> Iterator[Variant]:
    """All methods, those that take more with several sets of strategies; for a large budget with 1 and 8 rounds."""
    yield Variant("balance, random choice", {"method": "balance", "strategy_choice": "random"})
    for name, method in METHODS.items():
        if name == "fixed":
            continue
        for strategies in STRATEGY_SETS.get(name, (("bsdf", "light"),)):
            label = name
            if name in STRATEGY_SETS:
                label += " " + ALL.get(strategies, ",".join(strategies))
            settings = {"method": name, "strategies": strategies}
            if not method.learns or method.is_of_pair or budget < LEARN_SPP * (1 + max(ROUNDS)):
                yield Variant(label, settings)
                continue
            for rounds in ROUNDS if method.rounds is None else (method.rounds,):
                yield Variant(f"{label} {rounds} x", {**settings, "learn_rounds": rounds, "learn_spp": LEARN_SPP})


@dataclass
class Runs:
    variance: list[float] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)


class CpuClock:
    """CPU seconds of the phases that trace, told by the progress reports."""

    def __init__(self) -> None:
        self.since: float | None = None

    def __call__(self, progress: warpmis.Progress) -> None:
        if self.since is None and progress.phase in ("learn", "render"):
            self.since = time.process_time()

    def seconds(self) -> float:
        assert self.since is not None
        return time.process_time() - self.since


def measure(
    scene: warpmis.Scene, chosen: list[Variant], budget: int, seeds: int, reference_spp: int
) -> dict[str, Runs]:
    # Whose variance tells its noise.
    reference = warpmis.render(scene, method="auto", spp=reference_spp, seed=10_000, sampler="independent")
    noise = estimated_relative_error(reference.image, reference.variance / reference.samples) ** 2
    runs = {variant.label: Runs() for variant in chosen}
    for variant in chosen:  # compiles
        warpmis.render(scene, spp=budget, threads=2, **variant.settings)
    for seed in range(seeds):
        for variant in chosen:
            clock = CpuClock()
            result = warpmis.render(scene, spp=budget, seed=seed, threads=1, progress=clock, **variant.settings)
            own = runs[variant.label]
            own.seconds.append(clock.seconds())
            own.variance.append(max(relative_mse(result.image, reference.image) - noise, 1e-9))
    return runs


def lower_quartile(values: list[float]) -> float:
    return statistics.quantiles(values, n=4)[0]


def efficiency_over(runs: dict[str, Runs], own: str, other: str, part: slice) -> dict[str, float]:
    """Variance, time and efficiency of one method over another's by a part of the seeds, and the efficiency's standard
    error; time by all seeds."""
    ours, theirs = runs[own].variance[part], runs[other].variance[part]
    variance = statistics.median(ours) / statistics.median(theirs)
    seconds = lower_quartile(runs[own].seconds) / lower_quartile(runs[other].seconds)
    # The same seed gives both the same camera rays: quotients of a seed's own scatter least.
    quotients = [v / other_v for v, other_v in zip(ours, theirs, strict=True)]
    spread = statistics.stdev(quotients) / statistics.mean(quotients) / len(quotients) ** 0.5
    efficiency = 1.0 / (variance * seconds)
    return {"variance": variance, "time": seconds, "efficiency": efficiency, "error": efficiency * spread}


def table(runs: dict[str, Runs]) -> list[dict[str, Any]]:
    return [{"method": label, **efficiency_over(runs, label, BASELINE, slice(None))} for label in runs]


def of_auto(runs: dict[str, Runs]) -> str:
    """`auto` over the best of the others, which one half of the seeds tells and the other half judges: the best of so
    many by the same seeds is the luckiest. And over `murray20` with two strategies."""
    own = next(name for name in runs if name.startswith("auto"))
    others = [name for name in runs if not name.startswith("auto")]
    halves = slice(0, None, 2), slice(1, None, 2)
    best = [max(others, key=lambda name: efficiency_over(runs, name, own, half)["efficiency"]) for half in halves]
    judged = [efficiency_over(runs, own, name, half) for name, half in zip(best, reversed(halves), strict=True)]
    over = math.prod(one["efficiency"] for one in judged) ** 0.5
    error = 0.5 * math.hypot(*(one["error"] for one in judged))
    published = [name for name in others if name.startswith("murray20 bsdf,light") and name.count(",") == 1]
    ratios = {name: efficiency_over(runs, own, name, slice(None))["efficiency"] for name in published}
    against = ", ".join(f"{ratio:.2f} of {name}" for name, ratio in ratios.items())
    names = " or ".join(dict.fromkeys(best))
    return f"auto has {over:.2f} ± {error:.2f} of the efficiency of the best of the others ({names}), {against}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=SCENES)
    parser.add_argument("--budget", type=int, default=64, help="samples per pixel in all")
    parser.add_argument("--width", type=int, default=64)
    parser.add_argument("--seeds", type=int, default=24)
    parser.add_argument("--reference-spp", type=int, default=16384)
    parser.add_argument("--only", nargs="+", help="labels of the table, with auto and balance among them")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    chosen = [one for one in variants(arguments.budget) if arguments.only is None or one.label in arguments.only]
    report = {}
    for name in arguments.scenes:
        start = time.perf_counter()
        scene = warpmis.load_stage(USD_SCENES / name / "scene.usda", width=arguments.width)
        runs = measure(scene, chosen, arguments.budget, arguments.seeds, arguments.reference_spp)
        rows = table(runs)
        report[name] = rows
        print(f"\n{name}, {arguments.budget} samples per pixel ({time.perf_counter() - start:.0f} s)")
        print("| method | variance | time | efficiency |\n|---|---|---|---|")
        for row in rows:
            figures = f"{row['variance']:.2f} | {row['time']:.2f} | {row['efficiency']:.2f} ± {row['error']:.2f}"
            print(f"| {row['method']} | {figures} |")
        print(of_auto(runs), flush=True)
    if arguments.json:
        arguments.json.write_text(json.dumps(report, indent=1))


if __name__ == "__main__":
    main()
