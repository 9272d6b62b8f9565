"""Refinement by size in the picture: no level of faces smaller than a pixel, and every level that can be seen."""

from __future__ import annotations

import numpy as np
import pytest
from usd.stages import check_invariants, corners, load, stage_of

from warpmis.usd import load_stage
from warpmis.usd.sight import Sight, worthwhile_levels

CAGE = """
    int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
    int[] faceVertexIndices = [0, 1, 3, 2, 2, 3, 5, 4, 4, 5, 7, 6, 6, 7, 1, 0, 1, 7, 5, 3, 6, 0, 2, 4]
    point3f[] points = [(-1, -1, 1), (1, -1, 1), (-1, 1, 1), (1, 1, 1),
        (-1, 1, -1), (1, 1, -1), (-1, -1, -1), (1, -1, -1)]
"""
LEVELS = {12: 0, 48: 1, 192: 2, 768: 3}  # by the triangles of the cage


def placed(name: str, kind: str, body: str, z: float, scale: float = 1.0, head: str = "") -> str:
    ops = f"double3 xformOp:translate = (0, 0, {z})\ndouble3 xformOp:scale = ({scale}, {scale}, {scale})"
    order = 'uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]'
    return f'def {kind} "{name}" {head}\n{{\n{body}\n{ops}\n{order}\n}}\n'


def camera(name: str = "Cam", more: str = "") -> str:
    """At the origin, looking along -Z; a picture 100 pixels wide shows 1 unit at distance 1."""
    return f"""def Camera "{name}"
{{
    float horizontalAperture = 10
    float verticalAperture = 10
    float focalLength = 10
    {more}
}}
"""


def levels_of(scene, name: str = "M") -> int:
    (number,) = [i for i, prim in enumerate(scene.prims) if prim.path.endswith(name)]
    return LEVELS[int((scene.geometry.prims == number).sum())]


def test_areas_say_how_many_levels_are_worthwhile():
    assert worthwhile_levels(np.full(10, 0.9), 3) == 0
    assert worthwhile_levels(np.full(10, 1.1), 3) == 1
    assert worthwhile_levels(np.full(10, 4.1), 3) == 2
    assert worthwhile_levels(np.full(10, 1e4), 3) == 3
    assert worthwhile_levels(np.full(10, np.inf), 2) == 2
    # a part of 3 % by area that would be left in facets of four pixels is refined, a smaller one is not
    assert worthwhile_levels(np.array([*[0.1] * 1300, 4.0]), 1) == 1
    assert worthwhile_levels(np.array([*[0.1] * 3000, 4.0]), 1) == 0


@pytest.mark.parametrize("orthographic", [False, True])
def test_pixels_fall_off_with_the_distance_from_a_perspective_camera_alone(orthographic):
    sight = Sight(np.array([1.0, 0.0, 0.0]), 0.01, orthographic)
    found = sight.pixels(np.array([[1.0, 0.0, -2.0], [1.0, 4.0, 0.0]]))
    np.testing.assert_allclose(found, [100, 100] if orthographic else [50, 25])


# A face of the cage is 2 units: 200 / z pixels at 100 across. A level is made whose faces are a pixel wide.
@pytest.mark.parametrize(("distance", "levels"), [(3, 2), (45, 2), (55, 1), (95, 1), (105, 0), (1000, 0)])
def test_a_level_whose_faces_are_smaller_than_a_pixel_is_not_made(distance, levels):
    scene = load(placed("M", "Mesh", CAGE, -distance) + camera(), width=100)
    check_invariants(scene)
    assert levels_of(scene) == levels
    assert scene.warnings == ()


@pytest.mark.parametrize(("complexity", "levels"), [("low", 0), ("medium", 1), ("high", 2), ("veryhigh", 3)])
def test_complexity_is_still_the_most(complexity, levels):
    scene = load(placed("M", "Mesh", CAGE, -4) + camera(), width=1000, complexity=complexity)
    assert levels_of(scene) == levels


def test_a_finer_picture_and_a_larger_mesh_are_refined_more():
    text = placed("M", "Mesh", CAGE, -150) + camera()
    assert [levels_of(load(text, width=width)) for width in (100, 200, 400)] == [0, 1, 2]
    larger = placed("M", "Mesh", CAGE, -150, 4.0) + camera()
    assert levels_of(load(larger, width=100)) == 2


def test_each_mesh_has_its_own_levels():
    scene = load(placed("Near", "Mesh", CAGE, -10) + placed("Far", "Mesh", CAGE, -500) + camera(), width=100)
    assert (levels_of(scene, "Near"), levels_of(scene, "Far")) == (2, 0)


def test_what_is_behind_the_camera_counts_by_its_distance():
    scene = load(placed("Near", "Mesh", CAGE, 10) + placed("Far", "Mesh", CAGE, 500) + camera(), width=100)
    assert (levels_of(scene, "Near"), levels_of(scene, "Far")) == (2, 0)


def test_an_orthographic_camera_refines_by_its_window():
    def level(aperture):
        sides = "\n".join(f"float {side}Aperture = {aperture}" for side in ("horizontal", "vertical"))
        more = f'token projection = "orthographic"\n{sides}'
        text = placed("M", "Mesh", CAGE, -900) + camera().replace("float horizontalAperture = 10", more).replace(
            "float verticalAperture = 10\n", "\n"
        )
        return levels_of(load(text, width=100))

    # a face of 2 units in a window of aperture / 10: 40, 3 and 1.5 pixels
    assert [level(aperture) for aperture in (50, 667, 1333)] == [2, 1, 0]


def test_each_camera_of_a_stage_gets_its_own_refinement():
    stage = stage_of(placed("M", "Mesh", CAGE, -10) + camera("Near") + placed("Rig", "Xform", camera("Distant"), 900))
    assert levels_of(load_stage(stage, camera="/Near", width=100)) == 2
    assert levels_of(load_stage(stage, camera="/Rig/Distant", width=100)) == 0


def test_products_are_refined_for_their_own_camera_and_resolution():
    product = 'def RenderProduct "{0}"\n{{\nrel camera = </Cam>\nuniform int2 resolution = ({1}, {1})\n}}\n'
    stage = stage_of(
        placed("M", "Mesh", CAGE, -150)
        + camera()
        + 'def RenderSettings "S"\n{\n}\n'
        + product.format("Small", 100)
        + product.format("Large", 800)
    )
    found = [levels_of(load_stage(stage, render_settings="/S", product=path)) for path in ("/Small", "/Large")]
    assert found == [0, 2]


def test_the_nearest_instance_says_how_often_all_are_refined():
    prototype = f'class Xform "Proto"\n{{\ndef Mesh "M"\n{{\n{CAGE}\n}}\n}}\n'
    instance = "( instanceable = true\ninherits = </Proto> )"
    far = "".join(placed(f"I{i}", "Xform", "", -800 - 10 * i, head=instance) for i in range(8))
    near = placed("Near", "Xform", "", -10, head=instance)
    assert len(load(prototype + far + camera(), width=100).geometry.triangles) == 8 * 12
    assert len(load(prototype + far + near + camera(), width=100).geometry.triangles) == 9 * 192


def test_the_nearest_place_of_a_point_instancer_counts():
    places = [(0, 0, -800 - 10 * i) for i in range(20)]
    text = f"""def PointInstancer "Many"
{{
    int[] protoIndices = [%s]
    point3f[] positions = [%s]
    rel prototypes = [</Many/M>]
    def Mesh "M"
    {{
        {CAGE}
    }}
}}
"""
    for extra, levels in (([], 0), ([(0, 0, -10)], 2)):
        points = places + extra
        filled = text % (", ".join("0" for _ in points), ", ".join(map(str, points)))
        assert len(load(filled + camera(), width=100).geometry.triangles) == len(points) * 12 * 4**levels


def grid(z_near: float, z_far: float, rows: int) -> str:
    """A strip of ground below the camera whose rows are equally long."""
    z = np.linspace(-z_near, -z_far, rows + 1)
    points = [(x, -1.0, float(row)) for row in z for x in (-5.0, 5.0)]
    indices = [i for row in range(rows) for i in (2 * row, 2 * row + 1, 2 * row + 3, 2 * row + 2)]
    return f"""def Mesh "M"
{{
    int[] faceVertexCounts = {[4] * rows}
    int[] faceVertexIndices = {indices}
    point3f[] points = {points}
}}
"""


def test_a_ground_that_begins_at_the_camera_is_refined_for_what_is_near():
    """Most of its faces are far away and small; most of what is seen of it is near."""
    scene = load(grid(1.0, 4000.0, 400) + camera(), width=100)
    assert len(scene.geometry.triangles) == 400 * 2 * 16


@pytest.mark.parametrize("body", ["float inputs:intensity = 1", ""])
def test_what_shines_is_refined_whatever_the_camera_sees(body):
    """Its area is its power."""
    glow = """def Material "Glow"
{
    token outputs:surface.connect = </Glow/S.outputs:surface>
    def Shader "S"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:emissiveColor = (1, 1, 1)
        token outputs:surface
    }
}
"""
    apis = '( prepend apiSchemas = ["MeshLightAPI"] )' if body else '( prepend apiSchemas = ["MaterialBindingAPI"] )'
    body = body or "rel material:binding = </Glow>"
    scene = load(placed("M", "Mesh", CAGE + body, -1000, head=apis) + camera() + glow, width=100)
    assert levels_of(scene) == 2


def test_without_a_camera_the_framed_size_counts():
    """The cage alone fills the picture; beside it stands one a thousandth as large."""
    scene = load(placed("Large", "Mesh", CAGE, 0) + placed("Small", "Mesh", CAGE, 0, 1e-3), width=200)
    assert (levels_of(scene, "Large"), levels_of(scene, "Small")) == (2, 0)


def test_a_scene_far_from_the_origin_is_refined_as_at_the_origin():
    text = placed("M", "Mesh", CAGE, -60) + camera()
    op = 'double3 xformOp:translate = (1000000, 0, 0)\nuniform token[] xformOpOrder = ["xformOp:translate"]'
    far = load(f'def Xform "World"\n{{\n{op}\n{text}\n}}\n', width=100)
    assert far.origin.any()
    assert levels_of(far) == levels_of(load(text, width=100)) == 1


def test_holes_of_the_border_stay_holes_where_nothing_is_refined():
    """interpolateBoundary "none": of 3 x 3 faces the middle one alone is shown, at any size."""
    points = [(x, y, 0) for y in range(4) for x in range(4)]
    indices = [i for y in range(3) for x in range(3) for i in (4 * y + x, 4 * y + x + 1, 4 * y + x + 5, 4 * y + x + 4)]
    body = f"""uniform token interpolateBoundary = "none"
    int[] faceVertexCounts = {[4] * 9}
    int[] faceVertexIndices = {indices}
    point3f[] points = {points}
"""
    for distance, triangles in ((10, 2 * 16), (1000, 2)):
        scene = load(placed("M", "Mesh", body, -distance) + camera(), width=100)
        assert len(scene.geometry.triangles) == triangles
        assert np.abs((corners(scene) + scene.origin)[..., :2] - 1.5).max() < 0.51


@pytest.mark.parametrize(("distance", "triangles"), [(10, 320), (35, 80), (1000, 20)])
def test_points_are_as_fine_as_can_be_seen(distance, triangles):
    body = "point3f[] points = [(0, 0, 0)]\nfloat[] widths = [2]"
    scene = load(placed("P", "Points", body, -distance) + camera(), width=100)
    assert len(scene.geometry.triangles) == triangles


@pytest.mark.parametrize(
    ("distance", "width", "triangles"),
    # a segment of 6 units; 8 pieces of 2 pixels are 16 long, 8 sides of one pixel 8 around
    [(10, 1.0, 2 * 8 * 8), (10, 0.15, 2 * 8 * 4), (10, 0.2, 2 * 8 * 6), (60, 0.01, 2 * 4 * 4), (200, 0.01, 2 * 2 * 4)],
)
def test_curves_have_the_pieces_and_sides_that_can_be_seen(distance, width, triangles):
    body = f"""uniform token basis = "bezier"
    int[] curveVertexCounts = [4]
    point3f[] points = [(-3, 0, 0), (-1, 0, 0), (1, 0, 0), (3, 0, 0)]
    float[] widths = [{width}] ( interpolation = "constant" )
"""
    scene = load(placed("C", "BasisCurves", body, -distance) + camera(), width=100)
    check_invariants(scene)
    assert len(scene.geometry.triangles) == triangles
    assert scene.warnings == ()


def test_a_dense_mesh_that_is_not_refined_looks_like_its_limit():
    """A torus of 96 x 48 faces, about a pixel and a half each: its outline moves by less than a tenth of a pixel."""
    around, along = np.meshgrid(2 * np.pi * np.arange(96) / 96, 2 * np.pi * np.arange(48) / 48)
    radius = 1.0 + 0.4 * np.cos(along)
    points = np.stack([radius * np.cos(around), radius * np.sin(around), 0.4 * np.sin(along)], axis=-1).reshape(-1, 3)
    row, column = np.divmod(np.arange(96 * 48), 96)
    ahead, above = (column + 1) % 96, (row + 1) % 48
    quads = np.stack([96 * row + column, 96 * row + ahead, 96 * above + ahead, 96 * above + column], axis=-1)
    body = f"""int[] faceVertexCounts = {[4] * len(quads)}
    int[] faceVertexIndices = {quads.ravel().tolist()}
    point3f[] points = {[tuple(point) for point in points.tolist()]}
"""
    text = placed("M", "Mesh", body, -5) + camera()
    coarse, fine = load(text, width=100), load(text, width=1600)
    assert len(coarse.geometry.triangles) == 2 * 96 * 48
    assert len(fine.geometry.triangles) >= 4 * 2 * 96 * 48
    directions = np.random.default_rng(0).normal(size=(200, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    reach = [(one.geometry.points @ directions.T).max(axis=0) for one in (coarse, fine)]
    pixel = 5 * 0.01
    assert np.abs(reach[0] - reach[1]).max() < 0.1 * pixel
