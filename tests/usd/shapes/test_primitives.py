"""Implicit gprims: sizes, sides, areas and normals against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from usd.stages import area, check_invariants, corners, load, mentions, shading_normals, vector_areas, volume


def prim(kind: str, attributes: str = "") -> str:
    return f'def {kind} "P"\n{{\n{attributes}\n}}\n'


def bounds(scene):
    points = corners(scene).reshape(-1, 3)
    return points.min(axis=0), points.max(axis=0)


def test_cube_is_twelve_flat_triangles_facing_outwards():
    scene = load(prim("Cube", "double size = 3"))
    check_invariants(scene)
    assert len(scene.geometry.triangles) == 12
    assert area(scene) == pytest.approx(54.0)
    assert volume(scene) == pytest.approx(27.0)
    assert (scene.geometry.normal_indices == -1).all()


def test_sphere_is_fine_lies_on_the_true_surface_and_has_its_normals():
    scene = load(prim("Sphere", "double radius = 2"))
    check_invariants(scene)
    points = corners(scene)
    np.testing.assert_allclose(np.linalg.norm(points, axis=-1), 2.0, rtol=1e-6)
    np.testing.assert_allclose(shading_normals(scene), points / 2.0, atol=1e-6)
    assert len(scene.geometry.triangles) >= 64 * 31 * 2
    assert volume(scene) == pytest.approx(4 / 3 * np.pi * 8, rel=0.01)
    assert volume(scene) < 4 / 3 * np.pi * 8


def test_left_handed_sphere_faces_inwards():
    scene = load(prim("Sphere", 'uniform token orientation = "leftHanded"'))
    check_invariants(scene)
    assert volume(scene) < 0
    np.testing.assert_allclose(shading_normals(scene), -corners(scene), atol=1e-6)


VOLUMES = {
    "Cylinder": ("double height = 3\ndouble radius = 0.5", np.pi * 0.25 * 3, np.pi * 3 + np.pi / 2),
    "Cylinder_1": (
        "double height = 3\ndouble radiusBottom = 2\ndouble radiusTop = 1",
        np.pi * (4 + 2 + 1),
        np.pi * (4 + 1 + 3 * np.sqrt(10)),
    ),
    "Cone": ("double height = 3\ndouble radius = 4", np.pi * 16, np.pi * (16 + 20)),
    "Capsule": ("double height = 3\ndouble radius = 0.5", np.pi * (0.75 + 4 / 3 * 0.125), np.pi * (3 + 1)),
    # the hull of two spheres: caps cut at the tangent cone, sin(latitude) = (1 - 0.5) / 2
    "Capsule_1": ("double height = 2\ndouble radiusBottom = 1\ndouble radiusTop = 0.5", None, None),
}


@pytest.mark.parametrize("kind", [kind for kind in VOLUMES if VOLUMES[kind][1]])
def test_volume_and_area_of_solids_of_revolution(kind):
    attributes, expected_volume, expected_area = VOLUMES[kind]
    scene = load(prim(kind, attributes))
    check_invariants(scene)
    assert volume(scene) == pytest.approx(expected_volume, rel=0.005)
    assert area(scene) == pytest.approx(expected_area, rel=0.005)


def test_capsule_with_two_radii_touches_both_spheres_smoothly():
    scene = load(prim("Capsule_1", VOLUMES["Capsule_1"][0]))
    check_invariants(scene)
    sine = 0.25
    side = np.pi * (1.0 + 0.5) * np.sqrt(1 - sine**2) * 2 * np.sqrt(1 - sine**2)
    caps = 2 * np.pi * (1 + sine) + 2 * np.pi * 0.25 * (1 - sine)
    assert area(scene) == pytest.approx(side + caps, rel=0.005)
    low, high = bounds(scene)
    np.testing.assert_allclose([low[2], high[2]], [-2, 1.5], atol=1e-6)


def test_cylinder_rim_is_sharp_and_its_side_smooth():
    scene = load(prim("Cylinder", "double height = 2\ndouble radius = 1"))
    points, normals = corners(scene), shading_normals(scene)
    side = np.abs(normals[..., 2]) < 0.5
    np.testing.assert_allclose(normals[side], points[side] * [1, 1, 0], atol=1e-6)
    np.testing.assert_allclose(normals[~side], np.sign(points[~side]) * [0, 0, 1], atol=1e-6)
    assert (side.all(axis=1) | (~side).all(axis=1)).all()


def test_cone_side_normals_lean_by_its_slope_up_to_the_apex():
    scene = load(prim("Cone", "double height = 4\ndouble radius = 3"))
    normals = shading_normals(scene)
    side = normals[..., 2] > 0
    np.testing.assert_allclose(normals[side][:, 2], 0.6, atol=1e-6)
    apex = corners(scene)[..., 2] > 1.99
    triangle = np.flatnonzero(apex.any(axis=1))[0]
    middle = normals[triangle][~apex[triangle]].mean(axis=0)
    np.testing.assert_allclose(np.cross(normals[triangle][apex[triangle]][0], middle)[2], 0, atol=1e-6)


@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
@pytest.mark.parametrize("kind", ["Cylinder", "Cone", "Capsule"])
def test_axis_turns_the_long_side_and_keeps_the_outside_out(kind, axis):
    scene = load(prim(kind, f'uniform token axis = "{axis}"\ndouble height = 8\ndouble radius = 1'))
    check_invariants(scene)
    size = bounds(scene)[1] - bounds(scene)[0]
    along = "XYZ".index(axis)
    assert size[along] >= 8 - 1e-6
    np.testing.assert_allclose(np.delete(size, along), 2.0, rtol=0.01)
    assert volume(scene) > 0


@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
def test_cone_apex_points_along_the_positive_axis(axis):
    scene = load(prim("Cone", f'uniform token axis = "{axis}"'))
    along = "XYZ".index(axis)
    points = corners(scene).reshape(-1, 3)
    top = points[points[:, along] > 0.999]
    np.testing.assert_allclose(np.delete(top, along, axis=1), 0.0, atol=1e-6)


@pytest.mark.parametrize(("axis", "size"), [("Z", (4, 6, 0)), ("Y", (4, 0, 6)), ("X", (0, 6, 4))], ids=str)
def test_plane_has_width_and_length_where_the_schema_puts_them_and_faces_its_axis(axis, size):
    scene = load(prim("Plane", f'uniform token axis = "{axis}"\ndouble width = 4\ndouble length = 6'))
    low, high = bounds(scene)
    np.testing.assert_allclose(high - low, size)
    np.testing.assert_allclose(vector_areas(scene).sum(axis=0), 24 * np.eye(3)["XYZ".index(axis)], atol=1e-5)
    assert scene.prims[0].double_sided


@pytest.mark.parametrize("value", ["-1", "nan", "inf"])
def test_impossible_sizes_leave_the_prim_out_with_a_warning(value):
    scene = load(prim("Sphere", f"double radius = {value}") + 'def Cube "C"\n{\n}\n')
    assert [p.path for p in scene.prims] == ["/C"]
    assert mentions(scene, "/P", "radius")


def test_size_zero_leaves_the_prim_out_and_defaults_are_the_schemas():
    scene = load(prim("Sphere", "double radius = 0") + 'def Cylinder "C"\n{\n}\n')
    assert volume(scene) == pytest.approx(2 * np.pi, rel=0.005)


@pytest.mark.parametrize("kind", ["NurbsCurves", "NurbsPatch", "Volume", "TetMesh"])
def test_unsupported_gprims_give_one_warning_with_their_path(kind):
    scene = load(prim(kind) + 'def Cube "C"\n{\n}\n')
    assert mentions(scene, "/P", kind, "not supported")
    assert len(scene.warnings) == 1
