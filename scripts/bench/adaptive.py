"""What sampling noisy pixels more would bring, at best and as far as a pilot's samples tell which they are:

    python scripts/bench/adaptive.py [SCENE ...] [--width 64] [--pilot 8 32 128] [--seeds 4]

Pixels of variance v (relative, as in relMSE) and cost c per sample, given samples in proportion to d, have a product of
error^2 and time of sum(v / d) sum(c d). It is least for d ~ sqrt(v / c). The gain is that product for equal numbers of
samples over the one for d:

best      by v and c themselves, as a render of --reference-spp tells them
POWER     d ~ (v / c)^POWER, by the mean variance of a square of pixels in a pilot render, between 1/2 and 4 samples for
          each that pixels have on average

The gain is that of the samples after the pilot; those of the pilot are shared out evenly. The worst 0.1 % of the pixels
are left out, as in relMSE.
"""

from __future__ import annotations

import argparse
import statistics
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import warpmis
from warpmis.device.upload import upload
from warpmis.film.metrics import LUMINANCE, OUTLIERS, squared_scale
from warpmis.kernels.moments import SHADOW_RAY_COST
from warpmis.learn.schedule import Round
from warpmis.rendering.integrator import Integrator, allocation_of
from warpmis.rendering.specialise import features_of

USD_SCENES = Path(__file__).parents[2] / "usd_scenes"
SCENES = ("cornell_box", "ajar_door", "veach_plates", "open_terrace")
POWERS = (0.125, 0.25, 0.5)
SQUARES = (3, 7)
LEAST, MOST = 0.5, 4.0

Float64Array = NDArray[np.float64]


def box_mean(values: Float64Array, side: int) -> Float64Array:
    """Mean over the square about each pixel, the picture's border repeated."""
    padded = np.pad(values, side // 2, mode="edge")
    return np.lib.stride_tricks.sliding_window_view(padded, (side, side)).mean(axis=(2, 3))


def relative_variance(result: warpmis.RenderResult, side: int = 1) -> Float64Array:
    """Of one sample; from so few that a pixel's own brightness is unknown, relative to that of the 3 x 3 about it."""
    if side == 1:
        return result.variance / squared_scale(result.image)
    luminance = box_mean(result.image @ LUMINANCE, 3)
    return box_mean(result.variance / squared_scale(np.repeat(luminance[..., None], 3, axis=2)), side)


def cost_of(scene: warpmis.Scene, spp: int) -> Float64Array:
    """Mean cost of a pixel's samples, told by the length of their paths."""
    config = warpmis.RenderConfig(method="nee", spp=spp)
    features = features_of(scene, config)
    run = Integrator(upload(scene, "cpu"), features, config, allocation_of(config, *scene.resolution))
    run.trace(Round(0, spp, False), lambda _: None)
    rays = run.film.rays.numpy() + float(SHADOW_RAY_COST) * run.film.shadow_rays.numpy()
    return (rays / spp).reshape(scene.resolution[::-1])


def bounded(wanted: Float64Array) -> Float64Array:
    """Numbers of samples relative to their mean, within LEAST and MOST."""
    d = wanted / wanted.mean()
    for _ in range(20):
        d = np.clip(d / d.mean(), LEAST, MOST)
    return d


def gain(d: Float64Array, variance: Float64Array, cost: Float64Array) -> float:
    kept = variance <= np.quantile(variance, 1.0 - OUTLIERS)
    even = variance[kept].mean() * cost.mean()
    return float(even / ((variance[kept] / d[kept]).mean() * (cost * d).mean()))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=SCENES)
    parser.add_argument("--width", type=int, default=64)
    parser.add_argument("--pilot", type=int, nargs="+", default=[8, 32, 128])
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--reference-spp", type=int, default=16384)
    arguments = parser.parse_args()
    columns = [(side, power) for side in SQUARES for power in POWERS]
    print("| scene, pilot | best |", " | ".join(f"{side} x {side}, {power}" for side, power in columns), "|")
    print("|---|---|" + "---|" * len(columns))
    for name in arguments.scenes:
        scene = warpmis.load_stage(USD_SCENES / name / "scene.usda", width=arguments.width)
        truth = warpmis.render(scene, method="auto", spp=arguments.reference_spp, seed=10_000)
        # A pixel without noise would be given no samples at all.
        variance = relative_variance(truth) + 1e-9
        cost = cost_of(scene, 64)
        best = gain(np.sqrt(variance / cost), variance, cost)
        for pilot in arguments.pilot:
            runs = [warpmis.render(scene, method="nee", spp=pilot, seed=seed) for seed in range(arguments.seeds)]
            guesses = {side: [relative_variance(run, side) for run in runs] for side in SQUARES}
            told = []
            for side, power in columns:
                d = [bounded(((guess + 0.01 * guess.mean()) / cost) ** power) for guess in guesses[side]]
                told.append(statistics.median(gain(each, variance, cost) for each in d))
            figures = " | ".join(f"{value:.2f}" for value in told)
            print(f"| {name}, {pilot} | {best:.2f} | {figures} |", flush=True)


if __name__ == "__main__":
    main()
