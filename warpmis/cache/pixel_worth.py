"""What radiance is worth in each pixel: a path that brings much to a dark pixel may cost more."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpmis.film.metrics import LUMINANCE

FloatArray = NDArray[np.float64]

# Samples whose mean tells a pixel's luminance well enough.
ENOUGH = 49.0
# No pixel counts as darker than this part of the picture's mean.
DARK = 0.05
# Rates at the optimum are proportional to this; the variance counts as no larger, or its outliers would kill paths.
STRENGTH = 1.5
MOST_VARIANCE = 4.0


def expected_luminance(color: FloatArray, count: NDArray[np.integer]) -> FloatArray:
    """The luminance of each pixel by the samples around it, shape (H, W).

    Args:
        color: sums of samples, linear Rec.709, shape (H, W, 3); count: how many, shape (H, W), 0 in some pixels.
    """
    samples = max(float(count.mean()), 1e-9)
    radius = int(np.clip(np.ceil((np.sqrt(ENOUGH / samples) - 1.0) / 2.0), 1, 64))
    total, weight = box_sum(color @ LUMINANCE, radius), box_sum(count.astype(np.float64), radius)
    mean = (color @ LUMINANCE).sum() / max(float(count.sum()), 1.0)
    return np.where(weight > 0.0, total / np.maximum(weight, 1.0), mean)


def pixel_worth(luminance: FloatArray, strength: float) -> NDArray[np.float32]:
    """The strength over the expected luminance, shape (pixels,); `strength` in a black picture."""
    floor = max(DARK * float(luminance.mean()), 1e-30)
    return (strength / np.maximum(luminance, floor)).ravel().astype(np.float32)


def rate_strength(cost: float, variance: float) -> float:
    """The common factor of all rates: a unit of cost is worth the variance that it saves elsewhere in the picture.

    Reference: Rath et al. (2022), "EARS", equation 12.

    Args:
        cost: of a path [rays]; variance: relative variance of a sample.
    """
    return STRENGTH * float(np.sqrt(cost / np.clip(variance, 1e-3, MOST_VARIANCE)))


def box_sum(values: FloatArray, radius: int) -> FloatArray:
    """Sums over squares of 2 radius + 1 pixels about each pixel, cut off at the edges."""
    for axis in (0, 1):
        length = values.shape[axis]
        sums = np.concatenate([np.zeros_like(values.take([0], axis=axis)), values.cumsum(axis=axis)], axis=axis)
        last = np.minimum(np.arange(length) + radius + 1, length)
        first = np.maximum(np.arange(length) - radius, 0)
        values = sums.take(last, axis=axis) - sums.take(first, axis=axis)
    return values
