"""Triangulation of polygons with closed-form areas."""

from __future__ import annotations

import numpy as np
import pytest

from warpmis.usd.shapes.ears import clip_ears
from warpmis.usd.shapes.polygons import Polygons, triangulate


def one_polygon(points: np.ndarray) -> Polygons:
    n = len(points)
    return Polygons(np.asarray(points, float), np.array([n]), np.arange(n), np.array([True]))


def signed_areas(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    p = np.asarray(points, float)[triangles]
    return 0.5 * np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])


def star(tips: int) -> np.ndarray:
    """A star with a reflex corner between any two tips, in a plane aslant to all axes."""
    angle = np.arange(2 * tips) * np.pi / tips
    radius = np.where(np.arange(2 * tips) % 2, 0.3, 1.0)
    u, v = np.array([1.0, 2.0, 2.0]) / 3, np.array([2.0, 1.0, -2.0]) / 3
    return radius[:, None] * (np.cos(angle)[:, None] * u + np.sin(angle)[:, None] * v) + [5, -3, 2]


@pytest.mark.parametrize("tips", [3, 5, 20])
def test_star_is_covered_once_with_no_triangle_turned_over(tips):
    points = star(tips)
    corners, faces = triangulate(one_polygon(points))
    assert corners.shape == (2 * tips - 2, 3)
    assert (faces == 0).all()
    along = signed_areas(points, corners) @ np.cross([1.0, 2.0, 2.0], [2.0, 1.0, -2.0]) / 9
    assert (along > 0).all()
    assert along.sum() == pytest.approx(tips * 0.3 * np.sin(np.pi / tips), rel=1e-9)


@pytest.mark.parametrize("first", range(4))
def test_concave_quad_fans_from_its_reflex_corner_wherever_it_is(first):
    points = np.roll(np.array([[0, 0, 0], [2, 1, 0], [0, 2, 0], [1, 1, 0.0]]), first, axis=0)
    corners, _ = triangulate(one_polygon(points))
    np.testing.assert_allclose(signed_areas(points, corners), [[0, 0, 0.5], [0, 0, 0.5]])


def test_convex_faces_of_all_sizes_fan_from_their_first_corner_with_their_face_number():
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    polygons = Polygons(
        points, np.array([3, 0, 4, 3]), np.array([0, 1, 2, 0, 1, 2, 3, 2, 3, 0]), np.array([1, 0, 1, 0], bool)
    )
    corners, faces = triangulate(polygons)
    assert corners.tolist() == [[0, 1, 2], [3, 4, 5], [3, 5, 6]]
    assert faces.tolist() == [0, 2, 2]


def test_self_crossing_outline_ends_with_the_right_number_of_triangles():
    bow = np.array([[0, 0, 0], [1, 1, 0], [1, 0, 0], [0, 1, 0], [-1, 3, 0], [2, -3, 0.0]])
    triangles = clip_ears(bow[None])
    assert triangles.shape == (1, 4, 3)
    assert set(triangles.ravel().tolist()) <= set(range(6))


def test_polygons_are_clipped_together_as_they_are_alone():
    """Stars of two sizes, wound both ways, and an outline that crosses itself, in one mesh."""
    bow = np.array([[0, 0, 0], [1, 1, 0], [1, 0, 0], [0, 1, 0], [-1, 3, 0], [2, -3, 0.0]])
    outlines = [star(5), star(3), star(5)[::-1] * 2, bow, np.roll(star(5), 3, axis=0), star(3)[::-1]]
    counts = np.array([len(outline) for outline in outlines])
    points = np.concatenate(outlines)
    together, faces = triangulate(Polygons(points, counts, np.arange(len(points)), np.ones(6, bool)))
    alone = [triangulate(one_polygon(outline))[0] for outline in outlines]
    for face, (first, corners) in enumerate(zip(np.cumsum(counts) - counts, alone, strict=True)):
        np.testing.assert_array_equal(together[faces == face] - first, corners)
