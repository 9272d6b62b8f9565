"""The statistics that other tests rely on: the truth passes as often as it should, an error of stated size fails."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from stats import (
    POWER,
    DirectionGrid,
    chi_square,
    detectable_bias,
    detectable_imbalance,
    fit_directions,
    frame_about,
    polar,
    sidak,
    standard_error,
    uniformity,
    welch_test,
    z_test,
)

AXIS = np.array([0.36, -0.48, 0.8])


def cosine_directions(count: int, seed: int) -> NDArray[np.float32]:
    """Cosine-distributed about AXIS, drawn with NumPy."""
    u, v = np.random.default_rng(seed).random((2, count))
    local = np.stack([np.sqrt(u) * np.cos(2 * np.pi * v), np.sqrt(u) * np.sin(2 * np.pi * v), np.sqrt(1 - u)], axis=1)
    return (local @ frame_about(AXIS)).astype(np.float32)


def cosine_density(directions: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.maximum(directions @ AXIS, 0.0).astype(np.float32) / np.float32(np.pi)


def test_sidak_keeps_the_joint_significance() -> None:
    assert 1.0 - (1.0 - sidak(0.01, 37)) ** 37 == pytest.approx(0.01)
    assert sidak(0.01, 1) == pytest.approx(0.01)


def test_chi_square_of_a_right_density_is_calibrated() -> None:
    """The p-values of 400 repetitions are uniform."""
    rng = np.random.default_rng(1)
    share = rng.dirichlet(np.ones(40))
    p = np.array([chi_square(rng.multinomial(5000, share), 5000 * share).p_value for _ in range(400)])
    assert uniformity(p, 10).p_value > 1e-3


def test_chi_square_finds_the_imbalance_that_it_claims_to_find() -> None:
    """Over 400 repetitions the stated error is found about as often as POWER says."""
    rng = np.random.default_rng(2)
    count, cells, significance = 20_000, 50, 1e-3
    wrong = detectable_imbalance(count, cells - 1, significance)
    share = (1.0 + wrong * np.where(np.arange(cells) % 2, 1.0, -1.0)) / cells
    expected = np.full(cells, count / cells)
    found = [chi_square(rng.multinomial(count, share), expected).p_value < significance for _ in range(400)]
    # Three binomial standard errors either way.
    assert abs(np.mean(found) - POWER) < 3.0 * np.sqrt(POWER * (1.0 - POWER) / 400)


def test_chi_square_pools_small_cells() -> None:
    expected = np.array([0.5, 1.0, 4.5, 100.0, 200.0])
    fit = chi_square(np.array([1.0, 0.0, 5.0, 100.0, 200.0]), expected)
    assert fit.dof == 2
    assert fit.statistic == pytest.approx(0.0)
    # A pool that would itself be too small takes in the next cell.
    assert chi_square(np.array([1.0, 100.0, 200.0]), np.array([1.0, 100.0, 200.0])).dof == 1


def test_chi_square_rejects_samples_where_none_can_be() -> None:
    expected = np.array([0.0, 5000.0, 5000.0])
    assert chi_square(np.array([1.0, 5000.0, 4999.0]), expected).p_value == 0.0
    assert chi_square(np.array([0.0, 5000.0, 5000.0]), expected).p_value == 1.0


def test_uniformity_in_two_dimensions_sees_what_the_margins_do_not() -> None:
    x = np.random.default_rng(3).random(20_000)
    dependent = np.stack([x, np.mod(x + 0.1 * np.random.default_rng(4).random(20_000), 1.0)], axis=1)
    assert uniformity(dependent[:, 0], 16).p_value > 1e-3
    assert uniformity(dependent[:, 1], 16).p_value > 1e-3
    assert uniformity(dependent, 16).p_value < 1e-9
    assert uniformity(np.random.default_rng(5).random((20_000, 2)), 16).p_value > 1e-3


@pytest.mark.parametrize("fitted", [True, False])
def test_directions_of_the_right_density_pass_and_of_a_wrong_one_fail(fitted: bool) -> None:
    directions = cosine_directions(200_000, seed=1)
    grid = DirectionGrid.about(AXIS, np.linspace(0.0, 2.0, 13), sectors=12)
    if fitted:
        grid = DirectionGrid.fitted(cosine_directions(20_000, seed=2), np.linspace(0.0, 1.0, 13), sectors=12)
    fit, integral = fit_directions(directions, cosine_density, grid)
    assert fit.p_value > 1e-3
    assert integral == pytest.approx(1.0, abs=2e-3)

    def tilted(d: NDArray[np.float32]) -> NDArray[np.float32]:
        """3 % too large on one side, 3 % too small on the other: still of integral 1."""
        return cosine_density(d) * (1.0 + 0.03 * np.sign(d @ frame_about(AXIS)[0])).astype(np.float32)

    assert detectable_imbalance(fit.count, fit.dof, 1e-6) < 0.03
    assert fit_directions(directions, tilted, grid)[0].p_value < 1e-6
    assert fit_directions(directions, lambda d: cosine_density(d) * np.float32(1.03), grid)[0].p_value < 1e-6


def test_missing_directions_are_expected_where_the_density_leaves_room() -> None:
    directions = cosine_directions(100_000, seed=1)
    kept = directions[np.random.default_rng(6).random(len(directions)) < 0.7]
    grid = DirectionGrid.about(AXIS, np.linspace(0.0, 1.0, 9), sectors=12)
    missing = len(directions) - len(kept)

    def thinned(d: NDArray[np.float32]) -> NDArray[np.float32]:
        return cosine_density(d) * np.float32(0.7)

    assert fit_directions(kept, thinned, grid, missing=missing)[0].p_value > 1e-3
    assert fit_directions(kept, cosine_density, grid, missing=missing)[0].p_value < 1e-9
    assert fit_directions(kept, thinned, grid, missing=0)[0].p_value < 1e-9


def test_grid_resolves_a_cone_of_an_arc_second() -> None:
    """Directions within 1e-5 rad, where float32 cosines are all equal, fall in all rings alike."""
    u, v = np.random.default_rng(7).random((2, 20_000))
    sin_theta = 1e-5 * np.sqrt(u)
    local = np.stack([sin_theta * np.cos(2 * np.pi * v), sin_theta * np.sin(2 * np.pi * v), np.ones_like(u)], axis=1)
    grid = DirectionGrid.about(AXIS, np.linspace(0.0, 0.5e-10, 6), sectors=4)
    counts = grid.counts(local @ grid.frame)
    assert chi_square(counts[:-1], np.full(20, 1000.0)).p_value > 1e-3
    assert grid.solid_angles.sum() == pytest.approx(np.pi * 1e-10)


def test_grid_points_lie_in_their_own_cells_and_integrate() -> None:
    grid = DirectionGrid.about(AXIS, np.array([0.0, 0.01, 0.3, 1.2, 2.0]), sectors=5)
    points = grid.points(32)
    counts = grid.counts(points)
    assert counts[-1] == 0
    np.testing.assert_allclose(counts[:-1], 1024, atol=2)  # float32 rounding may cross an edge
    height, _ = polar(grid.frame, points)
    # Over the sphere: the mean of (1 - cos)^2 is 4/3.
    integral = grid.integrals((height**2).astype(np.float32), 32).sum()
    assert integral == pytest.approx(4.0 * np.pi * 4.0 / 3.0, rel=1e-3)
    assert grid.solid_angles.sum() == pytest.approx(4.0 * np.pi)


def test_mean_tests() -> None:
    rng = np.random.default_rng(8)
    a, b = rng.normal(1.0, 1.0, 10_000), rng.normal(1.0, 5.0, 40_000)
    assert z_test(a.mean(), standard_error(a), 1.0) > 1e-3
    assert welch_test(a, b) > 1e-3
    shift = detectable_bias(standard_error(a), 1e-3)
    assert shift == pytest.approx((3.2905 + 2.3263) * standard_error(a), rel=1e-4)
    assert z_test(a.mean(), standard_error(a), 1.0 + 1.5 * shift) < 1e-3
    assert welch_test(a, b + 0.5) < 1e-3
    assert z_test(2.0, 0.0, 2.0) == 1.0
    assert z_test(2.0, 0.0, 2.5) == 0.0


def test_detectable_bias_is_found_as_often_as_stated() -> None:
    rng = np.random.default_rng(9)
    shift = detectable_bias(0.1, 1e-3)
    found = [z_test(mean, 0.1, 0.0) < 1e-3 for mean in rng.normal(shift, 0.1, 4000)]
    assert abs(np.mean(found) - POWER) < 4.0 * np.sqrt(POWER * (1.0 - POWER) / 4000)
