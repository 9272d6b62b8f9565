"""Worths of cells."""

from __future__ import annotations

import numpy as np
import pytest

from warpmis.cache.cell_moments import CellMoments, worths


def moments(count: float, tail: float, light: float, cost: float) -> CellMoments:
    return CellMoments(*(np.array([float(value)]) for value in (count, tail, light, cost)))


def test_worths_are_roots_of_value_per_ray() -> None:
    tail, light = worths(moments(1e9, tail=8e9, light=2e9, cost=2e9))
    assert tail[0] == pytest.approx(2.0, rel=1e-6)
    assert light[0] == pytest.approx(2.0, rel=1e-6)


def test_cell_without_light_so_far_is_not_given_up() -> None:
    columns = ([1e6, 10.0], [1e6, 0.0], [1e6, 0.0], [1e6, 10.0])
    tail, light = worths(CellMoments(*(np.array(values, float) for values in columns)))
    assert tail[1] > 0.5 * tail[0] and light[1] > 0.5 * light[0]


def test_parts_inherit_their_part() -> None:
    inherited = moments(100, 4, 6, 8).inherited(np.array([0, 0]), np.array([0.5, 0.25]))
    np.testing.assert_allclose(inherited.count, [50.0, 25.0])
    np.testing.assert_allclose(inherited.plus(inherited).light, [6.0, 3.0])
