"""Omniverse's materials, which stages name and whose MDL files are not at hand: what their inputs become."""

from __future__ import annotations

import numpy as np
import pytest
from usd.pictures import write
from usd.points import seen_at
from usd.stages import load, mentions

from warpmis.scene import Material, Scene


def stage(name: str, inputs: str = "") -> Scene:
    """A unit square with st = (x, y) and an MDL material alone, as Omniverse writes it."""
    return load(f"""def Mesh "Q" ( prepend apiSchemas = ["MaterialBindingAPI"] )
{{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] ( interpolation = "vertex" )
    rel material:binding = </M>
}}
def Material "M"
{{
    token outputs:mdl:surface.connect = </M/S.outputs:out>
    def Shader "S"
    {{
        uniform token info:implementationSource = "sourceAsset"
        uniform asset info:mdl:sourceAsset = @{name}.mdl@
        uniform token info:mdl:sourceAsset:subIdentifier = "{name}"
        {inputs}
        token outputs:out
    }}
}}
""")


def the(scene: Scene) -> Material:
    assert scene.warnings == ()
    (material,) = scene.materials
    return material


def test_omnipbr_of_constants() -> None:
    material = the(
        stage(
            "OmniPBR",
            """color3f inputs:diffuse_color_constant = (0.5, 0.25, 0.75)
            color3f inputs:diffuse_tint = (0.5, 1, 1)
            float inputs:albedo_brightness = 1.2
            float inputs:albedo_add = 0.1
            float inputs:reflection_roughness_constant = 0.375
            float inputs:metallic_constant = 0.25
            float inputs:specular_level = 0.5
            bool inputs:enable_emission = 1
            color3f inputs:emissive_color = (1, 0.5, 0)
            float inputs:emissive_intensity = 8""",
        )
    )
    np.testing.assert_allclose(material.diffuse_color, (0.35, 0.4, 1.0), rtol=1e-6)
    assert material.roughness == 0.375 and material.metallic == 0.25
    np.testing.assert_allclose(material.emissive_color, (8.0, 4.0, 0.0), rtol=1e-6)
    assert ((1 - material.ior) / (1 + material.ior)) ** 2 == pytest.approx(0.04)
    assert material.opacity == 1.0


def test_omnipbr_as_it_comes() -> None:
    material = the(stage("OmniPBR"))
    np.testing.assert_allclose(material.diffuse_color, 0.2, rtol=1e-6)
    assert (material.roughness, material.metallic, material.clearcoat, material.emissive_color) == (
        0.5,
        0,
        0,
        (0, 0, 0),
    )


def test_pictures_tint_and_influence(tmp_path) -> None:
    color = write(tmp_path / "color.exr", np.broadcast_to(np.array([0.5, 0.25, 0.125], np.float32), (2, 2, 3)).copy())
    orm = write(tmp_path / "orm.exr", np.broadcast_to(np.array([0.0, 0.75, 0.5], np.float32), (2, 2, 3)).copy())
    scene = stage(
        "OmniPBR",
        f"""asset inputs:diffuse_texture = @{color}@
        color3f inputs:diffuse_tint = (1, 0.5, 1)
        asset inputs:ORM_texture = @{orm}@
        bool inputs:enable_ORM_texture = 1
        float inputs:reflection_roughness_constant = 0.25
        float inputs:reflection_roughness_texture_influence = 0.5
        float inputs:metallic_texture_influence = 1""",
    )
    assert scene.warnings == ()
    seen = seen_at(scene, [(0.5, 0.5)])
    metal = 0.5
    np.testing.assert_allclose(seen["diffuse"][0], np.array([0.5, 0.125, 0.125]) * (1 - metal), rtol=1e-3)
    np.testing.assert_allclose(seen["alpha"][0], (0.5 * 0.25 + 0.5 * 0.75) ** 2, rtol=1e-3)


def test_coordinates_are_scaled_and_moved(tmp_path) -> None:
    left_dark = np.zeros((1, 2, 3), np.float32)
    left_dark[0, 1] = 0.5
    file = write(tmp_path / "halves.exr", left_dark)
    scene = stage(
        "OmniPBR",
        f"""asset inputs:diffuse_texture = @{file}@
        float2 inputs:texture_scale = (1, 1)
        float2 inputs:texture_translate = (0.5, 0)""",
    )
    seen = seen_at(scene, [(0.25, 0.5), (0.75, 0.5)])["diffuse"]
    np.testing.assert_allclose(seen[:, 0], [0.5, 0.0], atol=1e-3)


def test_opacity_and_coat() -> None:
    material = the(
        stage(
            "OmniPBR_ClearCoat",
            """bool inputs:enable_opacity = 1
            float inputs:opacity_constant = 0.25
            float inputs:clearcoat_weight = 0.5
            float inputs:clearcoat_reflection_roughness = 0.125""",
        )
    )
    assert (material.opacity, material.opacity_mode) == (0.25, "presence")
    assert (material.clearcoat, material.clearcoat_roughness) == (0.5, 0.125)
    assert the(stage("OmniPBR", "float inputs:opacity_constant = 0.25")).opacity == 1.0  # not asked for


def test_omniglass() -> None:
    material = the(
        stage(
            "OmniGlass",
            """color3f inputs:glass_color = (0.5, 1, 0.75)
            float inputs:glass_ior = 1.25
            float inputs:frosting_roughness = 0.5
            bool inputs:thin_walled = 1""",
        )
    )
    assert (material.transmission, material.ior, material.roughness) == (1.0, 1.25, 0.5)
    assert material.thin_walled and material.transmission_color == (0.5, 1.0, 0.75)


def test_what_is_left_out_is_one_warning() -> None:
    scene = stage("OmniPBR", "bool inputs:project_uvw = 1\nasset inputs:ao_texture = @a.png@")
    assert mentions(scene, "/M", "project_uvw", "ao_texture")
    assert len(scene.warnings) == 1


def test_another_mdl_material_is_named() -> None:
    assert mentions(stage("Carpaint_Midnight"), "/M", "Carpaint_Midnight", "not supported")


def test_wrong_types_are_warned_of() -> None:
    scene = stage("OmniPBR", 'string inputs:diffuse_texture = "a.png"\ntoken inputs:metallic_constant = "much"')
    assert len(scene.warnings) >= 1
    assert scene.materials[0].metallic == 0.0
