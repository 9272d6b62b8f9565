"""AOVs of surfaces: ids, texture coordinates, and motion vectors against what a point does by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pxr import Usd

import warpmis

WIDTH = 48

# A textured card that slides, turns and is instanced, before a camera that stands still or moves.
STAGE = """#usda 1.0
(
    upAxis = "Y"
)
def Camera "Still" {
    float focalLength = 20
    float horizontalAperture = 20
    float verticalAperture = 20
    double3 xformOp:translate = (0, 0, 5)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Camera "Moving" (
    inherits = </Still>
) {
    double3 xformOp:translate.timeSamples = { 0: (0, 0, 5), 1: (0.5, 0, 5) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Mesh "Card" (
    prepend apiSchemas = ["MaterialBindingAPI"]
) {
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (
        interpolation = "vertex"
    )
    rel material:binding = </Painted>
    double3 xformOp:translate.timeSamples = { 0: (0, 0, 0), 1: (0.25, 0.5, 0) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Material "Painted" {
    token outputs:surface.connect = </Painted/Surface.outputs:surface>
    def Shader "Surface" {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </Painted/Texture.outputs:rgb>
        token outputs:surface
    }
    def Shader "Texture" {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @PICTURE@
        float2 inputs:st.connect = </Painted/Reader.outputs:result>
        float3 outputs:rgb
    }
    def Shader "Reader" {
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "st"
        float2 outputs:result
    }
}
def DomeLight "Sky" {
}
"""


def stage_with_picture(folder: Any) -> Usd.Stage:
    from warpmis.output.png import write_display_png

    write_display_png(folder / "picture.png", np.full((2, 2, 3), 128, np.uint8))
    stage = Usd.Stage.CreateInMemory()
    stage.GetRootLayer().ImportFromString(STAGE.replace("@PICTURE@", f"@{folder}/picture.png@"))
    return stage


@pytest.fixture(scope="module")
def still(tmp_path_factory: pytest.TempPathFactory) -> warpmis.RenderResult:
    return render(stage_with_picture(tmp_path_factory.mktemp("still")), "/Still")


def render(stage: Usd.Stage, camera: str, **settings: Any) -> warpmis.RenderResult:
    asked = ("uv", "materialId", "primId", "motion")
    settings = {"width": WIDTH, "spp": 1, "method": "nee", "time": 0.0, "aov": asked, **settings}
    return warpmis.render(stage, camera=camera, **settings)


def on_card(result: warpmis.RenderResult) -> np.ndarray:
    return result.aovs["primId"] >= 0


def test_ids_name_prims_and_materials(still: warpmis.RenderResult) -> None:
    card = on_card(still)
    assert card.any() and not card.all()
    assert {still.paths[int(index)] for index in still.aovs["primId"][card]} == {"/Card"}
    assert {still.material_paths[int(index)] for index in still.aovs["materialId"][card]} == {"/Painted"}
    assert (still.aovs["materialId"][~card] == -1).all()


def test_uv_is_that_of_the_point(still: warpmis.RenderResult) -> None:
    """At distance 5 the picture is 5 units wide, and the card 2."""
    middle = (np.arange(WIDTH) + 0.5) / WIDTH * 5.0 - 2.5
    x, y = np.meshgrid(middle, -middle)
    card = on_card(still)
    np.testing.assert_array_equal(card, (np.abs(x) < 1.0) & (np.abs(y) < 1.0))
    wanted = np.stack([(x + 1.0) / 2.0, (y + 1.0) / 2.0], axis=-1)
    np.testing.assert_allclose(still.aovs["uv"][card], wanted[card], atol=1e-5)
    assert not still.aovs["uv"][~card].any()


def test_what_moves_has_its_motion_in_pixels(still: warpmis.RenderResult) -> None:
    card = on_card(still)
    wanted = np.array([0.25, 0.5]) / 5.0 * WIDTH
    np.testing.assert_allclose(still.aovs["motion"][card], np.broadcast_to(wanted, (card.sum(), 2)), atol=1e-3)
    np.testing.assert_allclose(still.aovs["motion"][~card], 0.0, atol=1e-6)


def test_a_camera_that_moves_moves_the_picture(tmp_path: Any) -> None:
    """To the right, so that what it sees goes to the left; what is infinitely far away stays."""
    result = render(stage_with_picture(tmp_path), "/Moving")
    card = on_card(result)
    wanted = np.array([0.25 - 0.5, 0.5]) / 5.0 * WIDTH
    np.testing.assert_allclose(result.aovs["motion"][card], np.broadcast_to(wanted, (card.sum(), 2)), atol=1e-3)
    np.testing.assert_allclose(result.aovs["motion"][~card], 0.0, atol=1e-6)


def test_channels_have_their_letters(still: warpmis.RenderResult) -> None:
    assert {"uv.U", "uv.V", "motion.X", "motion.Y", "primId", "materialId"} <= set(still.channels())
