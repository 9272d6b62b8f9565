"""Primvars of every interpolation on their way to the corners of what is rendered."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Usd, UsdGeom
from usd.stages import stage_of

from warpmis.usd.reading import Reading
from warpmis.usd.shapes.polygons import Polygons
from warpmis.usd.shapes.refined_mesh import refined_mesh

# Three squares in a row along x; the second is broken, as if one of its indices did not exist.
POINTS = np.array([[x, y, 0.0] for y in (0, 1) for x in range(4)])
QUADS = np.array([[0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6]])
NONE = np.empty(0, np.int64)


def refined(scheme: str, levels: int, linear: str = "all"):
    stage = stage_of(f'def Mesh "M"\n{{\n    token faceVaryingLinearInterpolation = "{linear}"\n}}\n')
    reading = Reading(stage, Usd.TimeCode(0.0), frozenset({"default"}), levels)
    polygons = Polygons(POINTS, np.array([4, 4, 4]), QUADS.reshape(-1), np.array([True, False, True]))
    return refined_mesh(UsdGeom.Mesh(stage.GetPrimAtPath("/M")), polygons, scheme, NONE, np.eye(4)[None], reading)


def at_corners(mesh, values, interpolation, indices=NONE):
    refined_values, rows = mesh.primvar(np.asarray(values, float), np.asarray(indices, np.int64), interpolation)
    assert rows.shape == mesh.polygons.indices.shape
    return refined_values[rows]


def shown(mesh):
    """Corners of polygons that are shown, and where they stand."""
    corner = np.repeat(mesh.polygons.usable, mesh.polygons.counts)
    return corner, mesh.polygons.points[mesh.polygons.indices[corner]]


@pytest.mark.parametrize(("scheme", "levels"), [("none", 2), ("bilinear", 2), ("catmullClark", 0), ("catmullClark", 2)])
@pytest.mark.parametrize("indexed", [False, True])
def test_values_reach_the_corners_they_belong_to(scheme, levels, indexed):
    """The value is x + 10 y in every interpolation but the first two, which have the face's number and 7."""
    mesh = refined(scheme, levels)
    corner, points = shown(mesh)

    def primvar(values, interpolation):
        values = np.asarray(values, float)[:, None]
        if not indexed:
            return at_corners(mesh, values, interpolation)[corner, 0]
        return at_corners(mesh, values[::-1], interpolation, np.arange(len(values))[::-1])[corner, 0]

    linear = POINTS[:, 0] + 10 * POINTS[:, 1]
    np.testing.assert_array_equal(primvar([7], "constant"), 7)
    middle = np.repeat(points.reshape(-1, 4, 3).mean(axis=1), 4, axis=0)
    np.testing.assert_array_equal(primvar([0, 1, 2], "uniform"), np.where(middle[:, 0] > 1.5, 2, 0))
    np.testing.assert_allclose(primvar(linear, "vertex"), points[:, 0] + 10 * points[:, 1])
    if scheme != "catmullClark" or levels == 0:
        for interpolation, values in (("varying", linear), ("faceVarying", linear[QUADS.reshape(-1)])):
            np.testing.assert_allclose(primvar(values, interpolation), points[:, 0] + 10 * points[:, 1])
    else:  # linear in the face, whose corners are 0, 1, 10 and 11 apart from the rounded points
        for interpolation, values in (("varying", linear), ("faceVarying", linear[QUADS.reshape(-1)])):
            found = primvar(values, interpolation).reshape(2, 16, 4)
            np.testing.assert_allclose(found.min(axis=(1, 2)), [0, 2])
            np.testing.assert_allclose(found.max(axis=(1, 2)), [11, 13])
            np.testing.assert_allclose(
                np.unique(found[0]), np.unique(np.add.outer(np.arange(5), 10 * np.arange(5)) / 4)
            )
    assert mesh.polygons.usable.sum() == (2 if levels == 0 or scheme == "none" else 32)


def test_faces_are_the_authored_ones():
    mesh = refined("catmullClark", 1)
    np.testing.assert_array_equal(mesh.faces, [0, 0, 0, 0, 2, 2, 2, 2])
    np.testing.assert_array_equal(refined("none", 1).faces, [0, 1, 2])


def test_face_varying_without_indices_is_joined_where_values_are_equal():
    """A ramp over both squares is as smooth as the same ramp with indices; corners of islands stay."""
    mesh = refined("catmullClark", 2, "cornersPlus1")
    values = POINTS[QUADS.reshape(-1)][:, :2]
    joined = at_corners(mesh, values, "faceVarying")
    np.testing.assert_allclose(joined, at_corners(mesh, POINTS[:, :2], "faceVarying", QUADS.reshape(-1)))
