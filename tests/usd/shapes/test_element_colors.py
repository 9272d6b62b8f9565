"""displayColor, displayOpacity and primvars of materials by point, by curve and by element of an implicit shape."""

from __future__ import annotations

import numpy as np
import pytest
from usd.points import seen_at
from usd.stages import corners, load, mentions

RED, GREEN, BLUE = (1, 0, 0), (0, 1, 0), (0, 0, 1)


def primvar(values, interpolation: str, name: str = "displayColor", kind: str = "color3f", more: str = "") -> str:
    shown = [tuple(map(float, value)) if np.ndim(value) else float(value) for value in values]
    return f'{kind}[] primvars:{name} = {shown} ( interpolation = "{interpolation}" )\n{more}\n'


def colors_of(scene):
    """displayColor at the triangles' corners, shape (F, 3, 3)."""
    assert scene.warnings == ()
    return scene.geometry.primvars[..., :3]


def points(more: str, places: str = "[(0, 0, 0), (4, 0, 0), (8, 0, 0)]", widths: str = "[2, 1, 2]") -> str:
    return f'def Points "P"\n{{\npoint3f[] points = {places}\nfloat[] widths = {widths}\n{more}}}\n'


def of_point(scene):
    """The point of each triangle of `points`, shape (F,)."""
    return np.round(corners(scene)[..., 0].mean(axis=1) / 4).astype(int)


@pytest.mark.parametrize("interpolation", ["vertex", "varying", "faceVarying"])
def test_each_points_sphere_has_its_own_color_and_opacity(interpolation):
    opacity = primvar([1, 0.5, 0.25], interpolation, "displayOpacity", "float")
    scene = load(points(primvar([RED, GREEN, BLUE], interpolation) + opacity))
    found = np.concatenate([colors_of(scene), scene.geometry.primvars[..., 3:4]], axis=2)
    expected = np.array([(*RED, 1), (*GREEN, 0.5), (*BLUE, 0.25)])[of_point(scene)]
    np.testing.assert_array_equal(found, np.broadcast_to(expected[:, None], found.shape))
    seen = seen_at(scene, [(0.1, 0.2), (4.1, 0.2), (8.1, 0.2)], (0.0, 0.0, -2.0))
    np.testing.assert_allclose(seen["diffuse"], [RED, GREEN, BLUE], atol=1e-6)
    np.testing.assert_allclose(seen["opacity"], [1, 0.5, 0.25], atol=1e-6)


def test_colors_stay_with_their_points_where_others_are_left_out():
    scene = load(points(primvar([RED, GREEN, BLUE], "vertex"), widths="[2, 0, 2]"))
    assert set(of_point(scene)) == {0, 2}
    np.testing.assert_array_equal(colors_of(scene)[:, 0], np.eye(3)[of_point(scene)])


def test_indexed_colors_of_points():
    scene = load(points(primvar([BLUE, RED], "vertex", more="int[] primvars:displayColor:indices = [1, 0, 1]")))
    np.testing.assert_array_equal(colors_of(scene)[:, 0], np.array([RED, BLUE, RED])[of_point(scene)])


@pytest.mark.parametrize("interpolation", ["constant", "uniform"])
def test_all_points_have_one_color(interpolation):
    scene = load(points(primvar([GREEN], interpolation)))
    assert scene.warnings == () and scene.materials[0].diffuse_color == GREEN


def test_colors_of_a_wrong_number_are_left_out_with_a_warning():
    scene = load(points(primvar([RED, GREEN], "vertex")))
    assert mentions(scene, "/P", "2 vertex values", "3 are needed")
    assert scene.materials[0].diffuse_color == (0.18, 0.18, 0.18)


READER = """
def Material "M"
{
    token outputs:surface.connect = </M/S.outputs:surface>
    def Shader "S"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:emissiveColor.connect = </M/R.outputs:result>
        token outputs:surface
    }
    def Shader "R"
    {
        uniform token info:id = "UsdPrimvarReader_float3"
        string inputs:varname = "tone"
        float3 outputs:result
    }
}
"""


def test_a_material_reads_the_primvar_of_each_point():
    tones = primvar([(1, 2, 3), (4, 5, 6), (7, 8, 9)], "vertex", "tone", "float3")
    text = points(tones + "rel material:binding = </M>\n").replace('"P"', '"P" (apiSchemas = ["MaterialBindingAPI"])')
    scene = load(text + READER)
    seen = seen_at(scene, [(0.1, 0.2), (4.1, 0.2), (8.1, 0.2)], (0.0, 0.0, -2.0))
    np.testing.assert_allclose(seen["emission"], np.arange(1, 10).reshape(3, 3), rtol=1e-6)


def curves(values: str, kind: str = "linear", basis: str = "bspline", wrap: str = "nonperiodic", more: str = "") -> str:
    """Two curves along x, at y = 0 and y = 2, of four vertices each at x = 0, 1, 2, 3."""
    vertices = [(float(x), float(y), 0.0) for y in (0, 2) for x in range(4)]
    return f"""def BasisCurves "C"
{{
    uniform token type = "{kind}"
    uniform token basis = "{basis}"
    uniform token wrap = "{wrap}"
    int[] curveVertexCounts = [4, 4]
    point3f[] points = {vertices}
    float[] widths = [0.5]
    {values}
    {more}
}}
"""


RIBBON = 'normal3f[] normals = [(0, 0, 1)] (interpolation = "constant")'
SHAPES = pytest.mark.parametrize("more", ["", RIBBON], ids=["tubes", "ribbons"])


@SHAPES
@pytest.mark.parametrize("kind", ["linear", "cubic"])
def test_uniform_colors_belong_to_their_curves(kind, more):
    scene = load(curves(primvar([RED, BLUE], "uniform"), kind, more=more))
    second = corners(scene)[..., 1] > 1.0
    np.testing.assert_array_equal(colors_of(scene), np.where(second[..., None], BLUE, RED))


@SHAPES
@pytest.mark.parametrize("interpolation", ["vertex", "varying", "faceVarying"])
def test_colors_of_linear_curves_are_interpolated_between_their_vertices(interpolation, more):
    """Colour is (x / 3, y / 2, x^2 / 9) at the vertices."""
    at = [(x / 3, y, x * x / 9) for y in (0, 1) for x in range(4)]
    scene = load(curves(primvar(at, interpolation), more=more))
    x, y = corners(scene)[..., 0], corners(scene)[..., 1] > 1.0
    expected = np.stack([x / 3, y, np.interp(x, range(4), np.arange(4) ** 2 / 9)], axis=-1)
    np.testing.assert_allclose(colors_of(scene), expected, atol=1e-6)
    # and in the picture, where a ray meets a curve
    seen = seen_at(scene, [(0.25, 0.1), (1.5, -0.1), (2.75, 2.1)], (0.0, 0.0, -1.0))["diffuse"]
    expected = [(0.25 / 3, 0, 0.25 / 9), (0.5, 0, 2.5 / 9), (2.75 / 3, 1, 7.75 / 9)]
    np.testing.assert_allclose(seen, expected, atol=1e-5)


@pytest.mark.parametrize("basis", ["bspline", "catmullRom", "bezier"])
def test_vertex_colors_of_cubic_curves_follow_the_basis_as_points_do(basis):
    """A colour that is linear in the vertices' places is the same function of the curve's points."""
    at = [(x / 3, y, 1 - x / 3) for y in (0, 1) for x in range(4)]
    scene = load(curves(primvar(at, "vertex"), "cubic", basis))
    x, y = corners(scene)[..., 0], corners(scene)[..., 1] > 1.0
    np.testing.assert_allclose(colors_of(scene), np.stack([x / 3, y, 1 - x / 3], axis=-1), atol=1e-6)


def test_varying_colors_of_cubic_curves_go_evenly_from_one_end_of_a_segment_to_the_other():
    scene = load(curves(primvar([RED, GREEN, BLUE, RED], "varying"), "cubic", "bezier"))
    t, second = corners(scene)[..., 0] / 3, corners(scene)[..., 1] > 1.0  # evenly spaced vertices: x is 3 t
    first = np.stack([1 - t, t, 0 * t], axis=-1)
    other = np.stack([t, 0 * t, 1 - t], axis=-1)
    np.testing.assert_allclose(colors_of(scene), np.where(second[..., None], other, first), atol=1e-6)


def test_left_handed_curves_keep_their_colors():
    at = primvar([(x / 3, y, 0) for y in (0, 1) for x in range(4)], "vertex")
    scene = load(curves(at, more='uniform token orientation = "leftHanded"'))
    np.testing.assert_allclose(colors_of(scene)[..., 0], corners(scene)[..., 0] / 3, atol=1e-6)


def test_colors_of_curves_that_are_left_out_do_not_move_the_others():
    text = curves(primvar([RED, BLUE], "uniform")).replace("(0.0, 0.0, 0.0)", "(nan, 0, 0)")
    scene = load(text)
    assert mentions(scene, "/C", "1 curves left out")
    assert scene.materials[0].diffuse_color == BLUE


def shape(kind: str, more: str) -> str:
    return f'def {kind} "S"\n{{\n{more}\n}}\n'


def of_faces(count: int):
    """A colour for each of so many elements, all different."""
    number = np.arange(count)
    return np.stack([number / count, (number % 10) / 10, 0 * number], axis=1)


SIZES = {
    "Sphere": (100, 92, 380),
    "Cylinder": (30, 42, 100),
    "Cylinder_1": (30, 42, 100),
    "Cone": (20, 31, 70),
    "Capsule": (90, 82, 340),
    "Capsule_1": (90, 82, 340),
    "Cube": (6, 8, 24),
    "Plane": (1, 4, 4),
}


@pytest.mark.parametrize("kind", SIZES)
def test_implicit_shapes_take_as_many_values_as_the_meshes_that_usd_makes(kind):
    for interpolation, count in zip(("uniform", "vertex", "faceVarying"), SIZES[kind], strict=True):
        scene = load(shape(kind, primvar(of_faces(count), interpolation)))
        assert scene.warnings == ()
        # some places have the largest element's value alone, but at a cone's tip
        assert count == 1 or scene.geometry.primvars[..., 0].max() == pytest.approx((count - 1) / count, abs=0.005)
        wrong = load(shape(kind, primvar(of_faces(count + 1), interpolation)))
        assert mentions(wrong, "/S", f"{count + 1} {interpolation} values", f"{count} are needed")


def ring(radius: float, z: float):
    angle = 2 * np.pi * np.arange(10) / 10
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle + z], axis=1)


LATITUDES = (np.arange(1, 10) / 10 - 0.5) * np.pi
CAP = np.arange(1, 4) / 4 * np.pi / 2
# Points of the meshes that USD makes, as its sources place them, about Z.
CAGES = {
    "Sphere": [[[0, 0, -1]], *(ring(np.cos(t), np.sin(t)) for t in LATITUDES), [[0, 0, 1]]],
    "Cylinder": [[[0, 0, -1]], *(ring(1, z) for z in (-1, -1, 1, 1)), [[0, 0, 1]]],
    "Cone": [[[0, 0, -1]], ring(1, -1), ring(1, -1), ring(0, 1)],
    "Capsule": [[[0, 0, -1]],
                *(ring(0.5 * np.sin(t), -0.5 - 0.5 * np.cos(t)) for t in CAP), ring(0.5, -0.5),
                ring(0.5, 0.5), *(ring(0.5 * np.cos(t), 0.5 + 0.5 * np.sin(t)) for t in CAP), [[0, 0, 1]]],
    "Cube": [[[1, 1, 1], [-1, 1, 1], [-1, -1, 1], [1, -1, 1], [-1, -1, -1], [-1, 1, -1], [1, 1, -1], [1, -1, -1]]],
    "Plane": [[[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]]],
}  # fmt: skip


@pytest.mark.parametrize("hand", ["rightHanded", "leftHanded"])
@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
@pytest.mark.parametrize("kind", CAGES)
def test_vertex_colors_of_implicit_shapes_are_where_the_points_of_that_mesh_are(kind, axis, hand):
    """A colour that is the place itself comes out as the place, but for the chords between the mesh's points."""
    cage = np.concatenate(CAGES[kind])
    if kind == "Capsule":
        cage[[0, -1], 2] = -1, 1
    order = {"X": [2, 0, 1], "Y": [1, 2, 0], "Z": [0, 1, 2]}[axis]
    order = [0, 1, 2] if kind in ("Sphere", "Cube") else order
    more = f'uniform token axis = "{axis}"\n' if kind not in ("Sphere", "Cube") else ""
    more += f'uniform token orientation = "{hand}"\n'
    scene = load(shape(kind, more + primvar(0.5 + 0.5 * cage[:, order], "vertex")))
    found = 2.0 * colors_of(scene) - 1.0
    chord = {"Cube": 1e-6, "Plane": 1e-6}.get(kind, 0.06)
    np.testing.assert_allclose(found, corners(scene), atol=chord)
    # exactly so at the points themselves
    here = np.linalg.norm(corners(scene).reshape(-1, 1, 3) - cage[None][..., order], axis=2).min(axis=1) < 1e-6
    assert here.sum() >= len(cage)
    np.testing.assert_allclose(found.reshape(-1, 3)[here], corners(scene).reshape(-1, 3)[here], atol=1e-6)


def test_uniform_colors_of_a_cube_are_its_sides():
    """In the order of USD's mesh: front, back, top, bottom, right, left, looking along -Z."""
    scene = load(shape("Cube", primvar(of_faces(6), "uniform")))
    normals = np.array([[0, 0, 1], [0, 0, -1], [0, 1, 0], [0, -1, 0], [1, 0, 0], [-1, 0, 0]])
    side = (corners(scene).mean(axis=1) @ normals.T).argmax(axis=1)
    np.testing.assert_allclose(colors_of(scene), np.broadcast_to(of_faces(6)[side][:, None], (12, 3, 3)), atol=1e-6)


def test_uniform_colors_of_a_sphere_go_around_the_axis_and_upwards():
    scene = load(shape("Sphere", primvar(of_faces(100), "uniform")))
    middle = corners(scene).mean(axis=1)
    middle /= np.linalg.norm(middle, axis=1, keepdims=True)
    sector = np.floor(np.arctan2(middle[:, 1], middle[:, 0]) / (2 * np.pi) % 1.0 * 10)
    strip = np.floor((np.arcsin(middle[:, 2]) / np.pi + 0.5) * 10)
    expected = of_faces(100)[(10 * strip + sector).astype(int)]
    np.testing.assert_allclose(colors_of(scene), np.broadcast_to(expected[:, None], (len(middle), 3, 3)), atol=1e-6)


def test_face_varying_colors_of_a_cube_are_its_sides_corners():
    scene = load(shape("Cube", primvar(of_faces(24), "faceVarying")))
    faces = np.array([[0, 1, 2, 3], [4, 5, 6, 7], [0, 6, 5, 1], [4, 7, 3, 2], [0, 3, 7, 6], [4, 2, 1, 5]])
    places = np.concatenate(CAGES["Cube"])[faces.ravel()]
    value = dict(zip(map(tuple, np.column_stack([places, np.repeat(np.arange(6), 4)])), of_faces(24), strict=True))
    normals = np.array([[0, 0, 1], [0, 0, -1], [0, 1, 0], [0, -1, 0], [1, 0, 0], [-1, 0, 0]])
    side = (corners(scene).mean(axis=1) @ normals.T).argmax(axis=1)
    expected = [
        [value[(*corner, face)] for corner in triangle] for triangle, face in zip(corners(scene), side, strict=True)
    ]
    np.testing.assert_allclose(colors_of(scene), expected, atol=1e-6)


def test_a_shape_of_one_color_is_as_fine_as_before():
    plain, colored = load(shape("Sphere", primvar([RED], "vertex"))), load(shape("Sphere", ""))
    np.testing.assert_array_equal(corners(plain), corners(colored))
