"""Metrics against values worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from warpmis.film.metrics import (
    estimated_relative_error,
    mean_squared_error,
    relative_mse,
    relative_mse_of_parts,
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


# ---- the error that four parts of the samples tell ------------------------------------------------------------------


def noisy_parts(rng: np.random.Generator, truth: np.ndarray, deviation: float, counts: tuple[int, ...]) -> np.ndarray:
    """Sums of `counts` samples each, a sample being the truth with noise of that relative deviation."""
    noise = rng.standard_normal((4, *truth.shape)) * deviation * truth
    return np.array([count * truth + np.sqrt(count) * noise[part] for part, count in enumerate(counts)])


@pytest.mark.parametrize("counts", [(64, 64, 64, 64), (60, 70, 50, 76)])
def test_parts_tell_the_error_of_their_mean(counts: tuple[int, ...]) -> None:
    """Colours whose noise is independent: their luminance alone would tell half of it."""
    rng = np.random.default_rng(2)
    truth = np.linspace(1.0, 2.0, 90 * 90 * 3).reshape(90, 90, 3)
    parts = noisy_parts(rng, truth, 0.5, counts)
    true = relative_mse(parts.sum(axis=0) / sum(counts), truth)
    estimate, spread = relative_mse_of_parts(parts, np.array(counts))
    assert estimate == pytest.approx(true, rel=0.05)
    assert abs(estimate - true) < 4.0 * spread
    assert spread == pytest.approx(true * np.sqrt(8.0 / 3.0) / 90, rel=0.35), "colours have more degrees of freedom"


def test_standard_error_is_that_of_the_difference() -> None:
    """Grey noise over pixels alike: estimate less truth scatters as is claimed, within the 10 % that 400 runs tell."""
    rng = np.random.default_rng(3)
    truth = np.ones((20, 20, 3))
    differences, spreads = [], []
    for _ in range(400):
        noise = np.repeat(rng.standard_normal((4, 20, 20, 1)), 3, axis=3)
        parts = 25.0 * truth + 5.0 * 0.2 * noise
        estimate, spread = relative_mse_of_parts(parts, np.full(4, 25))
        differences.append(estimate - relative_mse(parts.sum(axis=0) / 100.0, truth))
        spreads.append(spread)
    assert np.std(differences) == pytest.approx(np.mean(spreads), rel=0.1)
    assert abs(np.mean(differences)) < 4.0 * np.std(differences) / 20.0


@pytest.mark.parametrize("fireflies", [0.05, 1.0])
def test_standard_error_covers_fireflies(fireflies: float) -> None:
    """So many of 64 samples, on average, have 20 times the light: the claim is no smaller than the scatter."""
    rng = np.random.default_rng(5)
    truth = np.full((20, 20, 3), (64.0 + 20.0 * fireflies) / 64.0)
    differences, spreads = [], []
    for _ in range(300):
        grey = 64.0 + 2.0 * rng.standard_normal((4, 20, 20, 1)) + 20.0 * rng.poisson(fireflies, (4, 20, 20, 1))
        parts = np.repeat(grey, 3, axis=3)
        estimate, spread = relative_mse_of_parts(parts, np.full(4, 64))
        differences.append(estimate - relative_mse(parts.sum(axis=0) / 256.0, truth))
        spreads.append(spread)
    assert np.std(differences) < np.mean(spreads) < 2.5 * np.std(differences)


def test_a_firefly_does_not_hide_behind_its_own_brightness() -> None:
    """In one of 100 pixels one of 256 samples has 10^4 times the light: three of six pairs of parts differ by it."""
    parts = np.full((4, 10, 10, 3), 64.0)
    parts[2, 3, 4] += 1e4
    squared = (1e4 / 256) ** 2  # of the pixel's mean; half of the pairs, each for 16 / 8 of it
    mean = 1.0 + 1e4 / 256 / 100
    expected = squared / (1.0 + (0.1 * mean) ** 2) / 100
    assert relative_mse_of_parts(parts, np.full(4, 64))[0] == pytest.approx(expected)
    assert expected > 10.0, "relative to the mean it would be 0.01 at most, one pixel in a hundred"


def test_a_black_picture_has_no_relative_error() -> None:
    assert relative_mse_of_parts(np.zeros((4, 3, 3, 3)), np.full(4, 16)) == (0.0, 0.0)
