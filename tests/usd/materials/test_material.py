"""UsdPreviewSurface, GeomSubsets and displayColor."""

from __future__ import annotations

import numpy as np
import pytest
from usd.stages import corners, load, mentions

from warpmis.scene import Material
from warpmis.scene.texture import PrimvarLookup

BOUND = 'prepend apiSchemas = ["MaterialBindingAPI"]'


def cube(name: str = "C", body: str = "rel material:binding = </M>") -> str:
    return f'def Cube "{name}" (\n    {BOUND}\n)\n{{\n{body}\n}}\n'


def material(inputs: str = "", name: str = "M", shader_id: str = "UsdPreviewSurface", more: str = "") -> str:
    return f"""def Material "{name}"
{{
    token outputs:surface.connect = </{name}/S.outputs:surface>
    {more}
    def Shader "S"
    {{
        uniform token info:id = "{shader_id}"
        {inputs}
        token outputs:surface
    }}
}}
"""


def read(inputs: str = "", more: str = "") -> Material:
    scene = load(cube() + material(inputs, more=more))
    assert scene.warnings == ()
    (found,) = scene.materials
    return found


def test_defaults_are_the_specifications():
    assert read() == Material(path="/M")
    # and scene.Material's are those that Sdr gives for UsdPreviewSurface
    from pxr import Sdr

    node = Sdr.Registry().GetShaderNodeByIdentifier("UsdPreviewSurface")
    if node:
        assert node.GetShaderInput("roughness").GetDefaultValue() == pytest.approx(Material().roughness)
        assert node.GetShaderInput("ior").GetDefaultValue() == pytest.approx(Material().ior)


def test_every_constant_input_is_read():
    found = read(
        """color3f inputs:diffuseColor = (0.5, 0.25, 0.75)
        color3f inputs:emissiveColor = (2, 0, 8)
        int inputs:useSpecularWorkflow = 1
        color3f inputs:specularColor = (0.125, 0.5, 1)
        float inputs:metallic = 0.25
        float inputs:roughness = 0.75
        float inputs:clearcoat = 0.5
        float inputs:clearcoatRoughness = 0.125
        float inputs:opacity = 0.875
        float inputs:ior = 2
        token inputs:opacityMode = "presence"
        """
    )
    assert found == Material(
        path="/M", diffuse_color=(0.5, 0.25, 0.75), emissive_color=(2, 0, 8), use_specular_workflow=True,
        specular_color=(0.125, 0.5, 1), metallic=0.25, roughness=0.75, clearcoat=0.5, clearcoat_roughness=0.125,
        opacity=0.875, ior=2, opacity_mode="presence",
    )  # fmt: skip


@pytest.mark.parametrize(("opacity", "expected"), [(0.49, 0.0), (0.5, 1.0), (0.9, 1.0)])
def test_opacity_threshold_makes_a_cutout(opacity, expected):
    assert read(f"float inputs:opacity = {opacity}\nfloat inputs:opacityThreshold = 0.5").opacity == expected


def test_inputs_connected_through_interfaces_end_in_their_constant():
    found = read(
        "color3f inputs:diffuseColor.connect = </M/Graph.inputs:tint>\n"
        "float inputs:roughness.connect = </M.inputs:gloss>",
        more="""float inputs:gloss = 0.125
    color3f inputs:color = (1, 0.5, 0.25)
    def NodeGraph "Graph"
    {
        color3f inputs:tint.connect = </M.inputs:color>
    }
""",
    )
    assert found.diffuse_color == (1, 0.5, 0.25)
    assert found.roughness == 0.125


TEXTURE = """def Shader "T"
    {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @missing.png@
        FALLBACK
        float3 outputs:rgb
        float outputs:g
    }
"""


def test_texture_that_cannot_be_read_gives_its_fallback_and_one_warning():
    inputs = (
        "color3f inputs:diffuseColor.connect = </M/T.outputs:rgb>\nfloat inputs:roughness.connect = </M/T.outputs:g>"
    )
    texture = TEXTURE.replace("FALLBACK", "float4 inputs:fallback = (0.125, 0.25, 0.5, 1)")
    scene = load(cube() + cube("D") + material(inputs, more=texture))
    assert scene.materials[0].diffuse_color == (0.125, 0.25, 0.5)
    assert scene.materials[0].roughness == 0.25
    assert mentions(scene, "/M/T", "missing.png", "fallback")
    assert len(scene.warnings) == 1


def test_texture_without_a_fallback_gives_the_inputs_default():
    texture = TEXTURE.replace("FALLBACK", "")
    scene = load(cube() + material("color3f inputs:diffuseColor.connect = </M/T.outputs:rgb>", more=texture))
    assert scene.materials[0].diffuse_color == (0.18, 0.18, 0.18)


@pytest.mark.parametrize(
    ("inputs", "field", "value"),
    [
        ("float inputs:roughness = 3", "roughness", 1.0),
        ("float inputs:metallic = -1", "metallic", 0.0),
        ("float inputs:opacity = nan", "opacity", 1.0),
        ("float inputs:ior = inf", "ior", 1.5),
        ("color3f inputs:diffuseColor = (2, 0.5, -1)", "diffuse_color", (1.0, 0.5, 0.0)),
        ("color3f inputs:emissiveColor = (-1, nan, 5)", "emissive_color", (0.0, 0.0, 5.0)),
        ("string inputs:roughness = \"rough\"", "roughness", 0.5),
        ("token inputs:opacityMode = \"glow\"", "opacity_mode", "transparent"),
    ],
)  # fmt: skip
def test_values_out_of_range_are_clamped_with_a_warning(inputs, field, value):
    scene = load(cube() + material(inputs))
    assert getattr(scene.materials[0], field) == value
    assert mentions(scene, "/M", inputs.split()[1].split(":")[-1])
    assert len(scene.warnings) == 1


def test_displacement_is_one_warning():
    scene = load(cube() + material("float inputs:displacement = 1"))
    assert len(scene.warnings) == 1
    assert mentions(scene, "/M", "not supported")


def test_material_is_listed_once_and_by_binding_of_an_ancestor():
    text = f'def Xform "G" (\n{BOUND}\n)\n{{\nrel material:binding = </M>\n{cube("A", "")}{cube("B", "")}}}\n'
    scene = load(text + cube() + material())
    assert [found.path for found in scene.materials] == ["/M"]
    assert (scene.geometry.materials == 0).all()


def test_purpose_full_goes_before_all_purpose_and_preview_is_not_used():
    body = "rel material:binding = </M>\nrel material:binding:full = </F>\nrel material:binding:preview = </P>"
    scene = load(cube(body=body) + material() + material(name="F") + material(name="P"))
    assert [found.path for found in scene.materials] == ["/F"]
    body = "rel material:binding = </M>\nrel material:binding:preview = </P>"
    assert [found.path for found in load(cube(body=body) + material() + material(name="P")).materials] == ["/M"]


@pytest.mark.parametrize(
    ("purposes", "expected"),
    [
        ('["full", ""]', ["/F", "/M"]),
        ('["preview", ""]', ["/P", "/P"]),
        ('["full", "preview", ""]', ["/F", "/P"]),
        ('[""]', ["/M", "/M"]),
        ('["full"]', ["/F", ""]),
    ],
)
def test_render_settings_choose_the_purposes_of_bindings(purposes, expected):
    """The first cube is bound for full, preview and all purposes, the second for the latter two."""
    both = "rel material:binding = </M>\nrel material:binding:preview = </P>\n"
    text = f"""(
    renderSettingsPrimPath = "/R"
)
def RenderSettings "R"
{{
    uniform token[] materialBindingPurposes = {purposes}
}}
"""
    text += cube("A", both + "rel material:binding:full = </F>") + cube("B", both)
    scene = load(text + material() + material(name="F") + material(name="P"))
    by_prim = dict(zip(scene.geometry.prims, scene.geometry.materials, strict=True))
    assert [scene.materials[by_prim[prim]].path for prim in (0, 1)] == expected


def test_binding_that_is_stronger_than_descendants_wins():
    for strength, expected in (("strongerThanDescendants", "/M"), ("weakerThanDescendants", "/F")):
        binding = f'rel material:binding = </M> (\nbindMaterialAs = "{strength}"\n)'
        own = cube("A", "rel material:binding = </F>")
        text = f'def Xform "G" (\n{BOUND}\n)\n{{\n{binding}\n{own}}}\n'
        assert [found.path for found in load(text + material() + material(name="F")).materials] == [expected]


@pytest.mark.parametrize("purpose", ["", "full:"])
def test_collection_binding_is_honoured(purpose):
    text = f"""def Xform "G" (
    prepend apiSchemas = ["MaterialBindingAPI", "CollectionAPI:red"]
)
{{
    rel collection:red:includes = </G/A>
    rel material:binding:collection:{purpose}red = [</G.collection:red>, </M>]
    {cube("A", "")}
    {cube("B", "")}
}}
"""
    scene = load(text + material("color3f inputs:diffuseColor = (1, 0, 0)"))
    by_triangle = zip(scene.geometry.prims, scene.geometry.materials, strict=True)
    by_prim = {scene.prims[prim].path: scene.materials[index] for prim, index in by_triangle}
    assert by_prim["/G/A"].diffuse_color == (1, 0, 0)
    assert by_prim["/G/B"].lambertian


def test_geom_subsets_give_their_faces_their_materials():
    text = f"""def Mesh "Mesh" (
    {BOUND}
)
{{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4, 3, 4]
    int[] faceVertexIndices = [0, 1, 5, 4, 1, 2, 5, 2, 3, 7, 6]
    point3f[] points = [(0,0,0), (1,0,0), (2,0,0), (3,0,0), (0,1,0), (1,1,0), (2,1,0), (3,1,0)]
    rel material:binding = </M>
    def GeomSubset "Last" (
        {BOUND}
    )
    {{
        uniform token elementType = "face"
        uniform token familyName = "materialBind"
        int[] indices = [2, 99]
        rel material:binding = </R>
    }}
}}
"""
    scene = load(text + material() + material(name="R"))
    right = corners(scene)[..., 0].min(axis=1) >= 2
    paths = np.array([scene.materials[index].path for index in scene.geometry.materials])
    assert (paths[right] == "/R").all()
    assert (paths[~right] == "/M").all()
    assert right.sum() == 2
    assert len(paths) == 5


def test_no_material_is_the_lambertian_of_display_color():
    body = "color3f[] primvars:displayColor = [(0.25, 0.5, 1)]\nfloat[] primvars:displayOpacity = [0.5]"
    scene = load(cube(body=body) + cube("D", ""))
    assert scene.materials == (
        Material(diffuse_color=(0.25, 0.5, 1), opacity=0.5, lambertian=True),
        Material(diffuse_color=(0.18, 0.18, 0.18), lambertian=True),
    )
    assert scene.warnings == ()


def test_display_color_is_inherited():
    red = 'color3f[] primvars:displayColor = [(1, 0, 0)] (interpolation = "constant")'
    assert load(f'def Xform "G"\n{{\n{red}\n{cube("A", "")}}}\n').materials[0].diffuse_color == (1, 0, 0)


def test_display_color_is_constant_where_all_its_values_are_equal():
    quad = """def Mesh "Q"
{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(0,0,0), (1,0,0), (1,1,0), (0,1,0)]
    color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0)] (interpolation = "vertex")
    int[] primvars:displayColor:indices = [0, 0, 0, 1]
}
"""
    assert load(quad).materials[0].diffuse_color == PrimvarLookup(0)
    equal = load(quad.replace("[0, 0, 0, 1]", "[0, 0, 0, 0]"))
    assert equal.materials[0].diffuse_color == (1, 0, 0)
    assert equal.warnings == ()


def test_display_color_out_of_range_is_clamped_with_a_warning():
    scene = load(cube(body="color3f[] primvars:displayColor = [(2, nan, -1)]"))
    assert scene.materials[0].diffuse_color == (1, 0.18, 0)
    assert mentions(scene, "/C", "displayColor")


def test_other_shaders_and_missing_materials_fall_back_to_display_color_with_one_warning():
    green = "color3f[] primvars:displayColor = [(0, 1, 0)]\n"
    other = load(cube(body=green + "rel material:binding = </M>") + material(shader_id="ND_standard_surface"))
    assert other.materials == (Material(diffuse_color=(0, 1, 0), lambertian=True),)
    assert mentions(other, "/M", "ND_standard_surface")
    missing = load(cube(body=green + "rel material:binding = </Nowhere>"))
    assert missing.materials == (Material(diffuse_color=(0, 1, 0), lambertian=True),)
    assert mentions(missing, "/C", "/Nowhere")
    empty = load(cube(body=green + "rel material:binding = </M>") + 'def Material "M"\n{\n}\n')
    assert empty.materials[0].diffuse_color == (0, 1, 0)
    assert mentions(empty, "/M", "no UsdPreviewSurface")
