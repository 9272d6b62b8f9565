"""How far a picture is from the right one: pure functions of arrays.

Colours are weighted as in the learner's objective (theory.md): the squared error of a pixel is
sum_c g_c (x_c - r_c)^2 with the luminance weights g of Rec.709.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])

# Part of the pixels that is left out of every mean, the worst ones: a few fireflies would decide it alone.
OUTLIERS = 0.001

# A pixel darker than a tenth of the picture's mean counts as if it were that bright: nobody sees its relative error.
DARK = 0.1


def squared_error(image: NDArray[np.floating], reference: NDArray[np.floating]) -> Float64Array:
    """sum_c g_c (x_c - r_c)^2 [radiance^2], shapes (H, W, 3) to (H, W)."""
    apart = np.asarray(image, np.float64) - np.asarray(reference, np.float64)
    return apart**2 @ LUMINANCE


def squared_scale(reference: NDArray[np.floating]) -> Float64Array:
    """What a squared error is relative to: L^2 + (0.1 mean L)^2 with the luminance L, shapes (H, W, 3) to (H, W)."""
    luminance = np.asarray(reference, np.float64) @ LUMINANCE
    return luminance**2 + (DARK * luminance.mean()) ** 2


def kept_pixels(errors: NDArray[np.floating], outliers: float = OUTLIERS) -> NDArray[np.intp]:
    """Where all but the largest `outliers` of the values stand in the flattened array, shape (n,)."""
    return np.argsort(errors, axis=None)[: errors.size - int(outliers * errors.size)]


def without_outliers(values: NDArray[np.floating], outliers: float = OUTLIERS) -> Float64Array:
    """All values but the largest `outliers` of them, sorted, one-dimensional; of fewer than 1/outliers, all."""
    ordered = np.sort(np.asarray(values, np.float64), axis=None)
    return ordered[: ordered.size - int(outliers * ordered.size)]


def relative_mse(image: NDArray[np.floating], reference: NDArray[np.floating], outliers: float = OUTLIERS) -> float:
    """relMSE: the mean of squared_error / squared_scale over the pixels, without outliers.

    Its root is the relative error: 0.02 is 2 %.

    Reference: Rousselle, Knaus, Zwicker (2011), with a floor that follows the picture's brightness.
    """
    return float(without_outliers(squared_error(image, reference) / squared_scale(reference), outliers).mean())


def mean_squared_error(image: NDArray[np.floating], reference: NDArray[np.floating]) -> float:
    """Mean of squared_error over all pixels, fireflies and all [radiance^2]."""
    return float(squared_error(image, reference).mean())


def estimated_relative_error(image: NDArray[np.floating], squared_standard_error: NDArray[np.floating]) -> float:
    """The relative error that a picture's own samples lead one to expect, without any reference.

    The root of relMSE with the pixels' squared standard errors in place of the squared error.

    Args:
        image: shape (H, W, 3).
        squared_standard_error: variance of the pixel's mean luminance, shape (H, W).
    """
    scale = squared_scale(image)
    if not scale.any():
        return 0.0  # a black picture
    return float(np.sqrt(without_outliers(squared_standard_error / scale).mean()))


# A picture in so many independent parts tells its own error.
PARTS = 4

# The pairs of parts, each with the pair of the other two.
_PAIRINGS = (((0, 1), (2, 3)), ((0, 2), (1, 3)), ((0, 3), (1, 2)))


def relative_mse_of_parts(parts: NDArray[np.floating], counts: NDArray[np.integer]) -> tuple[float, float]:
    """relMSE that is to be expected of the mean of four independent pictures, and its standard error.

    With n_i samples in the part x_i, N in all, and the luminance L of the parts, each of the six pairs tells

        r_ij = |x_i - x_j|^2 / ((1 / n_i + 1 / n_j) N) / ((median of L_i)^2 + (0.1 mean L)^2)

    of a pixel, |.|^2 as in squared_error. Their mean r is averaged over the pixels as relMSE is. The median, since a
    firefly would hide behind the brightness that it makes itself: its pixel's error could never be above 100 %.

    The standard error is that of the difference to the picture's actual relMSE, which has chance in it, too, as much as
    one pair has. Disjoint pairs are independent, so their products are what the squares would be without chance:

        standard error^2 = sum (r^2 - mean r_ij r_kl + mean r_ij^2 - mean r_ij r_kl) / pixels^2

    what relMSE leaves out counting as the largest that it keeps. That is exact for normal noise; with fireflies it is
    too large, since those in the picture are those in the estimate.

    Reference: Rousselle, Knaus, Zwicker (2012), for the noise of a picture from that of its parts.

    Args:
        parts: sums over each part's samples, shape (4, H, W, 3).
        counts: samples per pixel of each part, shape (4,), all positive.
    """
    pictures = np.asarray(parts, np.float64) / np.asarray(counts, np.float64)[:, np.newaxis, np.newaxis, np.newaxis]
    luminance = pictures @ LUMINANCE
    scale = np.median(luminance, axis=0) ** 2 + (DARK * luminance.mean()) ** 2
    if not scale.any():
        return 0.0, 0.0  # a black picture

    def told_by(i: int, j: int) -> Float64Array:
        return squared_error(pictures[i], pictures[j]) / ((1.0 / counts[i] + 1.0 / counts[j]) * counts.sum() * scale)

    r, squares, products = (np.zeros(scale.shape) for _ in range(3))
    for pair, other in _PAIRINGS:
        ours, theirs = told_by(*pair), told_by(*other)
        r += (ours + theirs) / 6.0
        squares += (ours**2 + theirs**2) / 6.0
        products += ours * theirs / 3.0
    kept = np.argsort(r, axis=None)[: r.size - int(OUTLIERS * r.size)]
    chance = (r**2 + squares - 2.0 * products).ravel()[kept]
    total = chance.sum() + (r.size - kept.size) * chance[-1]
    # In a handful of pixels the difference may happen to be small, or negative.
    least = (r.ravel()[kept] ** 2).sum()
    return float(r.ravel()[kept].mean()), float(np.sqrt(max(total, least)) / r.size)
