"""Subdivision surfaces as UsdGeomMesh authors them."""

from __future__ import annotations

import numpy as np
import pytest
from usd.stages import check_invariants, corners, load, mentions, shading_normals, vector_areas, volume

from warpmis.errors import ConfigError
from warpmis.usd.shapes import refined_mesh

COUNTS = {"quads": [4] * 6, "triangles": [3] * 12}
QUADS = [0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5]
TRIANGLES = np.array(QUADS).reshape(6, 4)[:, [0, 1, 2, 0, 2, 3]].reshape(-1).tolist()
POINTS = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1), (1, 1, 1)]
CREASED_TOP = """
    int[] creaseIndices = [4, 5, 7, 6, 4]
    int[] creaseLengths = [5]
    float[] creaseSharpnesses = [10]
"""


def cube(more: str = "", scheme: str = "catmullClark", faces: str = "quads", inside: str = "") -> str:
    return f"""def Mesh "M"
{{
    uniform token subdivisionScheme = "{scheme}"
    int[] faceVertexCounts = {COUNTS[faces]}
    int[] faceVertexIndices = {QUADS if faces == "quads" else TRIANGLES}
    point3f[] points = {POINTS}
    {more}
    {inside}
}}
"""


def square_grid(more: str) -> str:
    """3 x 3 quads on the points (x, y, 0), x, y = 0..3."""
    i = np.arange(16).reshape(4, 4)
    quads = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1]], axis=-1)
    return f"""def Mesh "M"
{{
    int[] faceVertexCounts = {[4] * 9}
    int[] faceVertexIndices = {quads.reshape(-1).tolist()}
    point3f[] points = {[(k % 4, k // 4, 0) for k in range(16)]}
    {more}
}}
"""


@pytest.mark.parametrize(("complexity", "triangles"), [("low", 12), ("medium", 48), ("high", 192), ("veryhigh", 768)])
def test_complexity_says_how_often_to_refine(complexity, triangles):
    scene = load(cube(), complexity=complexity)
    check_invariants(scene)
    assert len(scene.geometry.triangles) == triangles
    assert scene.warnings == ()
    if complexity != "low":
        assert np.linalg.norm(corners(scene) - 0.5, axis=-1).max() == pytest.approx(0.25 * np.sqrt(3))


def test_high_is_the_default_and_another_word_an_error():
    assert len(load(cube()).geometry.triangles) == 192
    with pytest.raises(ConfigError, match="choose from low, medium, high, veryhigh"):
        load(cube(), complexity="ultra")


@pytest.mark.parametrize("orientation", ["rightHanded", "leftHanded"])
def test_fronts_and_normals_follow_the_orientation(orientation):
    scene = load(cube(f'uniform token orientation = "{orientation}"'))
    check_invariants(scene)
    side = 1 if orientation == "rightHanded" else -1
    assert side * volume(scene) > 0.2
    outwards = (corners(scene) - 0.5) / np.linalg.norm(corners(scene) - 0.5, axis=-1, keepdims=True)
    assert (side * np.einsum("fci,fci->fc", shading_normals(scene), outwards)).min() > 0.97  # the blob is nearly round


def test_creases_and_corners_are_read():
    creased = corners(load(cube(CREASED_TOP)))
    assert creased[..., 2].max() == pytest.approx(1.0)
    top = creased[np.isclose(creased[..., 2], 1.0)]
    assert np.abs(top[:, :2] - 0.5).max() == pytest.approx(0.5 - 1 / 24, abs=1e-6)  # (1, 23, 23, 1) / 48
    cornered = corners(load(cube("int[] cornerIndices = [7]\n float[] cornerSharpnesses = [20]")))
    assert cornered.max(axis=(0, 1)) == pytest.approx([1, 1, 1])


def test_sharpness_may_be_given_for_every_edge_of_a_crease():
    text = CREASED_TOP.replace("[10]", "[10, 0, 10, 0]")
    scene = load(cube(text), complexity="medium")
    twice = load(
        cube(
            "int[] creaseIndices = [4, 5, 7, 6]\n int[] creaseLengths = [2, 2]\n float[] creaseSharpnesses = [10, 10]"
        ),
        complexity="medium",
    )
    np.testing.assert_array_equal(scene.geometry.points, twice.geometry.points)


BORDERS = {
    # the smallest and largest x and the area of what is left
    "edgeAndCorner": (0.0, 9.0, 0.0),
    "edgeOnly": (0.0, None, 1 / 6),
    "none": (1.0, 1.0, None),
}


@pytest.mark.parametrize("boundary", BORDERS)
def test_interpolate_boundary(boundary):
    lowest, area, corner = BORDERS[boundary]
    scene = load(square_grid(f'token interpolateBoundary = "{boundary}"'))
    points = corners(scene)[..., :2]
    assert points.min() == pytest.approx(lowest)
    if area is not None:
        assert vector_areas(scene)[:, 2].sum() == pytest.approx(area)
    if corner is not None:
        nearest = points.reshape(-1, 2)[np.argmin(points.sum(axis=-1))]
        np.testing.assert_allclose(nearest, corner, atol=1e-6)


def test_holes_are_not_shown_but_shape_the_surface():
    whole, holed = load(cube()), load(cube("int[] holeIndices = [1]"))
    assert len(holed.geometry.triangles) == 192 - 32
    assert {tuple(p) for p in corners(holed).reshape(-1, 3)} <= {tuple(p) for p in corners(whole).reshape(-1, 3)}
    assert corners(holed)[..., 2].mean(axis=1).max() < corners(whole)[..., 2].mean(axis=1).max()


@pytest.mark.parametrize("broken", [0, 3])
def test_subsets_follow_their_faces(broken):
    """The top is face 1, after as many faces as are broken."""
    inside = f"""
    def GeomSubset "top"
    {{
        uniform token familyName = "materialBind"
        int[] indices = [{1 + broken}]
        rel material:binding = </Red>
    }}
"""
    material = """
def Material "Red"
{
    token outputs:surface.connect = </Red/S.outputs:surface>
    def Shader "S"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (1, 0, 0)
        token outputs:surface
    }
}
"""
    text = cube(inside=inside).replace(f"{COUNTS['quads']}", f"{[2] * broken + COUNTS['quads']}")
    scene = load(text.replace(f"{QUADS}", f"{[0, 1] * broken + QUADS}") + material)
    red = np.array([scene.materials[index].path == "/Red" for index in scene.geometry.materials])
    assert red.sum() == 32
    # the middle of a triangle on the top lies nearest to the top of the cube's six sides
    middle = corners(scene).mean(axis=1) - 0.5
    np.testing.assert_array_equal(red, np.argmax(np.concatenate([middle, -middle], axis=1), axis=1) == 2)


def test_broken_faces_are_left_out_before_refinement():
    text = (
        cube()
        .replace(f"{COUNTS['quads']}", f"{[*COUNTS['quads'], 4, 2]}")
        .replace(f"{QUADS}", f"{[*QUADS, 0, 1, 2, 99, 0, 1]}")
    )
    scene = load(text)
    assert mentions(scene, "/M", "1 faces left out")
    np.testing.assert_array_equal(scene.geometry.points, load(cube()).geometry.points)


def test_loop_refines_triangles_alone():
    scene = load(cube(scheme="loop", faces="triangles"))
    check_invariants(scene)
    assert len(scene.geometry.triangles) == 12 * 16
    assert scene.warnings == ()
    quads = load(cube(scheme="loop"))
    assert len(quads.geometry.triangles) == 12
    assert mentions(quads, "/M", "loop", "triangles")


def test_unknown_scheme_is_the_default_one_with_a_warning():
    scene = load(cube(scheme="doo"))
    assert len(scene.geometry.triangles) == 192
    assert mentions(scene, "/M", "subdivisionScheme doo is not known")


def test_bilinear_keeps_the_shape_and_is_flat():
    scene = load(cube(scheme="bilinear"))
    assert len(scene.geometry.triangles) == 192
    assert volume(scene) == pytest.approx(1.0)
    assert (scene.geometry.normal_indices == -1).all()


def test_bilinear_bends_a_quad_that_is_not_plane():
    text = """def Mesh "M"
{
    uniform token subdivisionScheme = "bilinear"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 1), (0, 1, 0)]
}
"""
    points = corners(load(text)).reshape(-1, 3)
    np.testing.assert_allclose(points[:, 2], points[:, 0] * points[:, 1], atol=1e-7)


def test_a_mesh_is_refined_less_where_it_would_have_too_many_faces(monkeypatch):
    monkeypatch.setattr(refined_mesh, "MAX_FACES", 100)
    scene = load(cube(), complexity="veryhigh")
    assert len(scene.geometry.triangles) == 192
    assert mentions(scene, "/M", "refined 2 times, not 3", "100")
    monkeypatch.setattr(refined_mesh, "MAX_FACES", 10)
    assert mentions(load(cube()), "/M", "refined not at all")


BROKEN = {
    "crease counts": ("int[] creaseIndices = [0, 1]\n int[] creaseLengths = [3]\n float[] creaseSharpnesses = [1]",
                      ("creases left out", "disagree")),
    "sharpness counts": ("int[] creaseIndices = [0, 1]\n int[] creaseLengths = [2]\n float[] creaseSharpnesses = []",
                         ("creases left out", "disagree")),
    "no such edge": ("int[] creaseIndices = [0, 7]\n int[] creaseLengths = [2]\n float[] creaseSharpnesses = [1]",
                     ("1 creases left out", "no such edges")),
    "no such point": ("int[] creaseIndices = [0, -8]\n int[] creaseLengths = [2]\n float[] creaseSharpnesses = [1]",
                      ("1 creases left out", "no such edges")),
    "corner counts": ("int[] cornerIndices = [0, 1]\n float[] cornerSharpnesses = [1]", ("corners left out", "2")),
    "corner index": ("int[] cornerIndices = [8]\n float[] cornerSharpnesses = [1]", ("1 corners left out", "8 points")),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_broken_sharpness_is_left_out_with_one_warning(case):
    text, words = BROKEN[case]
    scene = load(cube(text))
    assert mentions(scene, "/M", *words), scene.warnings
    assert len(scene.warnings) == 1
    np.testing.assert_array_equal(scene.geometry.points, load(cube()).geometry.points)


def test_sharpness_that_is_no_number_is_none():
    scene = load(cube("int[] cornerIndices = [0, 1]\n float[] cornerSharpnesses = [nan, -2]"))
    np.testing.assert_array_equal(scene.geometry.points, load(cube()).geometry.points)
