"""The density by which a cell guides."""

from __future__ import annotations

import numpy as np
import pytest

from warpmis.cache.directions import BLUR, FLOOR, MORTON, blurred, guide_densities, pyramid
from warpmis.device.cache_views import GUIDE_BINS, GUIDE_NODES

BINS = GUIDE_BINS * GUIDE_BINS


def test_morton_order_keeps_children_of_a_node_together() -> None:
    assert sorted(MORTON) == list(range(BINS))
    square = MORTON.reshape(GUIDE_BINS, GUIDE_BINS)
    np.testing.assert_array_equal(square[:2, :2].ravel(), [0, 1, 2, 3])
    assert square[0, 2] == 4 and square[2, 0] == 8 and square[-1, -1] == BINS - 1


def test_blur_keeps_the_sum_and_spreads_to_the_neighbours() -> None:
    values = np.zeros((2, BINS))
    values[0, MORTON[5 * GUIDE_BINS + 7]] = 1.0
    values[1, MORTON[0]] = 1.0
    result = blurred(values)
    np.testing.assert_allclose(result.sum(axis=1), 1.0)
    square = result[0, MORTON].reshape(GUIDE_BINS, GUIDE_BINS)
    assert square[5, 7] == pytest.approx((1.0 - BLUR) ** 2)
    assert square[4, 7] == square[5, 6] == pytest.approx(0.5 * BLUR * (1.0 - BLUR))
    assert square[4, 6] == pytest.approx(0.25 * BLUR**2)
    assert (square > 0.0).sum() == 9


def test_density_covers_what_the_bsdf_leaves() -> None:
    """A tail of constant light needs no guide; where half of the square is lit the guide goes there alone."""
    moments = np.ones((3, BINS))
    moments[1, BINS // 2 :] = 0.0
    moments[2] = 0.0
    densities = guide_densities(moments, np.full(3, 0.5))
    np.testing.assert_allclose(densities.mean(axis=1), 1.0)
    np.testing.assert_allclose(densities[0], 1.0)
    np.testing.assert_allclose(densities[2], 1.0)
    lit, dark = densities[1, : BINS // 4].mean(), densities[1, 3 * BINS // 4 :].mean()
    assert lit > 1.8 and dark < 0.1
    assert densities.min() >= FLOOR / (1.0 + FLOOR)


def test_levels_are_means_of_their_children() -> None:
    densities = np.random.default_rng(0).uniform(0.1, 2.0, (5, BINS))
    nodes = pyramid(densities)
    assert nodes.shape == (5, GUIDE_NODES) and nodes.dtype == np.float32
    np.testing.assert_allclose(nodes[:, -BINS:], densities, rtol=1e-6)
    np.testing.assert_allclose(nodes[:, :4].mean(axis=1), densities.mean(axis=1), rtol=1e-6)
    np.testing.assert_allclose(nodes[:, 4:20].reshape(5, 4, 4).mean(axis=2), nodes[:, :4], rtol=1e-6)
