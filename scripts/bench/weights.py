"""What better weights, control variates and counts of samples at the first vertex would bring, before any is built:

    python scripts/bench/weights.py [SCENE ...] [--spp 16 64] [--rounds 48] [--json FILE]

A SCENE is a folder of usd_scenes, or a stage. Each scheme is evaluated on the same records (first_vertex.py): of every
pixel `rounds` rounds of `spp` samples, each round on a lattice of its own. A scheme's error is the variance of a
round's mean over the rounds, relative to the pixel's brightness, averaged over the pixels as relMSE is. Its cost is
counted in rays. All figures are the efficiency, 1 / (error x cost): over next-event estimation with the balance
heuristic, or of mixtures over the same mixture without controls. ± is the standard error by a jackknife over eight
parts of the rounds.

Samples on a lattice are worth the more the more there are. So a scheme that costs c times as much as next-event
estimation is compared with that at c times as many samples, between records of `spp` and of twice as many.

Schemes marked `oracle` choose their numbers by rounds that no render has. Weights and counts are chosen by one half of
the rounds, for 5 x 5 pixels together, and judged by the other half. The others take what a formula gives for the
pixel's true moments.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from first_vertex import LIGHTS, Recorder, Records
from numpy.typing import NDArray

import warpmis
from warpmis.config import STRATEGIES
from warpmis.film.metrics import DARK, without_outliers
from warpmis.kernels.moments import SHADOW_RAY_COST

USD_SCENES = Path(__file__).parents[2] / "usd_scenes"
SCENES = ("cornell_box", "ajar_door", "veach_plates", "open_terrace")
Array = NDArray[np.float64]

# Ratios of the light sample's weight to the BSDF's, beside their densities.
RATIOS = tuple(2.0**e for e in range(-6, 7))
# Light samples and paths of a vertex; those that are not here cost more than they could bring.
COUNTS = ((0, 1), (1, 1), (2, 1), (4, 1), (0, 2), (1, 2), (2, 2), (4, 2))
MIXTURES = (("bsdf", "light"), ("bsdf", "light", "uniform"), STRATEGIES)
# Pixels to each side that choose together.
POOL = 2
# Records that are in memory at once.
AT_ONCE = 1 << 20
PARTS = 8


@dataclass(eq=False)
class Means:
    """Of every pixel's rounds: the means of what each scheme estimates, and of its cost; shape (pixels, rounds).

    moments: per pixel, of single samples.
    """

    values: dict[str, Array] = field(default_factory=dict)
    costs: dict[str, Array] = field(default_factory=dict)
    moments: dict[str, Array] = field(default_factory=dict)

    def extend(self, other: Means) -> None:
        for own, new in (
            (self.values, other.values),
            (self.costs, other.costs),
            (self.moments, other.moments),
        ):
            for name, array in new.items():
                own[name] = np.concatenate([own[name], array]) if name in own else array


def pair_means(records: Records) -> Means:
    """Of the schemes with light samples and paths."""
    s, b = records.light_bsdf.astype(np.float64), records.path_bsdf.astype(np.float64)
    light, direct, indirect = records.light, records.direct, records.indirect
    found = Means()

    def mean(values: NDArray[np.floating]) -> Array:
        return values.mean(axis=2, dtype=np.float64)

    def estimate(ratio: float, lights: int, paths: int) -> Array:
        """Of one sample: ratio times the light samples' densities against the paths'."""
        step = LIGHTS // max(lights, 1)
        p = slice(0, paths)
        weighted = direct[..., p]
        if lights:
            weighted = weighted * (b[..., p] / (ratio * (1.0 - b[..., p]) + b[..., p]))
        total = records.rest + (indirect[..., p] + weighted).mean(-1)
        if lights:
            own = slice(0, None, step)
            weight = ratio * (1.0 - s[..., own])
            total = total + (light[..., own] * (weight / np.maximum(weight + s[..., own], 1e-30))).mean(-1)
        return total

    for ratio in RATIOS:
        found.values[f"ratio {ratio:g}"] = mean(estimate(ratio, 1, 1))
    for lights, paths in COUNTS:
        found.values[f"counts {lights},{paths}"] = mean(estimate(lights / paths, lights, paths))
        camera = np.ones_like(records.rest)
        of_lights = SHADOW_RAY_COST * records.light_rays.mean(-1) * lights
        found.costs[f"counts {lights},{paths}"] = mean(camera + of_lights + records.path_cost.mean(-1) * paths)
    s0, b0 = s[..., 0], b[..., 0]
    power = light[..., 0] * (1.0 - s0) ** 2 / ((1.0 - s0) ** 2 + s0**2)
    power = power + direct[..., 0] * b0**2 / ((1.0 - b0) ** 2 + b0**2)
    found.values["power"] = mean(records.rest + indirect[..., 0] + power)
    # The control variate: (p_light - p_bsdf) / (p_light + p_bsdf) of both directions, of mean 0.
    control = np.where(records.is_there & records.has_lights, 2.0 - 2.0 * s0 - 2.0 * b0, 0.0)
    whole = estimate(1.0, 1, 1)
    found.values["control"] = mean(control)
    found.values["light"], found.values["bsdf"] = mean(light[..., 0]), mean(direct[..., 0])
    of_pixel = (1, 2)
    found.moments["X c"] = (whole * control).mean(of_pixel)
    found.moments["c c"] = (control * control).mean(of_pixel)
    for name, values in (("light", light[..., 0]), ("bsdf", direct[..., 0])):
        found.moments[f"var {name}"] = values.var(of_pixel, dtype=np.float64)
    return found


def plain_means(records: Records) -> Means:
    """Of next-event estimation with the balance heuristic."""
    light = records.light[..., 0] * (1.0 - records.light_bsdf[..., 0])
    path = records.indirect[..., 0] + records.direct[..., 0] * records.path_bsdf[..., 0]
    return Means({"plain": (records.rest + light + path).mean(axis=2, dtype=np.float64)})


def relative_variance(values: Array, scale: Array) -> float:
    """Mean over the pixels of the variance of a round's mean, relative to the pixel's brightness."""
    return float(without_outliers(values.var(axis=1, ddof=1) / scale).mean())


def jackknife(rounds: int, figure: Callable[[NDArray[np.intp]], float]) -> tuple[float, float]:
    """A figure of all rounds, and its standard error by leaving out one of some parts at a time."""
    every = np.arange(rounds)
    parts = [figure(every[every % PARTS != part]) for part in range(PARTS)]
    return figure(every), float(np.std(parts) * (PARTS - 1) ** 0.5)


def halves(rounds: NDArray[np.intp]) -> tuple[tuple[NDArray[np.intp], NDArray[np.intp]], ...]:
    even, odd = rounds[::2], rounds[1::2]
    return (even, odd), (odd, even)


def pooled(values: Array, width: int) -> Array:
    """Sums over squares of pixels, and a little of the whole picture; shape (choices, pixels)."""
    pictures = values.reshape(len(values), -1, width)
    for axis in (1, 2):
        pad = [(0, 0)] * 3
        pad[axis] = (POOL + 1, POOL)
        sums = np.pad(pictures, pad).cumsum(axis=axis)
        end = sums.shape[axis]
        upper = np.take(sums, np.arange(2 * POOL + 1, end), axis=axis)
        pictures = upper - np.take(sums, np.arange(0, end - 2 * POOL - 1), axis=axis)
    return pictures.reshape(values.shape) + values.mean(axis=1, keepdims=True)


def coefficients(values: Array, controls: Array, scale: Array, width: int) -> Array:
    """A^-1 b over the rounds, from pooled neighbours relative to their brightness; shape (pixels, controls)."""
    apart = (values - values.mean(1, keepdims=True)) / scale[:, None] ** 0.5
    c = controls - controls.mean(1, keepdims=True)
    pixels, _, count = c.shape
    A = pooled(np.einsum("prs,prt->stp", c, c).reshape(count * count, pixels), width)
    b = pooled(np.einsum("pr,prs->sp", apart, c), width).T
    return solved(A.T.reshape(pixels, count, count), b) * scale[:, None] ** 0.5


def solved(A: Array, b: Array) -> Array:
    """A^-1 b with a ridge for controls that hardly differ; shapes (pixels, S, S), (pixels, S)."""
    ridge = 1e-6 * np.trace(A, axis1=1, axis2=2) + 1e-30
    return np.linalg.solve(A + ridge[:, None, None] * np.eye(A.shape[1]), b[..., None])[..., 0]


def nearest_ratio(wanted: Array) -> NDArray[np.intp]:
    return np.abs(np.log2(np.maximum(wanted, 1e-9))[:, None] - np.log2(RATIOS)).argmin(axis=1)


@dataclass(eq=False)
class PairSchemes:
    """Figures of the schemes with light samples and paths, from their means."""

    means: Means
    twice: Array
    spp: int
    width: int

    def __post_init__(self) -> None:
        values = self.means.values
        self.base = values["ratio 1"]
        brightness = self.base.mean(axis=1)
        self.scale = brightness**2 + (DARK * brightness.mean()) ** 2
        self.by_ratio = np.stack([values[f"ratio {ratio:g}"] for ratio in RATIOS])

    def _gain(self, values: Array, rounds: NDArray[np.intp]) -> float:
        return relative_variance(self.base[:, rounds], self.scale) / relative_variance(values[:, rounds], self.scale)

    def power(self, rounds: NDArray[np.intp]) -> float:
        return self._gain(self.means.values["power"], rounds)

    def _judged(self, rounds: NDArray[np.intp], chosen: Callable[[NDArray[np.intp]], Array]) -> float:
        """Numbers of one half of the rounds, judged by the other."""
        gains = []
        for own, other in halves(rounds):
            gains.append(self._gain(chosen(own), other))
        return float(np.exp(np.mean(np.log(gains))))

    def optimal_oracle(self, rounds: NDArray[np.intp]) -> float:
        """Optimal MIS by coefficients for means of such rounds, from pooled neighbours."""
        control = self.means.values["control"][..., None]
        corrected = np.empty_like(self.base)
        for own, other in halves(rounds):
            beta = coefficients(self.base[:, own], control[:, own], self.scale, self.width)
            corrected[:, other] = self.base[:, other] - np.einsum("prs,ps->pr", control[:, other], beta)
        return self._gain(corrected, rounds)

    def optimal(self, rounds: NDArray[np.intp]) -> float:
        """Optimal MIS with A and b of independent samples, as published."""
        gamma = self.means.moments["X c"] / np.maximum(self.means.moments["c c"], 1e-12)
        return self._gain(self.base - gamma[:, None] * self.means.values["control"], rounds)

    def _aware(self, of_light: Array, of_bsdf: Array, rounds: NDArray[np.intp]) -> float:
        values = self.means.values
        v_light = 1.0 + values["light"].mean(1) ** 2 / np.maximum(of_light, 1e-30)
        v_bsdf = 1.0 + values["bsdf"].mean(1) ** 2 / np.maximum(of_bsdf, 1e-30)
        chosen = nearest_ratio(v_light / v_bsdf)
        return self._gain(self.by_ratio[chosen, np.arange(len(chosen))], rounds)

    def aware_independent(self, rounds: NDArray[np.intp]) -> float:
        """Variance-aware weights by the variances of single samples."""
        moments = self.means.moments
        return self._aware(moments["var light"], moments["var bsdf"], rounds)

    def aware(self, rounds: NDArray[np.intp]) -> float:
        """By the variances of rounds, times their samples: what evenness leaves over."""
        values = self.means.values
        return self._aware(self.spp * values["light"].var(1), self.spp * values["bsdf"].var(1), rounds)

    def ratio_oracle(self, rounds: NDArray[np.intp]) -> float:
        def chosen(own: NDArray[np.intp]) -> Array:
            best = pooled(self.by_ratio[:, :, own].var(axis=2) / self.scale, self.width).argmin(axis=0)
            return self.by_ratio[best, np.arange(len(best))]

        return self._judged(rounds, chosen)

    def _counts(self, rounds: NDArray[np.intp]) -> tuple[Array, Array]:
        """Relative variances and costs, shape (counts, pixels)."""
        names = [f"counts {lights},{paths}" for lights, paths in COUNTS]
        values = np.stack([self.means.values[name][:, rounds].var(1, ddof=1) / self.scale for name in names])
        return values, np.stack([self.means.costs[name].mean(1) for name in names])

    def _over_plain(self, variance: Array, cost: Array, rounds: NDArray[np.intp]) -> float:
        """Of a scheme with these variances and costs over next-event estimation of the same cost."""
        plain = relative_variance(self.base[:, rounds], self.scale)
        order = np.log2(plain / relative_variance(self.twice[:, rounds], self.scale))
        ratio = cost.mean() / self.means.costs["counts 1,1"].mean()
        return float(plain * ratio**-order / without_outliers(variance).mean())

    def of_counts(self, index: int) -> Callable[[NDArray[np.intp]], float]:
        """The same counts in all pixels."""

        def gain(rounds: NDArray[np.intp]) -> float:
            values, costs = self._counts(rounds)
            return self._over_plain(values[index], costs[index], rounds)

        return gain

    def best_counts(self, rounds: NDArray[np.intp], allowed: list[int]) -> NDArray[np.intp]:
        """Each pixel's best counts: the sum of the variances times that of the costs is least, by fixed point."""
        learned, costs = (pooled(one, self.width) for one in self._counts(rounds))
        pixels = np.arange(learned.shape[1])
        best = np.full(len(pixels), COUNTS.index((1, 1)))
        for _ in range(8):
            weight = learned[best, pixels].sum() / costs[best, pixels].sum()
            best = np.array(allowed)[(learned + weight * costs)[allowed].argmin(axis=0)]
        return best

    def counts_oracle(self, most_paths: int) -> Callable[[NDArray[np.intp]], float]:
        allowed = [i for i, (_, paths) in enumerate(COUNTS) if paths <= most_paths]

        def gain(rounds: NDArray[np.intp]) -> float:
            gains = []
            for own, other in halves(rounds):
                best = self.best_counts(own, allowed)
                values, costs = self._counts(other)
                pixels = np.arange(len(best))
                gains.append(self._over_plain(values[best, pixels], costs[best, pixels], other))
            return float(np.exp(np.mean(np.log(gains))))

        return gain

    def shares_of_counts(self) -> dict[str, tuple[float, float]]:
        """Which part of the pixels takes which counts."""
        best = self.best_counts(np.arange(self.base.shape[1]), list(range(len(COUNTS))))
        labels = [f"share with {lights} light samples, {paths} paths" for lights, paths in COUNTS]
        return {label: (float((best == i).mean()), 0.0) for i, label in enumerate(labels)}

    def figures(self) -> dict[str, tuple[float, float]]:
        schemes: dict[str, Callable[[NDArray[np.intp]], float]] = {
            "power heuristic": self.power,
            "optimal MIS": self.optimal,
            "optimal MIS, oracle": self.optimal_oracle,
            "variance-aware, variance of single samples": self.aware_independent,
            "variance-aware, variance of rounds": self.aware,
            "best ratio of weights, oracle": self.ratio_oracle,
        }
        for index, (lights, paths) in enumerate(COUNTS):
            if (lights, paths) != (1, 1):
                schemes[f"{lights} light samples, {paths} paths"] = self.of_counts(index)
        schemes["light samples by pixel, oracle"] = self.counts_oracle(1)
        schemes["counts by pixel, oracle"] = self.counts_oracle(2)
        found = {name: jackknife(self.base.shape[1], scheme) for name, scheme in schemes.items()}
        return found | self.shares_of_counts()


def by_blocks(recorder: Recorder, spp: int, rounds: int) -> list[NDArray[np.intp]]:
    return np.array_split(np.arange(recorder.pixels), max(1, recorder.pixels * spp * rounds // AT_ONCE))


def pair_figures(scene: warpmis.Scene, args: argparse.Namespace, spp: int) -> dict[str, tuple[float, float]]:
    recorder, means, twice = Recorder(scene, sampler=args.sampler, max_depth=args.max_depth), Means(), Means()
    for block in by_blocks(recorder, spp, args.rounds):
        means.extend(pair_means(recorder.pairs(block, spp, range(args.rounds))))
    for block in by_blocks(recorder, 2 * spp, args.rounds):
        twice.extend(plain_means(recorder.pairs(block, 2 * spp, range(args.rounds), seed=2)))
    return PairSchemes(means, twice.values["plain"], spp, recorder.width).figures()


def mixture_figures(
    scene: warpmis.Scene, args: argparse.Namespace, spp: int, strategies: tuple[str, ...]
) -> dict[str, tuple[float, float]]:
    """Optimal MIS of a mixture, whose controls are the ratios p_s / p_a, of mean 1."""
    recorder = Recorder(scene, sampler=args.sampler, max_depth=args.max_depth, strategies=strategies)
    base, published, controls = [], [], []
    for block in by_blocks(recorder, spp, args.rounds):
        records = recorder.mixture(block, spp, range(args.rounds))
        q = records.q[..., :-1].astype(np.float64) - records.q[..., -1:]  # the last one follows from the others
        beta = solved(np.einsum("prks,prkt->pst", q, q), np.einsum("prk,prks->ps", records.F, q))
        F, c = records.F.mean(2, dtype=np.float64), q.mean(2)
        base.append(F)
        controls.append(c)
        published.append(F - np.einsum("prs,ps->pr", c, beta))
    whole, of_single, c = (np.concatenate(parts) for parts in (base, published, controls))
    brightness = whole.mean(axis=1)
    scale = brightness**2 + (DARK * brightness.mean()) ** 2

    def gain(corrected: Array, rounds: NDArray[np.intp]) -> float:
        return relative_variance(whole[:, rounds], scale) / relative_variance(corrected[:, rounds], scale)

    def oracle(rounds: NDArray[np.intp]) -> float:
        corrected = np.empty_like(whole)
        for own, other in halves(rounds):
            beta = coefficients(whole[:, own], c[:, own], scale, recorder.width)
            corrected[:, other] = whole[:, other] - np.einsum("prs,ps->pr", c[:, other], beta)
        return gain(corrected, rounds)

    name = "all eight" if strategies == STRATEGIES else ", ".join(strategies)
    schemes: dict[str, Callable[[NDArray[np.intp]], float]] = {
        f"optimal MIS of {name}": lambda rounds: gain(of_single, rounds),
        f"optimal MIS of {name}, oracle": oracle,
    }
    return {label: jackknife(whole.shape[1], scheme) for label, scheme in schemes.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=SCENES, help="folders of usd_scenes, or stages")
    parser.add_argument("--spp", type=int, nargs="+", default=[16, 64])
    parser.add_argument("--rounds", type=int, default=48)
    parser.add_argument("--width", type=int, default=64)
    parser.add_argument("--max-depth", type=int, default=8, help="1 is direct light alone")
    parser.add_argument("--sampler", default="lattice", choices=("lattice", "independent"))
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    report: dict[str, dict[str, dict[str, tuple[float, float]]]] = {}
    for name in args.scenes:
        start = time.perf_counter()
        path = USD_SCENES / name / "scene.usda"
        scene = warpmis.load_stage(path if path.is_file() else name, width=args.width)
        label = name if path.is_file() else Path(name).parent.name
        rows = report[label] = {}
        for spp in args.spp:
            rows[str(spp)] = pair_figures(scene, args, spp)
            for strategies in MIXTURES:
                rows[str(spp)] |= mixture_figures(scene, args, spp, strategies)
        print(f"\n{label}, {args.sampler} ({time.perf_counter() - start:.0f} s)")
        print(f"| scheme | {' | '.join(rows)} |\n|---|{'---|' * len(rows)}")
        for scheme in rows[str(args.spp[0])]:
            figures = " | ".join(f"{of[scheme][0]:.3f} ± {of[scheme][1]:.3f}" for of in rows.values())
            print(f"| {scheme} | {figures} |", flush=True)
    if args.json:
        args.json.write_text(json.dumps(report, indent=1))


if __name__ == "__main__":
    main()
