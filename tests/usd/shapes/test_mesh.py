"""UsdGeomMesh: topology, orientation, normals and what is broken."""

from __future__ import annotations

import numpy as np
import pytest
from usd.stages import SQUARE, area, check_invariants, corners, load, mentions, shading_normals, vector_areas, volume


def mesh(counts: str, indices: str, points: str, more: str = "", scheme: str = "none", prim: str = "") -> str:
    return f"""def Mesh "M"
{{
    uniform token subdivisionScheme = "{scheme}"
    int[] faceVertexCounts = {counts}
    int[] faceVertexIndices = {indices}
    point3f[] points = {points}
    {more}
    {prim}
}}
"""


SQUARE_POINTS = "[(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]"
CUBE_POINTS = "[(0,0,0), (1,0,0), (0,1,0), (1,1,0), (0,0,1), (1,0,1), (0,1,1), (1,1,1)]"
CUBE_COUNTS = "[4, 4, 4, 4, 4, 4]"
CUBE_INDICES = "[0,2,3,1, 4,5,7,6, 0,1,5,4, 2,6,7,3, 0,4,6,2, 1,3,7,5]"


def square(more: str = "", scheme: str = "none") -> str:
    return mesh("[4]", "[0, 1, 2, 3]", SQUARE_POINTS, more, scheme)


def test_quad_becomes_two_flat_triangles_with_its_front_towards_plus_z():
    scene = load(square())
    check_invariants(scene)
    np.testing.assert_allclose(vector_areas(scene), [[0, 0, 0.5], [0, 0, 0.5]])
    assert (scene.geometry.normal_indices == -1).all()
    assert scene.warnings == ()
    assert [prim.path for prim in scene.prims] == ["/M"]


def test_left_handed_mesh_has_its_front_on_the_other_side():
    scene = load(square('uniform token orientation = "leftHanded"'))
    np.testing.assert_allclose(vector_areas(scene).sum(axis=0), [0, 0, -1])


def test_double_sided_is_kept():
    assert load(square("uniform bool doubleSided = true")).prims[0].double_sided
    assert not load(square()).prims[0].double_sided


def test_hexagon_has_four_triangles_and_its_area():
    angles = np.arange(6) * np.pi / 3
    points = "[" + ", ".join(f"({np.cos(a)}, {np.sin(a)}, 2)" for a in angles) + "]"
    scene = load(mesh("[6]", "[0, 1, 2, 3, 4, 5]", points))
    assert len(scene.geometry.triangles) == 4
    assert area(scene) == pytest.approx(1.5 * np.sqrt(3), rel=1e-6)


def test_concave_faces_keep_their_area_and_winding():
    # an arrow head (one reflex corner, met last) and a U (two reflex corners) in one mesh
    points = (
        "[(0,0,0), (2,1,0), (0,2,0), (1,1,0), (5,0,0), (8,0,0), (8,3,0), (7,3,0), (7,1,0), (6,1,0), (6,3,0), (5,3,0)]"
    )
    scene = load(mesh("[4, 8]", "[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]", points))
    areas = vector_areas(scene)
    assert (areas[:, 2] > 0).all()  # no triangle is turned over, as a fan from the wrong corner would do
    assert len(areas) == 2 + 6
    assert areas[:2, 2].sum() == pytest.approx(1.0)
    assert areas[2:, 2].sum() == pytest.approx(3 * 3 - 1 * 2)


def test_concave_face_wound_the_other_way_faces_down():
    points = "[(0,0,0), (3,0,0), (3,3,0), (2,3,0), (2,1,0), (1,1,0), (1,3,0), (0,3,0)]"
    scene = load(mesh("[8]", "[7, 6, 5, 4, 3, 2, 1, 0]", points))
    areas = vector_areas(scene)
    assert (areas[:, 2] < 0).all()
    assert areas[:, 2].sum() == pytest.approx(-7.0)


def test_hole_faces_are_left_out():
    points = "[(0,0,0), (1,0,0), (2,0,0), (0,1,0), (1,1,0), (2,1,0)]"
    scene = load(mesh("[4, 4]", "[0, 1, 4, 3, 1, 2, 5, 4]", points, "int[] holeIndices = [0]"))
    assert corners(scene)[..., 0].min() == 1.0
    assert area(scene) == pytest.approx(1.0)


def test_faces_with_fewer_than_three_corners_are_left_out_silently():
    scene = load(mesh("[2, 3, 1]", "[0, 1, 0, 1, 2, 3]", SQUARE_POINTS))
    assert len(scene.geometry.triangles) == 1
    assert scene.warnings == ()


def test_triangles_without_area_are_left_out():
    scene = load(mesh("[3, 3]", "[0, 1, 1, 0, 1, 2]", SQUARE_POINTS))
    assert len(scene.geometry.triangles) == 1


NORMALS = {
    "constant": ("[(0, 0.6, 0.8)]", lambda p: np.broadcast_to([0, 0.6, 0.8], p.shape)),
    "uniform": ("[(0, 0.6, 0.8)]", lambda p: np.broadcast_to([0, 0.6, 0.8], p.shape)),
    # the normals lean along x by how far right the point is
    "vertex": (
        "[(0, 0, 2), (0.6, 0, 0.8), (0.6, 0, 0.8), (0, 0, 1)]",
        lambda p: np.stack([0.6 * p[..., 0], 0 * p[..., 0], 1 - 0.2 * p[..., 0]], -1),
    ),
    "faceVarying": (
        "[(0, 0, 2), (0.6, 0, 0.8), (0.6, 0, 0.8), (0, 0, 1)]",
        lambda p: np.stack([0.6 * p[..., 0], 0 * p[..., 0], 1 - 0.2 * p[..., 0]], -1),
    ),
}


@pytest.mark.parametrize("interpolation", [*NORMALS, "varying"])
def test_normals_reach_the_corners_by_their_interpolation(interpolation):
    values, expected = NORMALS.get(interpolation, NORMALS["vertex"])
    scene = load(square(f'normal3f[] normals = {values} (interpolation = "{interpolation}")'))
    check_invariants(scene)
    np.testing.assert_allclose(shading_normals(scene), expected(corners(scene)), atol=1e-6)


def test_face_varying_normals_follow_the_corners_not_the_points():
    # the same points in another order of corners: corner i has normal i
    values = "[(0.6, 0, 0.8), (0, 0.6, 0.8), (-0.6, 0, 0.8), (0, -0.6, 0.8)]"
    text = mesh("[4]", "[2, 3, 0, 1]", SQUARE_POINTS, f'normal3f[] normals = {values} (interpolation = "faceVarying")')
    scene = load(text)
    for point, normal in zip(corners(scene).reshape(-1, 3), shading_normals(scene).reshape(-1, 3), strict=True):
        corner = [(1, 1), (0, 1), (0, 0), (1, 0)].index((point[0], point[1]))
        np.testing.assert_allclose(
            normal, [[0.6, 0, 0.8], [0, 0.6, 0.8], [-0.6, 0, 0.8], [0, -0.6, 0.8]][corner], atol=1e-6
        )


def test_indexed_primvar_normals_go_before_the_normals_attribute():
    scene = load(
        square(
            'normal3f[] normals = [(0.6, 0, 0.8)] (interpolation = "constant")\n'
            'normal3f[] primvars:normals = [(0, 0, 1), (0, 0.6, 0.8)] (interpolation = "vertex")\n'
            "int[] primvars:normals:indices = [0, 0, 1, 1]\n"
        )
    )
    upper = corners(scene)[..., 1] == 1
    normals = shading_normals(scene)
    np.testing.assert_allclose(normals[upper], np.broadcast_to([0, 0.6, 0.8], normals[upper].shape), atol=1e-6)
    np.testing.assert_allclose(normals[~upper], np.broadcast_to([0, 0, 1], normals[~upper].shape), atol=1e-6)


@pytest.mark.parametrize("orientation", ["rightHanded", "leftHanded"])
def test_normals_on_the_back_are_turned_to_the_front(orientation):
    normals = 'normal3f[] normals = [(0, 0.6, -0.8)] (interpolation = "constant")'
    scene = load(square(f'uniform token orientation = "{orientation}"\n{normals}'))
    check_invariants(scene)
    side = 1 if orientation == "rightHanded" else -1
    expected = side * np.array([0, -0.6, 0.8])
    np.testing.assert_allclose(shading_normals(scene), np.broadcast_to(expected, (2, 3, 3)), atol=1e-6)


def test_triangle_whose_normals_disagree_about_the_side_or_are_zero_is_flat():
    values = "[(0, 0, 1), (0, 0, 1), (0, 0, -1), (0, 0, 0)]"
    scene = load(square(f'normal3f[] normals = {values} (interpolation = "vertex")'))
    check_invariants(scene)
    assert (scene.geometry.normal_indices == -1).all()


@pytest.mark.parametrize("scheme", ["bilinear", "catmullClark"])
def test_authored_normals_of_a_subdivision_mesh_are_ignored(scheme):
    scene = load(square('normal3f[] normals = [(0, 0.6, 0.8)] (interpolation = "constant")', scheme))
    assert not np.isclose(scene.geometry.normals, [0, 0.6, 0.8]).all(axis=1).any()


def test_unrefined_cage_has_vertex_averaged_normals():
    scene = load(mesh(CUBE_COUNTS, CUBE_INDICES, CUBE_POINTS, scheme="catmullClark"), complexity="low")
    check_invariants(scene)
    expected = (2 * corners(scene) - 1) / np.sqrt(3)  # at a cube's corner the three faces' normals average to this
    np.testing.assert_allclose(shading_normals(scene), expected, atol=1e-6)
    assert len(scene.geometry.triangles) == 12
    assert scene.warnings == ()


def test_left_handed_cage_has_its_normals_on_the_front():
    left = 'uniform token orientation = "leftHanded"'
    scene = load(mesh(CUBE_COUNTS, CUBE_INDICES, CUBE_POINTS, left, scheme="catmullClark"), complexity="low")
    check_invariants(scene)
    assert volume(scene) == pytest.approx(-1.0)
    np.testing.assert_allclose(shading_normals(scene), (1 - 2 * corners(scene)) / np.sqrt(3), atol=1e-6)


def test_uniform_normals_and_holes_refer_to_the_same_faces():
    normals = "[(0.6,0,-0.8), (0.6,0,0.8), (0,-0.8,0.6), (0,0.8,0.6), (-0.8,0,0.6), (0.8,0,0.6)]"
    more = f'int[] holeIndices = [0, 2]\nnormal3f[] normals = {normals} (interpolation = "uniform")'
    scene = load(mesh(CUBE_COUNTS, CUBE_INDICES, CUBE_POINTS, more))
    front = vector_areas(scene) * 2
    expected = {
        (0, 0, 1): (0.6, 0, 0.8),
        (0, 1, 0): (0, 0.8, 0.6),
        (-1, 0, 0): (-0.8, 0, 0.6),
        (1, 0, 0): (0.8, 0, 0.6),
    }
    assert {tuple(np.round(f).astype(int).tolist()) for f in front} == set(expected)
    for f, n in zip(front, shading_normals(scene), strict=True):
        np.testing.assert_allclose(
            n, np.broadcast_to(expected[tuple(np.round(f).astype(int).tolist())], (3, 3)), atol=1e-6
        )


BROKEN = {
    "index out of range": (mesh("[3, 3]", "[0, 1, 2, 0, 2, 9]", SQUARE_POINTS), 1, ("1 faces", "4 points")),
    "negative index": (mesh("[3, 3]", "[0, 1, 2, 0, 2, -1]", SQUARE_POINTS), 1, ("1 faces", "4 points")),
    "nan point": (mesh("[3, 3]", "[0, 1, 2, 0, 2, 3]", "[(0,0,0), (1,0,0), (1,1,0), (0,nan,0)]"), 1, ("finite",)),
    "inf point": (mesh("[3, 3]", "[0, 1, 2, 0, 2, 3]", "[(0,0,0), (1,0,0), (1,1,0), (0,1,inf)]"), 1, ("finite",)),
    "too many counts": (mesh("[3, 4]", "[0, 1, 2, 0, 2, 3]", SQUARE_POINTS), 1, ("add up to 7", "first 1")),
    "too few counts": (mesh("[3]", "[0, 1, 2, 0, 2, 3]", SQUARE_POINTS), 1, ("add up to 3", "first 1")),
    "negative count": (mesh("[3, -3, 3]", "[0, 1, 2, 0, 2, 3]", SQUARE_POINTS), 1, ("faceVertexCounts", "first 1")),
    "normals of wrong length": (
        square('normal3f[] normals = [(0, 0, 1), (0, 0, 1)] (interpolation = "vertex")'), 2, ("2 vertex", "4 are")),
    "normal index out of range": (
        square('normal3f[] primvars:normals = [(0, 0, 1)] (interpolation = "vertex")\n'
               "int[] primvars:normals:indices = [0, 0, 0, 5]"), 2, ("normals left out",)),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_broken_meshes_keep_what_is_sound_and_warn_once_with_the_path(case):
    text, triangles, words = BROKEN[case]
    scene = load(text)
    check_invariants(scene)
    assert len(scene.geometry.triangles) == triangles
    assert mentions(scene, "/M", *words), scene.warnings
    assert len(scene.warnings) == 1


def test_points_of_another_type_leave_the_mesh_out():
    text = f'def Mesh "M"\n{{{SQUARE}}}\n'.replace("point3f[] points", "int[] points").replace(
        "[(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]", "[1, 2, 3]"
    )
    scene = load(text + square().replace('"M"', '"Sound"'))
    assert [prim.path for prim in scene.prims] == ["/Sound"]
    assert mentions(scene, "/M.points", "type")


def test_empty_mesh_is_left_out_silently():
    scene = load('def Mesh "Empty"\n{\n}\n' + square())
    assert [prim.path for prim in scene.prims] == ["/M"]
    assert scene.warnings == ()
