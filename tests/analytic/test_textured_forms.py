"""Textured scenes whose radiance is known in closed form: within 0.5 % unless stated."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from usd.pictures import write
from usd.stages import stage_of

import warpmis

SETTINGS = """token inputs:wrapS = "clamp"
token inputs:wrapT = "clamp"
token inputs:sourceColorSpace = "raw"
"""
LOOK_DOWN = """
def Camera "Camera" {
    float focalLength = 1
    float horizontalAperture = 0.001
    float verticalAperture = 0.001
    double3 xformOp:translate = (0, 1, 1.7320508)
    float xformOp:rotateX = -30
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]
}
"""
# A distant light of irradiance 2 from 40 degrees off the zenith, towards +x.
SUN = """
def DistantLight "Sun" {
    float inputs:angle = 0
    float inputs:intensity = 2
    bool inputs:normalize = 1
    float xformOp:rotateY = 90
    float xformOp:rotateX = -50
    uniform token[] xformOpOrder = ["xformOp:rotateY", "xformOp:rotateX"]
}
"""


def sheet(name: str, half: float, height: float, inputs: str, file: Path | None, settings: str = SETTINGS) -> str:
    """A square in the plane y = height, its front upwards, st (0, 0) at (-x, +z), s along +x, t along -z."""
    h = half
    texture = f"""def Shader "T" {{
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @{file}@
        float2 inputs:st.connect = </{name}M/R.outputs:result>
        {settings}
        float3 outputs:rgb
        float outputs:r
    }}
"""
    return f"""
def Mesh "{name}" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {{
    uniform bool doubleSided = 1
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [({-h}, {height}, {h}), ({h}, {height}, {h}), ({h}, {height}, {-h}), ({-h}, {height}, {-h})]
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] ( interpolation = "vertex" )
    rel material:binding = </{name}M>
}}
def Material "{name}M" {{
    token outputs:surface.connect = </{name}M/S.outputs:surface>
    def Shader "S" {{
        uniform token info:id = "UsdPreviewSurface"
        int inputs:useSpecularWorkflow = 1
        {inputs.replace("<T", f"</{name}M/T")}
        token outputs:surface
    }}
    {texture if file else ""}
    def Shader "R" {{
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "st"
        float2 outputs:result
    }}
}}
"""


def floor_of(color: float) -> str:
    """A Lambertian floor: displayColor, so that no Fresnel term enters."""
    return f"""
def Mesh "Floor" {{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-100, 0, 100), (100, 0, 100), (100, 0, -100), (-100, 0, -100)]
    color3f[] primvars:displayColor = [({color}, {color}, {color})]
}}
"""


def mean(text: str, spp: int = 16384, **settings) -> float:
    result = warpmis.render(stage_of('(upAxis = "Y")\n' + text), width=8, spp=spp, **settings)
    assert result.stats["rejected_samples"] == 0
    assert not result.warnings
    return float(result.image.astype(np.float64).mean())


def bilinear(texels: np.ndarray, s: np.ndarray, t: np.ndarray) -> np.ndarray:
    """A picture of one channel, row 0 on top, at texture coordinates within [0, 1], its edge texels going on."""
    rows, columns = texels.shape
    x, y = s * columns - 0.5, (1.0 - t) * rows - 0.5
    column, row = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = x - column, y - row

    def at(dy: int, dx: int) -> np.ndarray:
        return texels[np.clip(row + dy, 0, rows - 1), np.clip(column + dx, 0, columns - 1)]

    return (at(0, 0) * (1 - fx) + at(0, 1) * fx) * (1 - fy) + (at(1, 0) * (1 - fx) + at(1, 1) * fx) * fy


@pytest.mark.parametrize("method", ["nee", "balance", "bsdf"])
def test_textured_emitter_lights_with_what_its_texels_shine(tmp_path, method):
    """Irradiance under the middle of a square of half side a at height h: the integral of L h^2 / r^4 over it."""
    texels = np.array([[0.0, 0.0, 0.2], [1.0, 0.0, 0.0], [0.1, 0.0, 0.0]])
    glow = write(tmp_path / "glow.exr", np.repeat(texels[..., None], 3, axis=-1))
    settings = SETTINGS + "float4 inputs:scale = (3, 3, 3, 1)"
    inputs = "color3f inputs:emissiveColor.connect = <T.outputs:rgb>\ncolor3f inputs:diffuseColor = (0, 0, 0)"
    lamp = sheet("Lamp", 0.5, 0.5, inputs, glow, settings)
    found = mean(floor_of(0.5) + lamp + LOOK_DOWN, method=method, max_depth=1)
    s, t = np.meshgrid((np.arange(500) + 0.5) / 500, (np.arange(500) + 0.5) / 500)
    r2 = (s - 0.5) ** 2 + (t - 0.5) ** 2 + 0.25
    irradiance = (3.0 * bilinear(texels, s, t) * 0.25 / r2**2).mean()
    assert found == pytest.approx(0.5 / math.pi * irradiance, rel=0.005)


def reflected(n: np.ndarray, wi: np.ndarray, diffuse: float) -> float:
    """BSDF times cosine of a matt surface: of F0 = 0 there is no lobe."""
    return diffuse / math.pi * float(n @ wi)


@pytest.mark.parametrize("tilt", [0.0, 25.0, -25.0])
def test_normal_map_turns_the_surface_towards_the_light(tmp_path, tilt):
    sine, cosine = math.sin(math.radians(tilt)), math.cos(math.radians(tilt))
    file = write(tmp_path / "n.exr", np.broadcast_to([sine, 0.0, cosine], (2, 2, 3)))
    inputs = """normal3f inputs:normal.connect = <T.outputs:rgb>
    color3f inputs:diffuseColor = (0.5, 0.5, 0.5)
    float inputs:roughness = 1
"""
    found = mean(sheet("Q", 10, 0.0, inputs, file) + SUN + LOOK_DOWN, spp=64, method="nee", max_depth=1)
    sun = np.array([math.sin(math.radians(40.0)), math.cos(math.radians(40.0)), 0.0])
    expected = 2.0 * reflected(np.array([sine, cosine, 0.0]), sun, 0.5)
    assert found == pytest.approx(expected, rel=0.002)


@pytest.mark.parametrize("method", ["nee", "balance", "bsdf"])
def test_sheet_of_textured_opacity_dims_what_lies_below(tmp_path, method):
    """The lamp's light crosses the sheet about its middle, opacity 0.25 on average; the camera looks below it.

    The opacity grows linearly to 0.5 where the light crosses, s from 0.19 to 0.81, and is 1 beyond.
    """
    s = (np.arange(64) + 0.5) / 64
    opacity = np.broadcast_to(np.where(np.abs(s - 0.5) < 0.4, 0.5 * s, 1.0)[None, :, None], (1, 64, 3))
    file = write(tmp_path / "o.exr", opacity)
    inputs = """float inputs:opacity.connect = <T.outputs:r>
    token inputs:opacityMode = "presence"
    color3f inputs:diffuseColor = (0, 0, 0)
"""
    lamp = """
def DiskLight "Lamp" {
    float inputs:radius = 0.5
    float inputs:intensity = 100
    double3 xformOp:translate = (0, 2, 0)
    float xformOp:rotateX = -90
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]
}
"""
    found = mean(floor_of(0.5) + sheet("Q", 0.1, 0.25, inputs, file) + lamp + LOOK_DOWN, method=method, max_depth=1)
    irradiance = math.pi * 100 * 0.25 / (0.25 + 4.0)
    assert found == pytest.approx(0.5 / math.pi * irradiance * 0.75, rel=0.01)
