"""Whether learning ever loses: variance of the methods that learn over that of `balance`, on every hard case:

    python scripts/bench/hard_cases.py [CASE ...] [--budget 256] [--most-seeds 8192] [--json FILE]

All methods take `--budget` samples per pixel, learning included, with the same seeds. A render's error is the squared
distance of its picture from its method's mean, each pixel over its squared brightness (warpmis/metrics.py:
squared_scale), fireflies and all; the ratio is that of the errors' means, and `error` the root of `balance`'s. With
d_i = e_i / mean(e) - b_i / mean(b) for seed i,

    log(ratio) +- t_0.99 sd(d) / sqrt(n)

bounds it from either side at 99 % each (Student's t, delta method; the 1 % is shared among the looks). The seeds are
doubled until the upper bound is below 1.1 ("never loses"), the lower one above it ("loses"), or there are as many as
allowed ("open"). An error that is no more than float32's rounding is no loss. Where single paths decide, errors have
heavy tails: below 30 seeds' worth of errors, (sum e)^2 / sum e^2 of either method, nothing is decided.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import stats

import warpmis
from warpmis.config import DEFAULT_STRATEGIES
from warpmis.film.metrics import squared_error, squared_scale
from warpmis.rendering.stopping import FLOAT32_FLOOR
from warpmis.scene.features import Features

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))
from hard.case import HardCase
from hard.checks import scene_of
from hard.every import cases, effects_of

BASELINE = "balance"
METHODS = ("murray20", "auto")
LIMIT = 1.1
CONFIDENCE = 0.99
FEWEST_SEEDS = 32
# Seeds' worth of errors below which the tails may be unseen.
FEWEST_EFFECTIVE = 30.0

FloatArray = NDArray[np.float64]
Render = Callable[[str, int], NDArray[np.float32]]


@dataclass(frozen=True)
class Verdict:
    """Ratio of variances, its bounds at 99 % each; relative errors of balance and of the method; number of seeds."""

    case: str
    method: str
    ratio: float
    low: float
    high: float
    error: float
    own_error: float
    seeds: int

    @property
    def word(self) -> str:
        if self.high <= LIMIT or self.own_error < FLOAT32_FLOOR:
            return "never loses"
        return "loses" if self.low > LIMIT else "open"


def effective(errors: FloatArray) -> float:
    """How many equal errors would have the same relative spread."""
    return float(errors.sum() ** 2 / max(np.square(errors).sum(), 1e-300))


def judged(case: str, method: str, errors: FloatArray, base: FloatArray, confidence: float = CONFIDENCE) -> Verdict:
    """Of both methods' errors, seed by seed."""
    n = len(errors)
    if not base.any() and not errors.any():
        return Verdict(case, method, 1.0, 1.0, 1.0, 0.0, 0.0, n)
    error, own_error = math.sqrt(base.mean()), math.sqrt(errors.mean())
    if not base.any() or not errors.any():
        ratio = math.inf if errors.any() else 0.0
        return Verdict(case, method, ratio, ratio, ratio, error, own_error, n)
    # Where even the worst error is below the mean of the baseline's, its tail cannot matter.
    worth = effective(base) if errors.max() <= base.mean() else min(effective(errors), effective(base))
    ratio = errors.mean() / base.mean()
    apart = errors / errors.mean() - base / base.mean()
    reach = stats.t.ppf(confidence, n - 1) * apart.std(ddof=1) / math.sqrt(n)
    low, high = ratio * math.exp(-reach), ratio * math.exp(reach)
    if worth < FEWEST_EFFECTIVE and not np.array_equal(errors, base):
        low, high = 0.0, math.inf
    return Verdict(case, method, float(ratio), low, high, error, own_error, n)


def errors_of(pictures: list[FloatArray], scale: FloatArray) -> FloatArray:
    """Of each picture against the mean of its method's: no method is biased, so they differ in variance alone."""
    mean = np.mean(pictures, axis=0)
    return np.array([(squared_error(picture, mean) / scale).mean() for picture in pictures])


def verdicts(name: str, render: Render, methods: tuple[str, ...], most_seeds: int) -> list[Verdict]:
    """Of each method on one case."""
    pictures: dict[str, list[FloatArray]] = {method: [] for method in (BASELINE, *methods)}
    count = FEWEST_SEEDS
    looks = 1 + int(math.log2(max(most_seeds / FEWEST_SEEDS, 1.0)))
    confidence = 1.0 - (1.0 - CONFIDENCE) / looks
    while True:
        for method, own in pictures.items():
            own.extend(render(method, seed).astype(np.float64) for seed in range(len(own), count))
        mean = np.mean([np.mean(own, axis=0) for own in pictures.values()], axis=0)
        scale = np.maximum(squared_scale(mean), 1e-300)
        errors = {method: errors_of(own, scale) for method, own in pictures.items()}
        found = [judged(name, method, errors[method], errors[BASELINE], confidence) for method in methods]
        if all(verdict.word != "open" for verdict in found) or 2 * count > most_seeds:
            return found
        count *= 2


def renderer(case: HardCase, scene: warpmis.Scene, effects: Features, budget: int) -> Render:
    settings = {"max_depth": 2, **case.settings, "spp": budget}

    def render(method: str, seed: int) -> NDArray[np.float32]:
        return warpmis.render(scene, method=method, seed=seed, features=effects, **settings).image

    return render


def methods_of(case: HardCase) -> tuple[str, ...]:
    """`auto` has strategies of its own."""
    strategies = case.settings.get("strategies", DEFAULT_STRATEGIES)
    return METHODS if strategies == DEFAULT_STRATEGIES else METHODS[:1]


def measured(wanted: list[str], budget: int, most_seeds: int) -> Iterator[Verdict]:
    learned = [case for case in cases() if case.learns]
    effects = effects_of(map(scene_of, learned))
    for case in learned:
        if not wanted or case.name in wanted:
            render = renderer(case, scene_of(case), effects, budget)
            yield from verdicts(case.name, render, methods_of(case), most_seeds)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", help="names of cases; all of them")
    parser.add_argument("--budget", type=int, default=256, help="samples per pixel in all")
    parser.add_argument("--most-seeds", type=int, default=8192)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    rows = []
    print("| case | method | variance / balance | 99 % bounds | error | seeds | |\n|---|---|---|---|---|---|---|")
    for verdict in measured(arguments.cases, arguments.budget, arguments.most_seeds):
        bounds = f"{verdict.low:.2f} to {verdict.high:.2f}"
        figures = f"{verdict.ratio:.2f} | {bounds} | {100.0 * verdict.error:.2g} % | {verdict.seeds} | {verdict.word}"
        print(f"| {verdict.case} | {verdict.method} | {figures} |", flush=True)
        rows.append({**dataclasses.asdict(verdict), "verdict": verdict.word})
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
