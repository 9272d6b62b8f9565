"""Whether a picture gains by a cache: a pilot by next-event estimation, and trials with what the cache knows by then.

Each looks at the first pixel of each cell of some pixels, with two lattices of samples, whose difference tells the
variance: it knows what even samples gain, which the spread of single samples does not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from warpmis.film.metrics import LUMINANCE, without_outliers

FloatArray = NDArray[np.float64]
FloatImage = NDArray[np.floating]

# A first look at about so many pixels, or all of them, with two lattices of samples each, tells quiet pictures. For all
# others the pilot goes on to more pixels, and so do the trials: rare bright paths make a few pixels an uncertain guide.
QUIET_PIXELS = 1024
PILOT_PIXELS = 4096
PILOT_SAMPLES = 8
# Of small renders a pilot takes about this part at most, and a trial whose samples are not in the picture about that.
PILOT_SHARE = 1.0 / 16.0
DROPPED_SHARE = 1.0 / 64.0
# Renders of fewer samples in all are not worth a pilot.
FEWEST_SAMPLES = 1 << 19
# Relative variance of one sample below which a cache has nothing to learn.
QUIET = 0.75
# Time of a ray of a guided path over that of one without.
RAY_TIME = 1.55
# Least gain of a render that goes on with the cache.
LEAST_GAIN = 0.95
# How many times as much a cache gains that has learned from twice as many paths: 1.03 to 1.28 in ten scenes. Where it
# gains little at first, and so must be foretold, it is 1.05 to 1.11.
GROWTH = 1.07
# Part of the mean luminance below which a pixel counts as if it were that bright.
DARK = 0.1


@dataclass(frozen=True)
class Trial:
    """What a pilot or a trial found: the relative variance of a sample, and its cost [rays]."""

    variance: float
    cost: float


@dataclass
class Findings:
    """Of a render so far: by pilots, each of more pixels than the one before, and by trials of the cache."""

    pilots: list[Trial] = field(default_factory=list)
    trials: list[Trial] = field(default_factory=list)

    @property
    def pilot(self) -> Trial | None:
        """The one of the most pixels."""
        return self.pilots[-1] if self.pilots else None

    @property
    def gains(self) -> list[float]:
        return [gain(self.pilot, trial) for trial in self.trials] if self.pilot else []

    def to_dict(self) -> dict[str, list[dict[str, float]]]:
        """As plain values."""
        return {name: [dict(vars(one)) for one in found] for name, found in vars(self).items()}

    @staticmethod
    def from_dict(plain: dict[str, list[dict[str, float]]]) -> Findings:
        return Findings(**{name: [Trial(**one) for one in found] for name, found in plain.items()})


@dataclass(frozen=True)
class Prospect:
    """What follows a trial, if the render goes on with the cache.

    doublings: how often the paths that the cache has learned from will double.
    dropped: part of the samples still to come that train and are not in the picture.
    """

    doublings: float
    dropped: float


def quiet_stride(pixels: int, spp: int) -> int:
    """The first pilot takes the first pixel of each cell of so many by so many; spp: of the render."""
    return _stride(pixels, min(QUIET_PIXELS, _pixels_for(PILOT_SHARE, pixels * spp)))


def pilot_stride(pixels: int, spp: int) -> int:
    """The same of the second pilot, and of the trials."""
    samples = pixels * spp
    most = min(PILOT_PIXELS, _pixels_for(PILOT_SHARE, samples))
    if most < pixels:  # the picture does not hold the trials' samples
        most = min(most, max(QUIET_PIXELS, _pixels_for(DROPPED_SHARE, samples)))
    return _stride(pixels, most)


def _pixels_for(share: float, samples: int) -> float:
    """In how many pixels a pilot takes this share of a render's samples."""
    return share * samples / (2 * PILOT_SAMPLES)


def _stride(pixels: int, looked_at: float) -> int:
    return max(1, math.ceil((pixels / max(looked_at, 1.0)) ** 0.5 - 0.5))


def is_quiet(pilot: Trial) -> bool:
    """Whether there is nothing to learn."""
    return pilot.variance < QUIET


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
