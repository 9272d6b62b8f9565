"""The tree over position and normal that makes the cells."""

from __future__ import annotations

import numpy as np
import pytest

from warpmis.cache import cells as module
from warpmis.cache.cells import CellTree


def places(count: int, seed: int = 0) -> np.ndarray:
    """Vertices on the walls of a unit box, with their normals, shape (count, 6)."""
    rng = np.random.default_rng(seed)
    x = rng.uniform(0.0, 1.0, (count, 3))
    axis, side = rng.integers(0, 3, count), rng.integers(0, 2, count)
    n = np.zeros((count, 3))
    x[np.arange(count), axis] = side
    n[np.arange(count), axis] = 1.0 - 2.0 * side
    return np.concatenate([x, n], axis=1)


def test_one_cell_before_anything_is_known() -> None:
    tree = CellTree(extent=1.0)
    assert tree.cells == 1
    assert (tree.find(places(10)) == 0).all()


def test_cells_hold_no_more_than_they_may_and_agree_with_a_walk() -> None:
    vertices = places(50_000)
    tree = CellTree(extent=1.0)
    refined = tree.refine(vertices, tree.find(vertices))
    assert 30 <= tree.cells <= 100
    assert np.bincount(refined.cell_of).max() <= module.MOST_RECORDS
    np.testing.assert_array_equal(refined.cell_of, tree.find(vertices))
    assert set(refined.cell_of) == set(range(tree.cells))
    assert (refined.parent == 0).all()
    assert (0.5**refined.halvings).sum() == pytest.approx(1.0)


def test_records_that_stand_for_many_divide_as_many_would() -> None:
    vertices = places(20_000)
    few, many = CellTree(1.0), CellTree(1.0)
    few.refine(vertices[::10], few.find(vertices[::10]), stands_for=10.0)
    many.refine(vertices, many.find(vertices))
    assert few.cells == pytest.approx(many.cells, rel=0.2)


def test_two_sides_of_a_thin_wall_are_two_cells() -> None:
    rng = np.random.default_rng(1)
    x = rng.uniform(0.0, 1.0, (6000, 3)) * (1.0, 1.0, 0.0)
    n = np.where(np.arange(6000)[:, None] % 2 == 0, (0.0, 0.0, 1.0), (0.0, 0.0, -1.0))
    tree = CellTree(extent=1.0)
    refined = tree.refine(np.concatenate([x, n], axis=1), np.zeros(6000, np.int64))
    front, back = refined.cell_of[::2], refined.cell_of[1::2]
    assert not set(front) & set(back)


def test_what_a_narrow_view_sees_in_one_place_is_one_cell() -> None:
    """Records that differ by rounding alone cannot be told apart: dividing them would fill the memory with cells."""
    rng = np.random.default_rng(2)
    for extent, noise in ((1.0, 1e-7), (1.0, 0.0), (1e6, 0.05)):
        x = extent * np.array([0.3, 0.7, 0.2]) + rng.uniform(-noise, noise, (9000, 3))
        n = np.broadcast_to([0.0, 1.0, 0.0], (9000, 3))
        tree = CellTree(extent)
        tree.refine(np.concatenate([x, n], axis=1), np.zeros(9000, np.int64))
        assert tree.cells == 1


def test_two_places_a_float_apart_are_divided_or_left() -> None:
    """The mean of most is rounded to the upper one: nothing would lie above it."""
    low = np.float32(1.0)
    high = np.nextafter(low, np.float32(2.0))
    x = np.where(np.arange(9000)[:, None] < 10, float(low), float(high)) * np.ones((1, 3))
    tree = CellTree(extent=1e-3)
    tree.refine(np.concatenate([x, np.ones((9000, 3))], axis=1), np.zeros(9000, np.int64))
    assert tree.cells <= 2


def test_later_rounds_divide_cells_further_and_say_where_they_came_from() -> None:
    vertices = places(50_000)
    tree = CellTree(extent=1.0)
    tree.refine(vertices[:5000], tree.find(vertices[:5000]))
    before, old_cell = tree.cells, tree.find(vertices)
    refined = tree.refine(vertices, old_cell)
    assert tree.cells > before
    np.testing.assert_array_equal(refined.parent[refined.cell_of], old_cell)
    np.testing.assert_array_equal(refined.parent[:before], np.arange(before))
    # The parts of each cell add up to it.
    np.testing.assert_allclose(np.bincount(refined.parent, 0.5**refined.halvings), 1.0)


def test_bound_on_the_number_of_cells(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_CELLS", 37)
    tree = CellTree(extent=1.0)
    vertices = places(200_000)
    tree.refine(vertices, tree.find(vertices))
    assert tree.cells == 37


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("moved", [0.0, 1e3])
def test_same_cells_at_any_scale(scale: float, moved: float) -> None:
    vertices = places(20_000)
    tree, scaled = CellTree(1.0), CellTree(scale)
    tree.refine(vertices, tree.find(vertices))
    vertices = vertices * ([scale] * 3 + [1.0] * 3) + ([moved * scale] * 3 + [0.0] * 3)
    scaled.refine(vertices, scaled.find(vertices))
    assert scaled.cells == pytest.approx(tree.cells, rel=0.05)


def test_records_at_one_place_are_one_cell() -> None:
    vertices = np.tile([[0.3, 0.2, 0.1, 0.0, 0.0, 1.0]], (10_000, 1))
    tree = CellTree(extent=1.0)
    tree.refine(vertices, tree.find(vertices))
    assert tree.cells == 1
