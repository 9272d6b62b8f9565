"""Shares of cells: Newton on the simplex, from records."""

from __future__ import annotations

import numpy as np
import pytest
from toys import Toy, bumps, smooth

from warpmis.cache.cell_shares import LEAST_PART, CellShares
from warpmis.rendering.launches import Launcher

launch = Launcher("cpu", 1).run_over
NAMES = ("bsdf", "light", "guide")


def rounds(sharing: CellShares, toy: Toy, count: int, scale: float = 1.0) -> None:
    """As many rounds in the first cell, each with a record of each part of the toy, which weighs what it is drawn."""
    for _ in range(count):
        a = sharing.shares[0]
        squares = scale * (toy.f / (toy.p @ a)) ** 2 * (toy.p @ a)
        sharing.learn(np.zeros(len(toy.f), np.int64), squares, toy.quotients(a), launch)


def best(toy: Toy) -> float:
    """The least second moment of shares on a grid."""
    ticks = np.linspace(0.0, 1.0, 41)
    size = toy.p.shape[1]
    grids = np.stack(np.meshgrid(*[ticks] * (size - 1), indexing="ij"), axis=-1).reshape(-1, size - 1)
    shares = np.concatenate([grids, 1.0 - grids.sum(axis=1, keepdims=True)], axis=1)
    allowed = shares[(shares >= LEAST_PART / size - 1e-9).all(axis=1)]
    return min(toy.second_moment(a) for a in allowed)


@pytest.mark.parametrize("scale", [1e-20, 1.0, 1e20])
@pytest.mark.parametrize("toy", [smooth(), bumps(3, seed=2)])
def test_rounds_arrive_at_the_optimum(toy: Toy, scale: float) -> None:
    sharing = CellShares(NAMES[: toy.p.shape[1]], "cpu")
    assert toy.second_moment(sharing.shares[0]) > 1.01 * best(toy)
    rounds(sharing, toy, 6, scale)
    assert toy.second_moment(sharing.shares[0]) < 1.003 * best(toy)


def test_a_cell_without_light_takes_what_holds_elsewhere() -> None:
    sharing = CellShares(NAMES, "cpu")
    sharing.inherit(np.zeros(2, np.int64), np.ones(2))
    rounds(sharing, bumps(3, seed=2), 4)
    np.testing.assert_allclose(sharing.shares[1], sharing.shares[0], atol=1e-4)


def moved(records: int) -> float:
    """How far records of one strategy alone move a cell from the other cell's shares, which are equal."""
    sharing = CellShares(NAMES[:2], "cpu")
    sharing.inherit(np.zeros(2, np.int64), np.ones(2))
    equal = np.ones((5000, 2))
    equal[::2, 0], equal[1::2, 1] = 1.5, 1.5
    sharing.learn(np.zeros(5000, np.int64), np.ones(5000), equal, launch)
    assert sharing.shares[0, 0] == pytest.approx(0.5, abs=1e-3)
    sharing.learn(np.ones(records, np.int64), np.full(records, 1e6), np.tile([2.0, 0.0], (records, 1)), launch)
    return float(sharing.shares[1, 0] - 0.5)


def test_a_single_record_moves_a_cell_little_however_bright() -> None:
    assert moved(5000) > 0.2
    assert 0.0 < moved(1) < 0.2 * moved(5000)


def test_parts_inherit_shares_and_their_part_of_the_sums() -> None:
    sharing = CellShares(NAMES, "cpu")
    rounds(sharing, bumps(3, seed=2), 2)
    shares, sums = sharing.shares.copy(), sharing.sums.copy()
    sharing.inherit(np.array([0, 0]), np.array([0.5, 0.25]))
    np.testing.assert_array_equal(sharing.shares, np.repeat(shares, 2, axis=0))
    np.testing.assert_allclose(sharing.sums, [0.5 * sums[0], 0.25 * sums[0]])


def test_what_lights_find_is_their_part_of_the_mixture() -> None:
    sharing = CellShares(NAMES, "cpu")
    sharing.shares = np.array([[0.5, 0.2, 0.3]])
    found = sharing.found_by_lights(
        np.zeros(3, np.int64), np.array([[2.0, 0.0, 0.0], [0.0, 5.0, 0.0], [1.0, 1.0, 1.0]])
    )
    np.testing.assert_allclose(found, [0.0, 1.0, 0.2])
    np.testing.assert_allclose(sharing.share_of("bsdf", "guide"), 0.8)
