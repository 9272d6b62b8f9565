"""Whether a picture gains by a cache: a pilot by next-event estimation, and trials with what the cache knows by then.

Each looks at the first pixel of each cell of some pixels, with two lattices of samples, whose difference tells the
variance: it knows what even samples gain, which the spread of single samples does not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpmis.film.metrics import LUMINANCE, without_outliers

FloatArray = NDArray[np.float64]
FloatImage = NDArray[np.floating]

# The pilot looks at about so many pixels, or all of them, with two lattices of samples each; and so does the trial.
PILOT_PIXELS = 1024
PILOT_SAMPLES = 8
# Of small renders the pilot takes this part at most; those of fewer samples in all are not worth a pilot.
PILOT_SHARE = 1.0 / 16.0
FEWEST_SAMPLES = 1 << 18
# Relative variance of one sample below which a cache has nothing to learn.
QUIET = 0.75
# Time of a ray of a guided path over that of one without.
RAY_TIME = 1.55
# Least gain of a render that goes on with the cache.
LEAST_GAIN = 0.95
# How many times as much a cache gains that has learned from twice as many paths: 1.05 to 1.3 in thirteen scenes.
GROWTH = 1.12
# Part of the mean luminance below which a pixel counts as if it were that bright.
DARK = 0.1


@dataclass(frozen=True)
class Trial:
    """What a pilot or a trial found: the relative variance of a sample, and its cost [rays]."""

    variance: float
    cost: float


@dataclass(frozen=True)
class Prospect:
    """What follows a trial, if the render goes on with the cache.

    doublings: how often the paths that the cache has learned from will double.
    dropped: part of the samples still to come that train and are not in the picture.
    """

    doublings: float
    dropped: float


def pilot_stride(pixels: int, spp: int) -> int:
    """The pilot takes the first pixel of each cell of so many by so many, of a render of spp samples per pixel."""
    looked_at = min(PILOT_PIXELS, PILOT_SHARE * pixels * spp / (2 * PILOT_SAMPLES))
    return max(1, math.ceil((pixels / max(looked_at, 1.0)) ** 0.5 - 0.5))


def pays(pilot: Trial, trials: list[Trial], prospects: list[Prospect]) -> bool:
    """Whether the rest of a render promises less variance x time with the cache, by the latest of the trials."""
    return bool(trials) and promised(pilot, trials[-1], prospects[len(trials) - 1]) > LEAST_GAIN


def promised(pilot: Trial, trial: Trial, prospect: Prospect) -> float:
    """The gain of the rest of a render, with what training is still to bring and to cost."""
    return gain(pilot, trial) * GROWTH**prospect.doublings * (1.0 - prospect.dropped)


def gain(pilot: Trial, trial: Trial) -> float:
    """Variance x time of paths without the cache over that of paths by what it knew in the trial."""
    return pilot.variance * pilot.cost / max(trial.variance * trial.cost * RAY_TIME, 1e-30)


def relative_variance(first: FloatImage, second: FloatImage, expected: FloatArray) -> float:
    """Mean over the pixels of the variance of one sample over the squared luminance, without the worst pixels.

    Args:
        first, second: means of PILOT_SAMPLES samples each, linear Rec.709, shape (H, W, 3).
        expected: luminance that the pixels are expected to have, shape (H, W).
    """
    difference = np.asarray(first - second, np.float64) @ LUMINANCE
    variance = PILOT_SAMPLES * difference**2 / 2.0
    scale = expected**2 + (DARK * expected.mean()) ** 2
    if not scale.any():
        return 0.0
    return float(without_outliers(variance / np.maximum(scale, 1e-300), 1.0 / min(1000, variance.size)).mean())
