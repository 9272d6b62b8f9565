"""From what a cell has seen of the light to the density by which it guides, over the cosine-warped hemisphere.

The hemisphere about the shading normal is the unit square (Shirley and Chiu's map of the disk, raised by Malley), in
BINS x BINS bins. A density of 1 everywhere is cosine-weighted sampling, so the product with the cosine is free.

References: Shirley, Chiu (1997); Jensen (1995), "Importance Driven Path Tracing using the Photon Map"; Karlik et al.
(2019), "MIS Compensation".
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpmis.device.cache_views import GUIDE_BINS, GUIDE_LEVELS

FloatArray = NDArray[np.float64]

# What is left of the density where the BSDF's share covers all that is to be found.
FLOOR = 1e-3
# Part of a bin that goes to its neighbours on each axis: what was seen in one direction stands for those around it.
BLUR = 0.5


def guide_densities(second_moments: FloatArray, bsdf_share: FloatArray) -> FloatArray:
    """Densities over the square with a mean of 1, in Morton order, shape (cells, bins).

    The best density for a tail of random radiance L is in proportion to sqrt(E[L^2]). It is blurred, and what the
    BSDF's share a of the mixture covers is taken off, g = max(t - a, 0): the mixture a + (1 - a) g is what counts.

    Args:
        second_moments: E[L^2] per bin, in Morton order, shape (cells, bins).
        bsdf_share: the share of the BSDF in each cell, shape (cells,).
    """
    target = blurred(normalised(np.sqrt(second_moments)))
    return normalised(np.maximum(target - bsdf_share[:, np.newaxis], 0.0) + FLOOR)


def normalised(values: FloatArray) -> FloatArray:
    """Rows with a mean of 1; 1 everywhere where there is nothing."""
    mean = values.mean(axis=1, keepdims=True)
    return np.where(mean > 0.0, values / np.maximum(mean, 1e-300), 1.0)


def blurred(values: FloatArray) -> FloatArray:
    """Each bin mixed with its neighbours in the square, edges repeated, shape (cells, bins)."""
    square: FloatArray = values[:, MORTON].reshape(-1, GUIDE_BINS, GUIDE_BINS)
    for axis in (1, 2):
        first, last = square.take([0], axis=axis), square.take([-1], axis=axis)
        before = np.concatenate([first, square], axis=axis).take(range(GUIDE_BINS), axis=axis)
        after = np.concatenate([square, last], axis=axis).take(range(1, GUIDE_BINS + 1), axis=axis)
        square = (1.0 - BLUR) * square + 0.5 * BLUR * (before + after)
    result = np.empty_like(values)
    result[:, MORTON] = square.reshape(len(values), -1)
    return result


def pyramid(densities: FloatArray) -> NDArray[np.float32]:
    """All levels from 2 x 2 to the densities themselves, each the mean of its four children, shape (cells, nodes)."""
    levels = [densities]
    while levels[0].shape[1] > 4:
        levels.insert(0, levels[0].reshape(len(densities), -1, 4).mean(axis=2))
    return np.concatenate(levels, axis=1).astype(np.float32)


def _morton_order() -> NDArray[np.int64]:
    """The Morton index of each bin of the square, row by row: children of one parent stand together."""
    row, column = np.divmod(np.arange(GUIDE_BINS * GUIDE_BINS), GUIDE_BINS)
    index = np.zeros_like(row)
    for bit in range(GUIDE_LEVELS):
        index |= ((column >> bit) & 1) << (2 * bit) | ((row >> bit) & 1) << (2 * bit + 1)
    return index


MORTON = _morton_order()
