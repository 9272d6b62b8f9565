"""Multipliers, linking, shadows that are turned off, and lights made of geometry, from USD text to pixel."""

from __future__ import annotations

import math

import numpy as np
import pytest
from analytic.test_light_controls import STAGE, irradiance, light
from pxr import Usd

import warpmis

METHODS = pytest.mark.parametrize("method", ["nee", "balance", "bsdf"])
DISK = "float inputs:radius = 2\nfloat inputs:intensity = 4"
# pi L r^2 / (r^2 + h^2), the disk at height 1.5
OF_DISK = math.pi * 4.0 * 4.0 / (4.0 + 1.5**2)
SHADE = """def Mesh "Shade" {
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-50, 1.2, 50), (50, 1.2, 50), (50, 1.2, -50), (-50, 1.2, -50)]
}
"""
SHADOW = 'prepend apiSchemas = ["ShadowAPI"]'


def disk(more: str = "", head: str = "") -> str:
    return light("DiskLight", f"{DISK}\n{more}", (0, 1.5, 0), head=head)


@METHODS
def test_diffuse_multiplier_scales_what_a_lambertian_sends_on(method: str) -> None:
    for value in (0.0, 2.5):
        found = irradiance(disk(f"float inputs:diffuse = {value}\nfloat inputs:specular = 7"), method, spp=8192)
        np.testing.assert_allclose(found, value * OF_DISK, rtol=0.005, atol=1e-7)


MATERIAL = """def Material "M" {
    token outputs:surface.connect = </M/S.outputs:surface>
    def Shader "S" {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (0.8, 0.4, 0.2)
        float inputs:roughness = 0.4
        float inputs:clearcoat = 0.5
        float inputs:clearcoatRoughness = 0.3
        token outputs:surface
    }
}
"""
BOUND_STAGE = STAGE.replace(
    '"Floor" {', '"Floor" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {\nrel material:binding = </M>'
)


@pytest.mark.parametrize("method", ["nee", "balance"])
def test_diffuse_and_specular_parts_add_up_to_the_whole(method: str) -> None:
    """The paths are the same, so the parts of each sample are."""
    whole, diffuse, specular, both = (
        irradiance(disk(f"float inputs:diffuse = {d}\nfloat inputs:specular = {s}") + MATERIAL, method, 64, BOUND_STAGE)
        for d, s in ((1, 1.0001), (1, 0), (0, 1), (3, 2))
    )
    assert (diffuse > 0.05 * whole).all()
    assert (specular > 0.05 * whole).all()
    np.testing.assert_allclose(diffuse + specular, whole, rtol=2e-4)
    np.testing.assert_allclose(3 * diffuse + 2 * specular, both, rtol=1e-4)


# A prim for a collection to name, with nothing to see.
OTHER = 'def Scope "Other" {}\n'


def linked(collection: str, members: str) -> str:
    return disk(
        f"uniform bool collection:{collection}:includeRoot = 0\nrel collection:{collection}:includes = {members}"
    )


@pytest.mark.parametrize("method", ["nee", "balance"])
def test_a_linked_light_reaches_its_collection_alone(method: str) -> None:
    """Two lights, of which the second is the half of the first: each alone, both, none."""
    weak = light("DiskLight", "float inputs:radius = 2\nfloat inputs:intensity = 2", (0, 1.5, 0), head="")
    weak = weak.replace('"Light"', '"Weak"') + OTHER
    assert irradiance(linked("lightLink", "</Other>") + OTHER, method, spp=256).max() == 0.0
    for members, share in (("</Floor>", 1.5), ("</Other>", 0.5)):
        found = irradiance(linked("lightLink", members) + weak, method, spp=16384)
        np.testing.assert_allclose(found, share * OF_DISK, rtol=0.005)


@METHODS
@pytest.mark.parametrize(
    "shadowless",
    [disk("bool inputs:shadow:enable = 0", SHADOW), disk("rel collection:shadowLink:excludes = </Shade>")],
    ids=["shadow:enable", "shadowLink"],
)
def test_a_light_shines_through_what_casts_no_shadow_from_it(method: str, shadowless: str) -> None:
    assert irradiance(disk() + SHADE, method, spp=256).max() == 0.0
    found = irradiance(shadowless + SHADE, method, spp=8192)
    np.testing.assert_allclose(found, OF_DISK, rtol=0.005)


def test_what_else_casts_a_shadow_still_does() -> None:
    blind = SHADE.replace('"Shade"', '"Blind"').replace("1.2,", "1.3,")
    text = disk("rel collection:shadowLink:excludes = </Shade>") + SHADE + blind
    assert irradiance(text, spp=256).max() == 0.0


def test_points_and_domes_shine_through_too() -> None:
    point = "bool treatAsPoint = 1\nbool inputs:normalize = 1\nfloat inputs:intensity = 8\n"
    off = "bool inputs:shadow:enable = 0"
    found = irradiance(light("SphereLight", point + off, (0, 2, 0), head=SHADOW) + SHADE, spp=16)
    np.testing.assert_allclose(found, 2.0 / 4.0, rtol=1e-4)
    dome = light("DomeLight", f"float inputs:intensity = 2\n{off}", (0, 0, 0), head=SHADOW) + SHADE
    np.testing.assert_allclose(irradiance(dome, "balance", spp=256), 2.0 * math.pi, rtol=0.005)


# A horizontal square of side 2 at height 1.5 that faces down.
SQUARE = """def Mesh "Light" ( prepend apiSchemas = [%s] ) {
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-1, 1.5, -1), (1, 1.5, -1), (1, 1.5, 1), (-1, 1.5, 1)]
    float inputs:intensity = 3
    %s
}
"""
GLOW = """def Material "M" {
    token outputs:surface.connect = </M/S.outputs:surface>
    def Shader "S" {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:emissiveColor = (1, 0.5, 2)
        token outputs:surface
    }
}
"""


def of_square() -> float:
    """The form factor's integral over the square, for radiance 1."""
    x, z = np.meshgrid((np.arange(400) + 0.5) / 200 - 1.0, (np.arange(400) + 0.5) / 200 - 1.0)
    return float((1.5**2 / (x**2 + 1.5**2 + z**2) ** 2).sum() / 200.0**2)


@pytest.mark.parametrize("method", ["nee", "balance"])
def test_a_mesh_light_shines_in_its_own_color(method: str) -> None:
    for more, radiance in (("", 3.0), ("bool inputs:normalize = 1", 0.75)):
        found = irradiance(SQUARE % ('"LightAPI"', more), method)
        np.testing.assert_allclose(found, radiance * of_square(), rtol=0.005)


def test_the_glow_of_a_mesh_light_tints_its_light_and_is_what_the_camera_sees() -> None:
    more = "color3f inputs:color = (1, 1, 0.5)\nrel material:binding = </M>"
    text = SQUARE % ('"MeshLightAPI", "MaterialBindingAPI"', more) + GLOW
    np.testing.assert_allclose(irradiance(text), np.array([3, 1.5, 3]) * of_square(), rtol=0.005)
    stage = Usd.Stage.CreateInMemory()
    # The camera looks up.
    stage.GetRootLayer().ImportFromString(
        STAGE.replace("rotateX = -45", "rotateX = 135").replace("1, 1)", "1, 0)") + text
    )
    np.testing.assert_allclose(
        warpmis.render(stage, width=2, spp=2, method="nee", max_depth=0).image[0, 0], [1, 0.5, 2], rtol=1e-5
    )


def test_a_light_on_a_linked_mesh() -> None:
    more = "rel collection:lightLink:excludes = </Floor>"
    assert irradiance(SQUARE % ('"LightAPI"', more), spp=64).max() == 0.0


@METHODS
def test_what_casts_a_shadow_in_part_is_counted_once(method: str) -> None:
    """Behind a sheet that casts no shadow a half transparent one does: rays go through both, the light comes once."""
    sheet = SHADE.replace('"Shade"', '"Sheet"').replace("1.2,", "1.3,")
    sheet = sheet.replace("\n}", "\nfloat[] primvars:displayOpacity = [0.5]\n}")
    text = disk("rel collection:shadowLink:excludes = </Shade>") + SHADE + sheet
    np.testing.assert_allclose(irradiance(text, method, spp=8192), 0.5 * OF_DISK, rtol=0.005)
    below = sheet.replace("1.3,", "1.1,")  # now a ray goes through the sheet first
    text = disk("rel collection:shadowLink:excludes = </Shade>") + SHADE + below
    np.testing.assert_allclose(irradiance(text, method, spp=8192), 0.5 * OF_DISK, rtol=0.005)


MIRROR = """def Material "M" {
    token outputs:surface.connect = </M/S.outputs:surface>
    def Shader "S" {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (1, 1, 1)
        float inputs:metallic = 1
        float inputs:roughness = 0
        token outputs:surface
    }
}
"""


def test_a_mirror_shows_what_it_is_linked_to_times_the_specular_multiplier() -> None:
    size = "float inputs:radius = 0.5\nfloat inputs:intensity = 4\n"
    for more, radiance in (
        ("float inputs:specular = 0.25\nfloat inputs:diffuse = 0", 1.0),
        ("rel collection:lightLink:excludes = </Floor>", 0.0),
    ):
        ball = light("SphereLight", size + more, (0, 1, -1), head="")
        found = irradiance(ball + MIRROR, "nee", 16, BOUND_STAGE) * 0.5 / math.pi
        np.testing.assert_allclose(found, radiance, rtol=1e-4, atol=1e-7)
