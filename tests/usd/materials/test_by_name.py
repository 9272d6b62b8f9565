"""Surfaces of other renderers by the names of their inputs, each beside the same material in MaterialX or in the
specification's own terms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from usd.networks import node, square, the
from usd.pictures import write
from usd.points import seen_at
from usd.stages import load, mentions

from warpmis.scene import Scene

STANDARD = """float inputs:base = 0.5
    color3f inputs:base_color = (0.5, 0.25, 1)
    float inputs:metalness = 0.25
    float inputs:specular_roughness = 0.375
    float inputs:coat = 0.75
    float inputs:coat_roughness = 0.125
    float inputs:emission = 4
    color3f inputs:emission_color = (1, 0.5, 0)
    color3f inputs:opacity = (0.5, 0.5, 0.5)
    """
GLASS = """float inputs:transmission = 1
    color3f inputs:transmission_color = (0.5, 1, 0.75)
    float inputs:transmission_depth = 2
    float inputs:specular_IOR = 1.25
    """


def omni(name: str, inputs: str = "") -> Scene:
    head = f"""uniform token info:implementationSource = "sourceAsset"
    uniform asset info:mdl:sourceAsset = @OmniSurface.mdl@
    uniform token info:mdl:sourceAsset:subIdentifier = "{name}" """
    return square(head, inputs, context="mdl")


def f0(scene: Scene) -> np.ndarray:
    """The reflectance at normal incidence."""
    return seen_at(scene, [(0.5, 0.5)])["specular_f0"][0]


@pytest.mark.parametrize("inputs", ["", STANDARD, GLASS])
@pytest.mark.parametrize("name", ["arnold:standard_surface", "standard_surface"])
def test_arnold_has_the_inputs_of_materialx(name: str, inputs: str) -> None:
    expected = the(square("ND_standard_surface_surfaceshader", inputs))
    assert the(square(name, inputs, context="arnold")) == expected
    assert the(square(name, inputs, context="")) == expected


def test_omni_surface_of_constants_is_standard_surface() -> None:
    found = omni(
        "OmniSurface",
        """float inputs:diffuse_reflection_weight = 0.5
        color3f inputs:diffuse_reflection_color = (0.5, 0.25, 1)
        float inputs:metalness = 0.25
        float inputs:specular_reflection_roughness = 0.375
        float inputs:coat_weight = 0.75
        float inputs:coat_roughness = 0.125
        float inputs:emission_weight = 1
        int inputs:emission_mode = 1
        float inputs:emission_intensity = 4
        color3f inputs:emission_color = (1, 0.5, 0)
        bool inputs:enable_opacity = 1
        float inputs:geometry_opacity = 0.5""",
    )
    assert the(found) == the(square("ND_standard_surface_surfaceshader", STANDARD))


@pytest.mark.parametrize("name", ["OmniSurface", "OmniSurfaceLite", "OmniSurfaceBase", "OmniSurfaceLiteBase"])
def test_omni_surface_as_it_comes(name: str) -> None:
    material = the(omni(name))
    assert material.diffuse_color == (0.8, 0.8, 0.8)
    assert (material.roughness, material.metallic, material.emissive_color) == (0.2, 0.0, (0.0, 0.0, 0.0))
    assert the(omni(name, "float inputs:geometry_opacity = 0.5")).opacity == 1.0  # not asked for
    assert the(omni(name, "float inputs:specular_transmission_weight = 1")).transmission == 0.0


def test_omni_surface_refracts_and_glows_in_lux() -> None:
    material = the(
        omni(
            "OmniSurface",
            """bool inputs:enable_specular_transmission = 1
            float inputs:specular_transmission_weight = 1
            color3f inputs:specular_transmission_color = (0.5, 1, 0.75)
            float inputs:specular_reflection_ior = 1.25
            float inputs:emission_weight = 0.5
            float inputs:emission_intensity = 10""",
        )
    )
    assert (material.transmission, material.ior, material.transmission_color) == (1.0, 1.25, (0.5, 1.0, 0.75))
    # A Lambertian emitter of M lux has a radiance of M / pi.
    np.testing.assert_allclose(material.emissive_color, 0.5 * 10 / np.pi)


def test_omni_surface_pictures_go_before_constants(tmp_path) -> None:
    color = write(tmp_path / "color.exr", np.broadcast_to(np.array([0.5, 0.25, 0.125], np.float32), (2, 2, 3)).copy())
    grey = write(tmp_path / "grey.exr", np.full((2, 2, 1), 0.5, np.float32))
    scene = omni(
        "OmniSurface",
        f"""asset inputs:diffuse_reflection_color_image = @{color}@
        asset inputs:specular_reflection_roughness_image = @{grey}@
        asset inputs:metalness_image = @{grey}@""",
    )
    assert scene.warnings == ()
    seen = seen_at(scene, [(0.5, 0.5)])
    np.testing.assert_allclose(seen["diffuse"][0], 0.5 * 0.8 * np.array([0.5, 0.25, 0.125]), rtol=1e-5)
    np.testing.assert_allclose(seen["specular_f0"][0], 0.5 * (0.04 + 0.8 * np.array([0.5, 0.25, 0.125])), rtol=1e-5)
    np.testing.assert_allclose(seen["alpha"], 0.25, rtol=1e-5)


def test_pxr_surface_of_constants_is_a_specular_workflow() -> None:
    pxr = """float inputs:diffuseGain = 0.5
        color3f inputs:diffuseColor = (0.5, 0.25, 1)
        color3f inputs:specularFaceColor = (0.25, 0.5, 0.125)
        color3f inputs:specularEdgeColor = (1, 1, 1)
        float inputs:specularRoughness = 0.375
        color3f inputs:clearcoatFaceColor = (0.04, 0.04, 0.04)
        color3f inputs:clearcoatEdgeColor = (1, 1, 1)
        float inputs:clearcoatRoughness = 0.125
        float inputs:glowGain = 4
        color3f inputs:glowColor = (1, 0.5, 0)
        float inputs:presence = 0.5"""
    preview = """color3f inputs:diffuseColor = (0.25, 0.125, 0.5)
        int inputs:useSpecularWorkflow = 1
        color3f inputs:specularColor = (0.25, 0.5, 0.125)
        float inputs:roughness = 0.375
        float inputs:clearcoat = 1
        float inputs:clearcoatRoughness = 0.125
        color3f inputs:emissiveColor = (4, 2, 0)
        float inputs:opacity = 0.5
        token inputs:opacityMode = "presence" """
    found, expected = (
        the(square("PxrSurface", pxr, context="ri")),
        the(square("UsdPreviewSurface", preview, context="")),
    )
    assert found.specular_color == pytest.approx(expected.specular_color)
    assert found.ior == pytest.approx(expected.ior)
    assert replace(found, specular_color=expected.specular_color, ior=expected.ior) == expected


def test_pxr_surface_as_it_comes_is_diffuse_alone() -> None:
    scene = square("PxrSurface", context="ri")
    assert the(scene).diffuse_color == (0.18, 0.18, 0.18)
    np.testing.assert_allclose(f0(scene), 0.0, atol=1e-7)


def test_pxr_surface_reflects_by_fresnels_formula_in_physical_mode() -> None:
    scene = square(
        "PxrSurface",
        """int inputs:specularFresnelMode = 1
        color3f inputs:specularEdgeColor = (1, 1, 0.5)
        color3f inputs:specularIor = (0.2, 1.5, 1.5)
        color3f inputs:specularExtinctionCoeff = (3.9, 0, 0)""",
        context="ri",
    )
    assert scene.warnings == ()
    np.testing.assert_allclose(f0(scene), [(0.8**2 + 3.9**2) / (1.2**2 + 3.9**2), 0.04, 0.02], rtol=1e-5)


def test_pxr_surface_glass_and_what_is_left_out() -> None:
    scene = square(
        "PxrSurface",
        """float inputs:refractionGain = 1
        color3f inputs:refractionColor = (0.5, 1, 0.75)
        float inputs:glassIor = 1.25
        float inputs:glassRoughness = 0.5
        float inputs:subsurfaceGain = 0.5
        float inputs:fuzzGain = 0.5""",
        context="ri",
    )
    (material,) = scene.materials
    assert (material.transmission, material.ior, material.roughness) == (1.0, 1.25, 0.5)
    assert material.transmission_color == (0.5, 1.0, 0.75)
    assert len(scene.warnings) == 1 and mentions(scene, "/M", "fuzzGain", "subsurfaceGain", "PxrSurface")


@pytest.mark.parametrize("name", ["PxrDisney", "PxrDisneyBsdf"])
def test_pxr_disney_has_burleys_reflectances(name: str) -> None:
    scene = square(
        name,
        """color3f inputs:baseColor = (0.8, 0.4, 0.2)
        float inputs:metallic = 0.25
        float inputs:roughness = 0.5
        float inputs:clearcoat = 1
        float inputs:clearcoatGloss = 0.5
        color3f inputs:emitColor = (4, 2, 0)""",
        context="ri",
    )
    assert scene.warnings == ()
    (material,) = scene.materials
    seen = seen_at(scene, [(0.5, 0.5)])
    np.testing.assert_allclose(seen["diffuse"][0], 0.75 * np.array([0.8, 0.4, 0.2]), rtol=1e-5)
    # 0.08 specular with its default of 0.5, and an index of refraction of 1.5, are 0.04 alike.
    np.testing.assert_allclose(f0(scene), 0.75 * 0.04 + 0.25 * np.array([0.8, 0.4, 0.2]), rtol=1e-5)
    assert material.clearcoat == 0.25
    assert material.clearcoat_roughness**2 == pytest.approx(0.5 * (0.1 + 0.001))
    assert material.emissive_color == (4.0, 2.0, 0.0)


def test_pxr_disney_specular_and_its_tint() -> None:
    assert f0(square("PxrDisney", "float inputs:specular = 1", context="ri")) == pytest.approx(0.08)
    tinted = square(
        "PxrDisney", "float inputs:specularTint = 1\ncolor3f inputs:baseColor = (0.8, 0.4, 0.2)", context="ri"
    )
    base = np.array([0.8, 0.4, 0.2])
    np.testing.assert_allclose(f0(tinted), 0.04 * base / (base @ [0.3, 0.6, 0.1]), rtol=1e-5)


def test_pxr_texture_is_looked_up_through_its_manifold(tmp_path) -> None:
    texels = np.array([[0.2, 0.4], [0.6, 0.8]])[..., None].repeat(3, axis=-1)
    file = write(tmp_path / "c.exr", texels)
    nodes = node("T", "PxrTexture", f"string inputs:filename = @{file}@".replace("string", "asset")
                 + "\nint inputs:manifold.connect = </M/F.outputs:result>", out="resultRGB")  # fmt: skip
    nodes += node("F", "PxrManifold2D", "float inputs:scaleS = 2\nfloat inputs:scaleT = 2", "integer", "result")
    connected = "color3f inputs:diffuseColor.connect = </M/T.outputs:resultRGB>"
    scene = square("PxrSurface", connected, nodes, context="ri")
    assert scene.warnings == ()
    places = [(0.125, 0.125), (0.375, 0.125), (0.625, 0.875), (0.875, 0.375)]
    np.testing.assert_allclose(seen_at(scene, places)["diffuse"][:, 0], [0.6, 0.8, 0.2, 0.4], atol=1e-5)


def test_pxr_texture_channels_linearize_and_invert(tmp_path) -> None:
    file = write(tmp_path / "c.png", np.broadcast_to(np.array([1.0, 0.5, 0.25]), (2, 2, 3)).copy(), "uint8")
    for linearize, expected in ((0, 0.5), (1, 0.21404)):
        texture = f"asset inputs:filename = @{file}@\nint inputs:linearize = {linearize}"
        nodes = node("T", "PxrTexture", texture, "float", "resultG")
        connected = "float inputs:metallic.connect = </M/T.outputs:resultG>\ncolor3f inputs:baseColor = (1, 1, 1)"
        scene = square("PxrDisney", connected, nodes, context="ri")
        assert scene.warnings == ()
        np.testing.assert_allclose(seen_at(scene, [(0.5, 0.5)])["diffuse"], 1.0 - expected, atol=0.003)


def test_pxr_texture_from_the_top_down(tmp_path) -> None:
    file = write(tmp_path / "c.exr", np.array([[0.2, 0.4], [0.6, 0.8]])[..., None].repeat(3, axis=-1))
    nodes = node("T", "PxrTexture", f"asset inputs:filename = @{file}@\nint inputs:invertT = 0", out="resultRGB")
    scene = square("PxrSurface", "color3f inputs:diffuseColor.connect = </M/T.outputs:resultRGB>", nodes, context="ri")
    found = seen_at(scene, [(0.25, 0.25), (0.75, 0.75)])["diffuse"][:, 0]
    np.testing.assert_allclose(found, [0.2, 0.8], atol=1e-5)


def test_arnold_images_are_moved_flipped_and_swapped(tmp_path) -> None:
    file = write(tmp_path / "c.exr", np.array([[0.2, 0.4], [0.6, 0.8]])[..., None].repeat(3, axis=-1))
    connected = "color3f inputs:base_color.connect = </M/C.outputs:out>\nfloat inputs:base = 1"
    for inputs, expected in (
        ("", 0.6),
        ("float inputs:soffset = 0.5", 0.8),
        ("float inputs:toffset = 0.5", 0.2),
        ("bool inputs:sflip = 1", 0.8),
        ("bool inputs:tflip = 1", 0.2),
        ("bool inputs:swap_st = 1\nbool inputs:sflip = 1", 0.8),
    ):
        nodes = node("C", "arnold:image", f"asset inputs:filename = @{file}@\n{inputs}")
        scene = square("arnold:standard_surface", connected, nodes, context="arnold")
        np.testing.assert_allclose(seen_at(scene, [(0.25, 0.25)])["diffuse"], expected, atol=1e-5, err_msg=inputs)


def test_arnold_image_and_normal_map(tmp_path) -> None:
    texels = np.array([[0.2, 0.4], [0.6, 0.8]])[..., None].repeat(3, axis=-1)
    tilt = np.array([np.sin(0.3), 0.0, np.cos(0.3)])
    file = write(tmp_path / "c.exr", texels)
    bumps = write(tmp_path / "n.exr", np.broadcast_to(0.5 + 0.5 * tilt, (2, 2, 3)))
    nodes = node("C", "arnold:image", f"""asset inputs:filename = @{file}@
        float inputs:sscale = 2
        float inputs:tscale = 2
        color3f inputs:multiply = (0.5, 0.5, 0.5)
        color3f inputs:offset = (0.1, 0.1, 0.1)
        float outputs:r""")  # fmt: skip
    nodes += node("B", "arnold:image", f'asset inputs:filename = @{bumps}@\nstring inputs:color_space = "Raw"')
    nodes += node("N", "arnold:normal_map", "float3 inputs:input.connect = </M/B.outputs:out>", "vector3")
    connected = """color3f inputs:base_color.connect = </M/C.outputs:out>
        float inputs:specular_roughness.connect = </M/C.outputs:r>
        float3 inputs:normal.connect = </M/N.outputs:out>"""
    scene = square("arnold:standard_surface", connected, nodes, context="arnold")
    assert scene.warnings == ()
    seen = seen_at(scene, [(0.125, 0.125), (0.375, 0.125), (0.625, 0.875), (0.875, 0.375)])
    expected = 0.1 + 0.5 * np.array([0.6, 0.8, 0.2, 0.4])
    np.testing.assert_allclose(seen["diffuse"][:, 0], expected, atol=1e-5)
    np.testing.assert_allclose(seen["alpha"], expected**2, atol=1e-5)
    np.testing.assert_allclose(seen["normal"], np.broadcast_to(tilt, (4, 3)), atol=1e-5)


def test_what_is_best_is_used() -> None:
    """Of several contexts the first that is supported; UsdPreviewSurface before others."""
    text = """def Mesh "Q" ( prepend apiSchemas = ["MaterialBindingAPI"] )
{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0)]
    rel material:binding = </M>
}
def Material "M"
{
    token outputs:surface.connect = </M/U.outputs:out>
    token outputs:ri:surface.connect = </M/P.outputs:out>
    token outputs:arnold:surface.connect = </M/A.outputs:out>
    def Shader "U" { uniform token info:id = "KIND"
        color3f inputs:diffuseColor = (0.5, 0.5, 0.5)
        token outputs:out
    }
    def Shader "P" { uniform token info:id = "PxrSurface"
        token outputs:out
    }
    def Shader "A" { uniform token info:id = "ARNOLD"
        token outputs:out
    }
}
"""

    def color(kind: str, arnold: str) -> tuple[float, ...]:
        scene = load(text.replace("KIND", kind).replace("ARNOLD", arnold))
        assert scene.warnings == ()
        found = scene.materials[0].diffuse_color
        assert isinstance(found, tuple)
        return found

    assert color("UsdPreviewSurface", "arnold:standard_surface") == (0.5, 0.5, 0.5)
    assert color("Unknown", "arnold:standard_surface") == (0.8, 0.8, 0.8)
    assert color("Unknown", "arnold:toon") == (0.18, 0.18, 0.18)


def test_several_materials_of_one_kind_are_one_line_with_a_count() -> None:
    def square_of(name: str) -> str:
        return f"""def Mesh "Q{name}" ( prepend apiSchemas = ["MaterialBindingAPI"] )
{{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0)]
    rel material:binding = </{name}>
}}
def Material "{name}"
{{
    token outputs:ri:surface.connect = </{name}/P.outputs:out>
    def Shader "P" {{ uniform token info:id = "PxrSurface"
        float inputs:fuzzGain = 1
        token outputs:out
    }}
}}
"""

    (line,) = load("".join(map(square_of, "ABC"))).warnings
    assert "fuzzGain" in line and "2 more like it" in line


def test_displacement_of_another_shader_is_a_warning() -> None:
    text = """{}
    token outputs:mtlx:displacement.connect = </M/D.outputs:out>
    """.format(
        node("D", "ND_displacement_float", "float inputs:displacement = 0.1").replace(
            "color3f outputs", "token outputs"
        )
    )
    scene = square("ND_standard_surface_surfaceshader", nodes=text)
    assert mentions(scene, "/M", "ND_displacement_float", "not displaced") and len(scene.warnings) == 1
