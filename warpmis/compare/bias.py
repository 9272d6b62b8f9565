"""The part of an error that more samples do not remove, told from noise by what repetitions have in common."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpmis.compare.measure import Pictures
from warpmis.compare.reference import Reference
from warpmis.film.metrics import LUMINANCE, squared_scale

# So many of its own standard errors must a bias be away from 0 to count as one.
SIGNIFICANT = 4.0

# A bias that is smooth, as that of a depth limit, shows in the mean of a block of pixels long before it shows in one.
BLOCKS = (1, 4, 16)


@dataclass(frozen=True)
class Bias:
    """A squared relative bias.

    Attributes:
        squared: relMSE that is bias for sure, 0 if none is seen.
        limit: relMSE that a smooth bias could have without being seen; None if the reference's noise is unknown, or
            one repetition alone.
    """

    squared: float
    limit: float | None


def bias_of(pictures: Pictures, reference: Reference) -> Bias:
    """The bias that repetitions of one run show, in pixels or in blocks of them, whichever shows more."""
    if reference.squared_standard_error is None or pictures.count < 2:  # of an interrupted comparison
        return Bias(0.0, None)
    found, limits = [0.0], []
    for side in BLOCKS:
        if min(reference.image.shape[:2]) >= 2 * side:
            squared, error = squared_bias(pictures, reference, side)
            found.append(squared if squared > SIGNIFICANT * error else 0.0)
            limits.append(max(squared, 0.0) + SIGNIFICANT * error)
    return Bias(max(found), min(limits, default=None))


def squared_bias(pictures: Pictures, reference: Reference, side: int = 1) -> tuple[float, float]:
    """Squared bias of the means of blocks of `side` x `side` pixels, and its standard error.

    Of K repetitions x_k with mean m, each of n pixels a block, relative to a smooth scale,

        b^2 = |mean of (m - r)|^2 - mean of s^2 / (K n) - mean of v / n
        s^2 = (mean_k |x_k - r|^2 - |m - r|^2) K / (K - 1)        v: the reference's squared standard error

    s^2 being the variance of one repetition: without a bias, b^2 is 0 on average.
    """
    truth, count = reference.image, pictures.count
    scale = _smooth_scale(truth)
    noise = reference.squared_standard_error if reference.squared_standard_error is not None else 0.0
    apart = pictures.mean_image() - truth
    variance = (pictures.mean_error() * squared_scale(truth) - apart**2 @ LUMINANCE) * count / (count - 1)
    chance = _block_means((variance / count + noise) / scale, side) / (side * side)
    each = _block_means(apart / np.sqrt(scale)[..., np.newaxis], side) ** 2 @ LUMINANCE - chance
    return float(each.mean()), float(each.std() / math.sqrt(each.size))


def _smooth_scale(reference: NDArray[np.float64], side: int = 16) -> NDArray[np.float64]:
    """squared_scale of the reference's block means, shape (H, W).

    A pixel's own scale follows the reference's noise: dividing by it makes errors large just where the reference
    happens to be too dark, and any noisy reference would look like a bias.
    """
    height, width = reference.shape[:2]
    side = min(side, height, width)
    scale = squared_scale(_block_means(reference, side))
    rows, columns = (np.minimum(np.arange(length) // side, length // side - 1) for length in (height, width))
    return scale[np.ix_(rows, columns)]


def _block_means(picture: NDArray[np.float64], side: int) -> NDArray[np.float64]:
    """Means over blocks, shape (H, W, ...) to (H // side, W // side, ...); what is left at the border is left out."""
    height, width = (length // side for length in picture.shape[:2])
    cut = picture[: height * side, : width * side]
    return cut.reshape(height, side, width, side, *picture.shape[2:]).mean(axis=(1, 3))
