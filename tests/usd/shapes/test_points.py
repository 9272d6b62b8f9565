"""UsdGeomPoints as spheres."""

from __future__ import annotations

import numpy as np
import pytest
from usd.stages import check_invariants, corners, load, mentions, shading_normals, volume

from warpmis.usd.shapes import points as points_module
from warpmis.usd.shapes.points import icosphere


def points(values: str, more: str) -> str:
    return f'def Points "P"\n{{\n    point3f[] points = {values}\n    {more}\n}}\n'


@pytest.mark.parametrize("levels", range(4))
def test_icosphere_is_a_closed_sphere_of_unit_vectors(levels):
    directions, triangles = icosphere(levels)
    assert directions.shape == (10 * 4**levels + 2, 3)
    assert triangles.shape == (20 * 4**levels, 3)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0)
    p = directions[triangles]
    fronts = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    assert (np.einsum("fi,fi->f", fronts, p.mean(axis=1)) > 0).all()
    volume = np.einsum("fi,fi->", fronts, p[:, 0]) / 6
    assert volume == pytest.approx([2.5361507, 3.6587, 4.0470, 4.1519][levels], rel=1e-3)  # 4.1888 in the end
    edges = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()


def test_widths_are_diameters():
    scene = load(points("[(0, 0, 0), (10, 0, 0)]", 'float[] widths = [2, 4] (interpolation = "vertex")'))
    check_invariants(scene)
    assert len(scene.geometry.triangles) == 2 * 320
    second = corners(scene)[..., 0].mean(axis=1) > 5
    for here, centre, radius in ((~second, [0, 0, 0], 1), (second, [10, 0, 0], 2)):
        away = corners(scene)[here] - centre
        np.testing.assert_allclose(np.linalg.norm(away, axis=-1), radius, rtol=1e-6)
        np.testing.assert_allclose(shading_normals(scene)[here], away / radius, atol=1e-6)
    assert volume(scene) == pytest.approx(4.0470 * 9, rel=1e-3)


def test_what_cannot_be_shown_is_left_out():
    text = points("[(0, 0, 0), (nan, 0, 0), (5, 0, 0), (9, 0, 0)]", "float[] widths = [2, 2, 0, -1]")
    scene = load(text)
    assert len(scene.geometry.triangles) == 320
    assert mentions(scene, "/P", "1 points left out")


def test_many_points_are_rendered_in_less_detail(monkeypatch):
    monkeypatch.setattr(points_module, "MAX_TRIANGLES", 100)
    scene = load(points("[(0, 0, 0)]", "float[] widths = [1]"))
    assert len(scene.geometry.triangles) == 80
    assert mentions(scene, "/P", "less detail")
