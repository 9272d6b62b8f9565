"""Shares and worths of cells."""

from __future__ import annotations

import numpy as np
import pytest

from warpmis.cache.cell_moments import MAX_SHARE, MIN_SHARE, CellMoments, updated_shares, worths


def moments(
    count: float, by_bsdf: float, by_guide: float, tail: float = 1.0, light: float = 1.0, cost: float = 1.0
) -> CellMoments:
    return CellMoments(*(np.array([float(value)]) for value in (count, by_bsdf, by_guide, tail, light, cost)))


def test_equal_moments_leave_the_share() -> None:
    sums = moments(1e6, 2.0, 2.0)
    assert updated_shares(np.array([0.3]), sums, sums)[0] == pytest.approx(0.3)


@pytest.mark.parametrize("start", [0.2, 0.5, 0.8])
def test_steps_arrive_at_the_optimum_of_a_toy(start: float) -> None:
    """Two directions; the BSDF draws the first in 3 of 4, the guide in 1 of 4; f is (1, 1), so equal shares are best.

    E[F^2 q_s] = sum_w f^2 / p_a p_s / p_a.
    """
    f, p_bsdf, p_guide = np.array([1.0, 1.0]), np.array([0.75, 0.25]), np.array([0.25, 0.75])
    share = np.array([start])
    for _ in range(60):
        p = share[0] * p_bsdf + (1.0 - share[0]) * p_guide
        squares = f**2 / p
        sums = moments(1e12, (squares * p_bsdf / p).sum(), (squares * p_guide / p).sum())
        share = updated_shares(share, sums, sums)
    assert share[0] == pytest.approx(0.5, abs=1e-3)


def test_shares_keep_their_bounds_and_few_records_move_little() -> None:
    assert updated_shares(np.array([0.5]), moments(1e9, 1e9, 1e-9), moments(1e9, 1, 1))[0] == MAX_SHARE
    assert updated_shares(np.array([0.5]), moments(1e9, 1e-9, 1e9), moments(1e9, 1, 1))[0] == MIN_SHARE
    few = moments(5, 100.0, 0.0)
    assert updated_shares(np.array([0.5]), few, few)[0] == pytest.approx(0.5, abs=0.01)
    nothing = moments(1e6, 0.0, 0.0)
    assert updated_shares(np.array([0.4]), nothing, nothing)[0] == pytest.approx(0.4)


def test_worths_are_roots_of_value_per_ray() -> None:
    tail, light = worths(moments(1e9, 0, 0, tail=8e9, light=2e9, cost=2e9))
    assert tail[0] == pytest.approx(2.0, rel=1e-6)
    assert light[0] == pytest.approx(2.0, rel=1e-6)


def test_cell_without_light_so_far_is_not_given_up() -> None:
    columns = ([1e6, 10.0], [0, 0], [0, 0], [1e6, 0.0], [1e6, 0.0], [1e6, 10.0])
    tail, light = worths(CellMoments(*(np.array(values, float) for values in columns)))
    assert tail[1] > 0.5 * tail[0] and light[1] > 0.5 * light[0]


def test_parts_inherit_their_part() -> None:
    inherited = moments(100, 4, 6).inherited(np.array([0, 0]), np.array([0.5, 0.25]))
    np.testing.assert_allclose(inherited.count, [50.0, 25.0])
    np.testing.assert_allclose(inherited.plus(inherited).by_guide, [6.0, 3.0])
