"""Which prim, place and face each pixel sees."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from usd.stages import load

import warpmis
import warpmis.usd.placing as placing
from warpmis.cli import main
from warpmis.output.exr import read_exr

# Seen from +Z by an orthographic camera, 4 x 2 units on 8 x 4 pixels: a square of two triangles and a quadrilateral on
# the left, two places of a cube on the right, the first one higher.
STAGE = """#usda 1.0
def Camera "Eye"
{
    token projection = "orthographic"
    float horizontalAperture = 40
    float verticalAperture = 20
    double3 xformOp:translate = (0, 0, 5)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Mesh "Mesh"
{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4, 4]
    int[] faceVertexIndices = [0, 1, 2, 3, 1, 4, 5, 2]
    point3f[] points = [(-2, -1, 0), (-1.5, -1, 0), (-1.5, 1, 0), (-2, 1, 0), (-1, -1, 0), (-1, 1, 0)]
}
def PointInstancer "I"
{
    int[] protoIndices = [0, 0]
    point3f[] positions = [(1.5, 0.5, 0), (1.5, -0.5, 0)]
    rel prototypes = [</I/Box>]
    def Cube "Box"
    {
        double size = 1
    }
}
def DomeLight "Sky"
{
}
"""
PRIM = [[0, 0, -1, -1, -1, -1, 1, 1]] * 4
PLACE = [[0, 0, -1, -1, -1, -1, 0, 0]] * 2 + [[0, 0, -1, -1, -1, -1, 1, 1]] * 2


@pytest.mark.parametrize("max_copies", [10**9, 0], ids=["flattened", "through transforms"])
def test_ids_are_those_of_the_pixels_middle(monkeypatch: pytest.MonkeyPatch, max_copies: int) -> None:
    monkeypatch.setattr(placing, "MAX_COPIES", max_copies)
    scene = load(STAGE.removeprefix("#usda 1.0\n"), width=8)
    assert scene.instance_count == (0 if max_copies else 2)
    result = warpmis.render(scene, spp=1, method="nee", ids=True)
    assert result.paths == ("/Mesh", "/I/Box")
    np.testing.assert_array_equal(result.ids[..., 0], PRIM)
    np.testing.assert_array_equal(result.ids[..., 1], PLACE)
    np.testing.assert_array_equal(result.ids[:, :2, 2], [[0, 1]] * 4)  # the mesh's faces
    faces = np.unique(result.ids[:, 6:, 2])
    assert len(faces) == 1  # the front of both cubes
    assert faces[0] >= 0


def test_render_vars_of_ids_are_channels(tmp_path: Path) -> None:
    path = tmp_path / "stage.usda"
    path.write_text(
        STAGE.replace("#usda 1.0\n", '#usda 1.0\n(\n    renderSettingsPrimPath = "/Settings"\n)\n')
        + """def RenderSettings "Settings"
{
    rel products = </Product>
    rel camera = </Eye>
    uniform int2 resolution = (8, 4)
}
def RenderProduct "Product"
{
    token productName = "ids.exr"
    rel orderedVars = [</Prims>, </instanceId>, </Faces>]
}
def RenderVar "Prims"
{
    uniform string sourceName = "primId"
}
def RenderVar "instanceId"
{
}
def RenderVar "Faces"
{
    uniform string sourceName = "elementId"
}
"""
    )
    assert main(["render", str(path), "--products", str(tmp_path), "--spp", "1", "--method", "nee", "--quiet"]) == 0
    channels, header = read_exr(tmp_path / "ids.exr")
    assert set(channels) == {"Prims", "instanceId", "Faces"}
    np.testing.assert_array_equal(channels["Prims"], PRIM)
    np.testing.assert_array_equal(channels["instanceId"], PLACE)
    assert header["paths"].split() == ["/Mesh", "/I/Box"]


def test_nothing_is_told_unasked() -> None:
    result = warpmis.render(load(STAGE.removeprefix("#usda 1.0\n"), width=8), spp=1, method="nee")
    assert result.ids is None
    assert "primId" not in result.channels()
