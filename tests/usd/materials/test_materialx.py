"""MaterialX networks in a stage: what of them becomes a UsdPreviewSurface."""

from __future__ import annotations

import numpy as np
import pytest
from usd.pictures import write
from usd.points import seen_at
from usd.stages import load, mentions

from warpmis.scene import Material, Scene


def stage(surface: str, inputs: str, nodes: str = "") -> Scene:
    """A unit square with st = (x, y) and a material of the mtlx context alone."""
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
    token outputs:mtlx:surface.connect = </M/S.outputs:out>
    def Shader "S"
    {{
        uniform token info:id = "{surface}"
        {inputs}
        token outputs:out
    }}
    {nodes}
}}
""")


def image(name: str, file: object, kind: str = "color3", more: str = "", space: str = "") -> str:
    usd = {"color3": "color3f", "vector3": "float3", "float": "float"}[kind]
    meta = f'( colorSpace = "{space}" )' if space else ""
    return f"""def Shader "{name}"
    {{
        uniform token info:id = "ND_image_{kind}"
        asset inputs:file = @{file}@ {meta}
        {more}
        {usd} outputs:out
    }}
"""


def test_standard_surface_of_constants():
    scene = stage(
        "ND_standard_surface_surfaceshader",
        """float inputs:base = 0.5
        color3f inputs:base_color = (0.5, 0.25, 1)
        float inputs:metalness = 0.25
        float inputs:specular_roughness = 0.375
        float inputs:coat = 0.75
        float inputs:coat_roughness = 0.125
        float inputs:emission = 4
        color3f inputs:emission_color = (1, 0.5, 0)
        color3f inputs:opacity = (0.5, 0.5, 0.5)
        """,
    )
    assert scene.warnings == ()
    (found,) = scene.materials
    assert found.ior == pytest.approx(1.5)
    assert found == Material(
        path="/M", diffuse_color=(0.25, 0.125, 0.5), emissive_color=(4, 2, 0), metallic=0.25, roughness=0.375,
        clearcoat=0.75, clearcoat_roughness=0.125, opacity=0.5, opacity_mode="presence", ior=found.ior,
    )  # fmt: skip


def test_defaults_of_both_models():
    (standard,) = stage("ND_standard_surface_surfaceshader", "").materials
    (open_pbr,) = stage("ND_open_pbr_surface_surfaceshader", "").materials
    assert (standard.diffuse_color, standard.roughness, standard.emissive_color) == ((0.8,) * 3, 0.2, (0.0,) * 3)
    assert (open_pbr.diffuse_color, open_pbr.roughness, open_pbr.emissive_color) == ((0.8,) * 3, 0.3, (0.0,) * 3)


def test_specular_weight_scales_the_reflectance_at_normal_incidence():
    scene = stage("ND_open_pbr_surface_surfaceshader", "float inputs:specular_weight = 0.25")
    np.testing.assert_allclose(seen_at(scene, [(0.5, 0.5)])["specular_f0"], 0.04 * 0.25, rtol=1e-5)


def test_image_nodes_are_looked_up_tiled_and_scaled(tmp_path):
    texels = np.array([[0.2, 0.4], [0.6, 0.8]])[..., None].repeat(3, axis=-1)
    nodes = image("C", write(tmp_path / "c.exr", texels)).replace("ND_image", "ND_tiledimage")
    nodes = nodes.replace("color3f outputs:out", "float2 inputs:uvtiling = (2, 2)\ncolor3f outputs:out")
    inputs = "float inputs:base = 0.5\ncolor3f inputs:base_color.connect = </M/C.outputs:out>"
    scene = stage("ND_standard_surface_surfaceshader", inputs, nodes)
    assert scene.warnings == ()
    found = seen_at(scene, [(0.125, 0.125), (0.375, 0.125), (0.625, 0.875), (0.875, 0.375)])["diffuse"][:, 0]
    np.testing.assert_allclose(found, [0.3, 0.4, 0.1, 0.2], atol=1e-5)


def test_color_space_is_the_files_attributes(tmp_path):
    file = write(tmp_path / "c.png", np.full((2, 2, 3), 0.5), "uint8")
    for space, expected in (("srgb_texture", 0.21404), ("lin_rec709", 0.5), ("", 0.5)):
        inputs = "color3f inputs:base_color.connect = </M/C.outputs:out>"
        scene = stage("ND_standard_surface_surfaceshader", inputs, image("C", file, space=space))
        np.testing.assert_allclose(seen_at(scene, [(0.5, 0.5)])["diffuse"], expected, atol=0.003)


def test_separated_and_extracted_channels_and_a_normal_map(tmp_path):
    tilt = np.array([np.sin(0.3), 0.0, np.cos(0.3)])
    nodes = image("P", write(tmp_path / "p.exr", np.broadcast_to([0.1, 0.5, 0.7], (2, 2, 3))), "vector3")
    nodes += image("N", write(tmp_path / "n.exr", np.broadcast_to(0.5 + 0.5 * tilt, (2, 2, 3))), "vector3")
    for name, kind, more, output in (
        ("G", "ND_separate3_vector3", "float3 inputs:in.connect = </M/P.outputs:out>", "float outputs:outy"),
        ("B", "ND_extract_vector3", "float3 inputs:in.connect = </M/P.outputs:out>\nint inputs:index = 2",
         "float outputs:out"),
        ("T", "ND_normalmap", "float3 inputs:in.connect = </M/N.outputs:out>", "float3 outputs:out"),
    ):  # fmt: skip
        nodes += f'def Shader "{name}"\n{{\nuniform token info:id = "{kind}"\n{more}\n{output}\n}}\n'
    inputs = """float inputs:specular_roughness.connect = </M/G.outputs:outy>
    float inputs:metalness.connect = </M/B.outputs:out>
    float3 inputs:normal.connect = </M/T.outputs:out>
    """
    scene = stage("ND_standard_surface_surfaceshader", inputs, nodes)
    assert scene.warnings == ()
    seen = seen_at(scene, [(0.5, 0.5)])
    np.testing.assert_allclose(seen["alpha"], 0.25, rtol=1e-5)
    np.testing.assert_allclose(seen["diffuse"], 0.8 * 0.3, rtol=1e-5)
    np.testing.assert_allclose(seen["normal"], [tilt], atol=1e-5)


def test_preview_surface_of_materialx(tmp_path):
    file = write(tmp_path / "c.exr", np.full((2, 2, 3), 0.25))
    inputs = "color3f inputs:diffuseColor.connect = </M/C.outputs:out>\nfloat inputs:roughness = 0.5"
    scene = stage("ND_UsdPreviewSurface_surfaceshader", inputs, image("C", file))
    assert scene.warnings == ()
    np.testing.assert_allclose(seen_at(scene, [(0.5, 0.5)])["diffuse"], 0.25, atol=1e-6)


def test_lobes_and_nodes_that_are_not_known_are_a_warning_each():
    nodes = 'def Shader "X"\n{\nuniform token info:id = "ND_flake3d"\ncolor3f outputs:out\n}\n'
    inputs = "color3f inputs:base_color.connect = </M/X.outputs:out>\nfloat inputs:sheen = 1"
    scene = stage("ND_standard_surface_surfaceshader", inputs, nodes)
    assert mentions(scene, "/M", "sheen", "not supported")
    assert mentions(scene, "/M", "/M/X", "ND_flake3d")
    assert len(scene.warnings) == 2
    assert scene.materials[0].diffuse_color == (0.8, 0.8, 0.8)


def test_circle_of_connections_is_a_warning():
    circle = """def Shader "A"
    {
        uniform token info:id = "ND_convert_color3_vector3"
        float3 inputs:in.connect = </M/B.outputs:out>
        float3 outputs:out
    }
    def Shader "B"
    {
        uniform token info:id = "ND_convert_vector3_color3"
        float3 inputs:in.connect = </M/A.outputs:out>
        color3f outputs:out
    }
"""
    inputs = "color3f inputs:base_color.connect = </M/B.outputs:out>"
    scene = stage("ND_standard_surface_surfaceshader", inputs, circle)
    assert mentions(scene, "/M", "circle")
    assert scene.materials[0].diffuse_color == (0.8, 0.8, 0.8)


def test_emission_of_weight_0_is_none_whatever_its_color(tmp_path):
    file = write(tmp_path / "c.exr", np.full((2, 2, 3), 0.25))
    inputs = "color3f inputs:emission_color.connect = </M/C.outputs:out>"
    assert stage("ND_open_pbr_surface_surfaceshader", inputs, image("C", file)).materials[0].emissive_color == (0, 0, 0)
    glowing = stage(
        "ND_open_pbr_surface_surfaceshader", inputs + "\nfloat inputs:emission_luminance = 8", image("C", file)
    )
    np.testing.assert_allclose(seen_at(glowing, [(0.5, 0.5)])["emission"], 2.0, rtol=1e-6)


def test_a_coat_has_its_own_index_of_refraction():
    """Beside the dielectric's reflectance, which its own index or weight sets."""
    for inputs, below, coat in (
        ("float inputs:specular_IOR = 1.25", (0.25 / 2.25) ** 2, 0.04),
        ("float inputs:specular = 0.5", 0.02, 0.04),
        ("float inputs:coat_IOR = 1.25", 0.04, (0.25 / 2.25) ** 2),
        ("float inputs:specular = 0", 0.0, 0.04),
    ):
        scene = stage("ND_standard_surface_surfaceshader", f"float inputs:coat = 1\n{inputs}")
        assert scene.warnings == ()
        seen = seen_at(scene, [(0.5, 0.5)])
        np.testing.assert_allclose(seen["specular_f0"], below, rtol=1e-5, atol=1e-9)
        np.testing.assert_allclose(seen["coat_f0"], coat, rtol=1e-5)
        np.testing.assert_allclose(seen["diffuse"], 0.8, rtol=1e-5)


def test_a_coats_color_tints_all_below_it():
    scene = stage(
        "ND_standard_surface_surfaceshader",
        """float inputs:coat = 0.5
        color3f inputs:coat_color = (1, 0.5, 0)
        float inputs:emission = 2
        float inputs:metalness = 0.25""",
    )
    assert scene.warnings == ()
    seen, tint = seen_at(scene, [(0.5, 0.5)]), np.array([1.0, 0.75, 0.5])
    np.testing.assert_allclose(seen["diffuse"][0], 0.75 * 0.8 * tint, rtol=1e-5)
    np.testing.assert_allclose(seen["specular_f0"][0], (0.75 * 0.04 + 0.25 * 0.8) * tint, rtol=1e-5)
    np.testing.assert_allclose(seen["emission"][0], 2 * tint, rtol=1e-5)


def test_subsurface_is_diffuse_with_a_warning():
    inputs = """float inputs:base = 0.5
        color3f inputs:base_color = (0.5, 0.25, 1)
        float inputs:subsurface = 0.25
        color3f inputs:subsurface_color = (1, 0.5, 0.25)
        float inputs:metalness = 0.5"""
    scene = stage("ND_standard_surface_surfaceshader", inputs)
    assert mentions(scene, "/M", "subsurface", "diffuse") and len(scene.warnings) == 1
    seen, base = seen_at(scene, [(0.5, 0.5)]), 0.5 * np.array([0.5, 0.25, 1])
    np.testing.assert_allclose(seen["diffuse"][0], 0.5 * (0.75 * base + 0.25 * np.array([1, 0.5, 0.25])), rtol=1e-5)
    np.testing.assert_allclose(seen["specular_f0"][0], 0.5 * 0.04 + 0.5 * base, rtol=1e-5)


def test_a_weight_that_varies(tmp_path):
    """base, metalness and specular of pictures, multiplied texel by texel."""
    texels = np.random.default_rng(1).uniform(0.1, 0.9, (2, 2, 3))
    nodes = image("C", write(tmp_path / "c.exr", texels)) + image(
        "W", write(tmp_path / "w.exr", texels[..., :1]), "float"
    )
    inputs = """color3f inputs:base_color.connect = </M/C.outputs:out>
    float inputs:base.connect = </M/W.outputs:out>
    float inputs:metalness.connect = </M/W.outputs:out>
    float inputs:specular.connect = </M/W.outputs:out>
    """
    scene = stage("ND_standard_surface_surfaceshader", inputs, nodes)
    assert scene.warnings == ()
    found = seen_at(scene, [(0.25, 0.75), (0.75, 0.75), (0.25, 0.25), (0.75, 0.25)])
    color = texels.reshape(4, 3)
    weight = color[:, :1]
    np.testing.assert_allclose(found["diffuse"], color * weight * (1 - weight), rtol=2e-3)
    np.testing.assert_allclose(found["specular_f0"], 0.04 * weight * (1 - weight) + color * weight * weight, rtol=2e-3)


def test_what_a_coat_lacks_counts_only_with_a_coat():
    rough = "float inputs:coat_affect_color = 1"
    assert stage("ND_standard_surface_surfaceshader", rough).warnings == ()
    scene = stage("ND_standard_surface_surfaceshader", rough + "\nfloat inputs:coat = 1\nfloat inputs:sheen = 1")
    assert mentions(scene, "/M", "sheen", "coat_affect_color", "left out") and len(scene.warnings) == 1
