"""Triangles along the Morton curve: another order, the same scene."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpmis.device.order import first_use_order, morton_codes, morton_order, spread_bits
from warpmis.device.upload import ordered
from warpmis.scene.geometry import Geometry


def soup(faces: int = 500, seed: int = 1) -> Geometry:
    """Random triangles over shared vertices, some of them unused, with a normal and a material each."""
    random = np.random.default_rng(seed)
    count = 300
    rows = random.integers(0, 40, (faces, 3))
    rows[::3] = -1
    return Geometry(
        points=random.normal(size=(count, 3)).astype(np.float32),
        triangles=random.integers(0, count - 20, (faces, 3)).astype(np.int32),
        normals=random.normal(size=(40, 3)).astype(np.float32),
        normal_indices=rows.astype(np.int32),
        materials=random.integers(0, 5, faces).astype(np.int32),
        prims=random.integers(0, 7, faces).astype(np.int32),
    )


def described(geometry: Geometry) -> NDArray[np.float64]:
    """A row a triangle, of all that belongs to it, sorted."""
    corners = geometry.points[geometry.triangles].reshape(-1, 9)
    rows = np.column_stack([corners, geometry.normal_indices, geometry.materials, geometry.prims]).astype(np.float64)
    return rows[np.lexsort(rows.T)]


def test_bits_are_spread_by_two() -> None:
    x = np.array([0, 1, 2, 0b1011, (1 << 21) - 1], dtype=np.uint64)
    for value, spread in zip(x, spread_bits(x), strict=True):
        assert int(spread) == sum(((int(value) >> k) & 1) << (3 * k) for k in range(21))
    # Bits beyond the 21st are cut, not mixed in.
    assert spread_bits(np.array([1 << 21], dtype=np.uint64))[0] == 0


def test_codes_run_through_the_octants_in_turn() -> None:
    corners = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], dtype=np.float32)
    codes = morton_codes(corners)
    assert (np.argsort(codes) == np.arange(8)).all()
    assert codes[7] == (1 << 63) - 1
    assert (morton_codes(np.ones((3, 3), dtype=np.float32)) == 0).all()


def test_morton_order_is_a_permutation_that_keeps_neighbours() -> None:
    random = np.random.default_rng(2)
    centers = random.random((4000, 1, 3))
    points = (centers + 0.001 * random.normal(size=(4000, 3, 3))).reshape(-1, 3).astype(np.float32)
    triangles = np.arange(12_000, dtype=np.int32).reshape(-1, 3)
    order = morton_order(points, triangles)
    np.testing.assert_array_equal(np.sort(order), np.arange(4000))

    def mean_step(permutation: NDArray[np.int64]) -> float:
        return float(np.linalg.norm(np.diff(centers[permutation, 0], axis=0), axis=1).mean())

    assert mean_step(order) < 0.2 * mean_step(np.arange(4000))
    assert len(morton_order(points, triangles[:0])) == 0


def test_vertices_are_renamed_in_the_order_of_their_first_use() -> None:
    triangles = np.array([[5, 2, 9], [2, 5, 0], [9, 9, 7]], dtype=np.int32)
    kept, renamed = first_use_order(triangles, 12)
    np.testing.assert_array_equal(kept, [5, 2, 9, 0, 7])
    np.testing.assert_array_equal(renamed, [[0, 1, 2], [1, 0, 3], [2, 2, 4]])
    assert renamed.dtype == np.int32


def test_first_use_order_preserves_the_geometry() -> None:
    geometry = soup()
    kept, renamed = first_use_order(geometry.triangles, len(geometry.points))
    np.testing.assert_array_equal(geometry.points[kept][renamed], geometry.points[geometry.triangles])
    assert len(kept) == len(np.unique(geometry.triangles)) < len(geometry.points)


def test_uploaded_order_keeps_every_triangle_with_all_that_belongs_to_it() -> None:
    geometry = soup()
    changed = ordered(geometry)
    assert (changed.triangles != geometry.triangles).any()
    np.testing.assert_array_equal(described(changed), described(geometry))


def test_empty_geometry_becomes_one_triangle_that_no_ray_meets() -> None:
    empty = soup(0)
    placed = ordered(empty)
    assert len(placed.triangles) == len(placed.materials) == len(placed.prims) == len(placed.normal_indices) == 1
    corners = placed.points[placed.triangles[0]]
    assert not np.cross(corners[1] - corners[0], corners[2] - corners[0]).any()
