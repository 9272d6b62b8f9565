"""Metrics against values worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from warpmis.metrics import (
    estimated_relative_error,
    mean_squared_error,
    relative_mse,
    squared_error,
    squared_scale,
    without_outliers,
)


def grey(*values: float) -> np.ndarray:
    return np.repeat(np.array(values)[np.newaxis, :, np.newaxis], 3, axis=2)


def test_squared_error_weighs_colours_by_luminance() -> None:
    apart = np.zeros((1, 2, 3))
    apart[0, 0] = (0.0, 2.0, 0.0)
    np.testing.assert_allclose(squared_error(apart, np.zeros((1, 2, 3))), [[4.0 * 0.7152, 0.0]])


def test_relative_mse_by_hand() -> None:
    # Mean luminance 2, so a tenth of it squared is 0.04; errors 1/9.04 and 0.25/1.04.
    reference, image = grey(3.0, 1.0), grey(4.0, 0.5)
    np.testing.assert_allclose(squared_scale(reference), [[9.04, 1.04]])
    assert relative_mse(image, reference) == pytest.approx((1.0 / 9.04 + 0.25 / 1.04) / 2)
    assert mean_squared_error(image, reference) == pytest.approx((1.0 + 0.25) / 2)


def test_relative_mse_does_not_depend_on_the_unit_of_radiance() -> None:
    reference, image = grey(3.0, 1.0, 0.0), grey(4.0, 0.5, 0.1)
    assert relative_mse(1e4 * image, 1e4 * reference) == pytest.approx(relative_mse(image, reference))


def test_outliers_are_one_pixel_in_a_thousand() -> None:
    values = np.r_[np.ones(1998), 1e9, 1e12]
    assert without_outliers(values).tolist() == [1.0] * 1998
    assert without_outliers(np.array([1.0, 2.0, 1e9])).tolist() == [1.0, 2.0, 1e9], "too few to have outliers"
    image = np.ones((50, 40, 3))
    image[7, 7] = image[9, 9] = 1e6
    assert relative_mse(image, np.ones((50, 40, 3))) == 0.0
    assert relative_mse(image, np.ones((50, 40, 3)), outliers=0.0) > 1e6


def test_estimated_error_is_that_of_the_samples() -> None:
    rng = np.random.default_rng(0)
    truth = np.full((100, 100, 3), 2.0)
    noise = 0.1 * rng.standard_normal((100, 100))  # equal in all channels: luminance varies as much
    measured = np.sqrt(relative_mse(truth + noise[..., np.newaxis], truth, outliers=0.0))
    assert estimated_relative_error(truth, np.full((100, 100), 0.01)) == pytest.approx(measured, rel=0.03)
    assert estimated_relative_error(np.zeros((4, 4, 3)), np.zeros((4, 4))) == 0.0
