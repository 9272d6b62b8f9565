"""Primvars of PointInstancers: each instance has a value, flattened or traced through its transform."""

from __future__ import annotations

import numpy as np
import pytest
from usd.pictures import write
from usd.points import seen_at
from usd.stages import load, mentions

import warpmis.usd.placing as placing
from warpmis import render
from warpmis.scene.features import detect

RED, GREEN, BLUE = (0.75, 0.125, 0.125), (0.125, 0.75, 0.125), (0.125, 0.125, 0.75)
GREY = (0.18, 0.18, 0.18)
TILE = """uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-0.5, -0.5, 0), (0.5, -0.5, 0), (0.5, 0.5, 0), (-0.5, 0.5, 0)]
"""
BOUND = '( prepend apiSchemas = ["MaterialBindingAPI"] )'
THREE = "int[] protoIndices = [0, 0, 0]\npoint3f[] positions = [(0, 0, 0), (2, 0, 0), (4, 0, 0)]"
PLACES = [(0.1, 0.2), (2.1, 0.2), (4.1, 0.2)]


def instancer(body: str, tile: str = "", *, inside: bool = True, around: str = "") -> str:
    """Three tiles in a row, their prototype below the instancer or elsewhere."""
    shape = f'def Mesh "Tile" {BOUND}\n{{\n{TILE}\n{tile}\n}}\n'
    library = "" if inside else f'over "Library"\n{{\n{around}\n{shape}}}\n'
    prototype = f"{around}\n{shape}" if inside else ""
    path = "</I/Tile>" if inside else "</Library/Tile>"
    instances = "" if "protoIndices" in body else THREE
    return f'def PointInstancer "I"\n{{\n{instances}\nrel prototypes = {path}\n{body}\n{prototype}}}\n{library}'


def color(values: object, interpolation: str, name: str = "displayColor", more: str = "") -> str:
    return f'color3f[] primvars:{name} = {values} ( interpolation = "{interpolation}"\n{more} )'


def reading(text: str, copies: int):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(placing, "MAX_COPIES", copies)
        return load(text)


LEVELS = pytest.mark.parametrize("copies", [10**9, 0], ids=["flattened", "through transforms"])


def check(text: str, copies: int, expected, places=PLACES, field: str = "diffuse", warned: bool = False):
    scene = reading(text, copies)
    assert bool(scene.prototypes) == (copies == 0)
    assert warned or scene.warnings == ()
    np.testing.assert_allclose(seen_at(scene, places)[field], expected, atol=1e-6)
    return scene


@LEVELS
@pytest.mark.parametrize("inside", [True, False], ids=["below", "elsewhere"])
@pytest.mark.parametrize("interpolation", ["constant", "uniform", "vertex", "varying", "faceVarying"])
def test_display_color_by_interpolation(interpolation, inside, copies):
    of_all = interpolation in ("constant", "uniform")
    values = [RED] if of_all else [RED, GREEN, BLUE]
    check(instancer(color(values, interpolation), inside=inside), copies, [RED] * 3 if of_all else [RED, GREEN, BLUE])


@LEVELS
def test_indices_are_followed(copies):
    body = color([BLUE, RED], "vertex") + "\nint[] primvars:displayColor:indices = [1, 0, 1]"
    check(instancer(body), copies, [RED, BLUE, RED])


@LEVELS
def test_of_several_elements_each_instance_takes_its_first(copies):
    body = color([RED, GREY, GREEN, GREY, BLUE, GREY], "vertex", more="elementSize = 2")
    check(instancer(body), copies, [RED, GREEN, BLUE])


@LEVELS
def test_values_stay_with_their_instances_where_some_are_hidden_or_of_another_prototype(copies):
    body = """int[] protoIndices = [1, 0, 0, 0]
    int64[] ids = [10, 11, 12, 13]
    int64[] invisibleIds = [12]
    point3f[] positions = [(0, 0, 0), (2, 0, 0), (9, 9, 0), (4, 0, 0)]
    rel prototypes = [</I/Tile>, </I/Other>]
    """ + color([RED, GREEN, GREY, BLUE], "vertex")
    text = instancer(body).replace("rel prototypes = </I/Tile>\n", "")
    other = f'def Mesh "Other"\n{{\n{TILE}\n}}\n'
    check(text.replace('def Mesh "Tile"', other + 'def Mesh "Tile"'), copies, [RED, GREEN, BLUE])


@LEVELS
def test_display_opacity(copies):
    body = 'float[] primvars:displayOpacity = [1, 0.5, 0.25] ( interpolation = "varying" )'
    scene = check(instancer(body), copies, [1, 0.5, 0.25], field="opacity")
    assert detect(scene).opacity


@LEVELS
def test_what_is_nearer_to_the_surface_goes_before(copies):
    instances = color([RED, GREEN, BLUE], "vertex")
    own = "color3f[] primvars:displayColor = [(0.5, 0.5, 0.5)]"
    grey = [(0.5, 0.5, 0.5)] * 3
    check(instancer(instances, own), copies, grey)
    # A prim of the prototype above the surface; then one above the prototype, outside of the instance.
    nested = f'def PointInstancer "I"\n{{\n{THREE}\nrel prototypes = </I/Root>\n{instances}\ndef Xform "Root"\n{{\n'
    nested += f'{own}\ndef Mesh "Tile"\n{{\n{TILE}\n}}\n}}\n}}\n'
    check(nested, copies, grey)
    check(instancer(instances, around=own, inside=False), copies, [RED, GREEN, BLUE])


@LEVELS
def test_without_an_opinion_of_the_instancer_what_is_above_counts(copies):
    above = "color3f[] primvars:displayColor = [(0.5, 0.25, 0.125)]"
    for inside in (True, False):
        text = instancer("", inside=inside)
        text = text.replace("</I/", "</X/I/").replace("</Library/", "</X/Library/")
        check(f'def Xform "X"\n{{\n{above}\n{text}}}\n', copies, [(0.5, 0.25, 0.125)] * 3)
    outside = (
        f'def Xform "X"\n{{\n{above}\ndef PointInstancer "I"\n{{\n{THREE}\nrel prototypes = </Library/Tile>\n}}\n}}\n'
    )
    library = f'over "Library"\n{{\ndef Mesh "Tile"\n{{\n{TILE}\n}}\n}}\n'
    check(outside + library, copies, [(0.5, 0.25, 0.125)] * 3)


NESTED = f"""def PointInstancer "Out"
{{
    int[] protoIndices = [0, 0]
    point3f[] positions = [(0, 0, 0), (0, 10, 0)]
    rel prototypes = </Out/In>
    OUTER
    def PointInstancer "In"
    {{
        {THREE}
        rel prototypes = </Out/In/Tile>
        INNER
        def Mesh "Tile"
        {{
            {TILE}
        }}
    }}
}}
"""
SIX = [(x, y) for y in (0.2, 10.2) for x in (0.1, 2.1, 4.1)]


@LEVELS
def test_nested_instancers(copies):
    inner, outer = color([RED, GREEN, BLUE], "vertex"), color([GREY, (0.5, 0.25, 0.25)], "vertex")
    check(NESTED.replace("INNER", inner).replace("OUTER", ""), copies, [RED, GREEN, BLUE] * 2, SIX)
    check(NESTED.replace("INNER", "").replace("OUTER", outer), copies, [GREY] * 3 + [(0.5, 0.25, 0.25)] * 3, SIX)
    check(NESTED.replace("INNER", inner).replace("OUTER", outer), copies, [RED, GREEN, BLUE] * 2, SIX)
    constant = color([RED], "constant")
    check(NESTED.replace("INNER", constant).replace("OUTER", outer), copies, [RED] * 6, SIX)


@LEVELS
def test_nested_instancers_give_different_primvars(copies):
    opacity = 'float[] primvars:displayOpacity = [1, 0.5] ( interpolation = "vertex" )'
    text = NESTED.replace("INNER", color([RED, GREEN, BLUE], "vertex")).replace("OUTER", opacity)
    check(text, copies, [RED, GREEN, BLUE] * 2, SIX)
    check(text, copies, [1] * 3 + [0.5] * 3, SIX, "opacity")


LOOK = """def Material "Look"
{
    token outputs:surface.connect = </Look/S.outputs:surface>
    def Shader "S"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </Look/Tint.outputs:result>
        float inputs:roughness.connect = </Look/Rough.outputs:result>
        token outputs:surface
    }
    def Shader "Tint"
    {
        uniform token info:id = "UsdPrimvarReader_float3"
        string inputs:varname = "tint"
        float3 inputs:fallback = (1, 1, 0)
        float3 outputs:result
    }
    def Shader "Rough"
    {
        uniform token info:id = "UsdPrimvarReader_float"
        string inputs:varname = "rough"
        float outputs:result
    }
}
"""
ROUGH = 'float[] primvars:rough = [0.5, 0.25, 0.125] ( interpolation = "varying" )'


@LEVELS
def test_what_a_material_reads(copies):
    body = color([RED, GREEN, BLUE], "varying", "tint") + "\n" + ROUGH
    text = instancer(body, "rel material:binding = </Look>", inside=False) + LOOK
    check(text, copies, [RED, GREEN, BLUE])
    check(text, copies, [0.25, 0.0625, 0.015625], field="alpha")


@LEVELS
def test_texture_coordinates_of_instances_pick_a_texel_each(copies, tmp_path):
    texels = np.array([[RED, GREEN, BLUE, GREY]], np.float32)
    look = f"""def Material "Look"
{{
    token outputs:surface.connect = </Look/S.outputs:surface>
    def Shader "S"
    {{
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </Look/T.outputs:rgb>
        token outputs:surface
    }}
    def Shader "T"
    {{
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @{write(tmp_path / "p.exr", texels)}@
        float2 inputs:st.connect = </Look/R.outputs:result>
        float3 outputs:rgb
    }}
    def Shader "R"
    {{
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "place"
        float2 outputs:result
    }}
}}
"""
    body = 'float2[] primvars:place = [(0.125, 0.5), (0.375, 0.5), (0.625, 0.5)] ( interpolation = "vertex" )'
    check(instancer(body, "rel material:binding = </Look>") + look, copies, [RED, GREEN, BLUE])


@LEVELS
def test_two_materials_of_one_surface_read_different_primvars(copies):
    """Both begin with their first column."""
    subsets = "".join(
        f"""def GeomSubset "{name}" {BOUND}
    {{
        uniform token elementType = "face"
        uniform token familyName = "materialBind"
        int[] indices = [{face}]
        rel material:binding = </{name}>
    }}
"""
        for face, name in enumerate(("Look", "Other"))
    )
    halves = TILE.replace("[4]", "[4, 4]").replace("[0, 1, 2, 3]", "[0, 1, 2, 3, 4, 5, 6, 7]")
    halves = halves.replace(
        "(-0.5, 0.5, 0)]", "(-0.5, 0.5, 0), (-0.5, 0.5, 0), (0.5, 0.5, 0), (0.5, 1, 0), (-0.5, 1, 0)]"
    )
    other = LOOK.replace("Look", "Other").replace('"tint"', '"second"').replace('"rough"', '"smooth"')
    body = color([RED, GREEN, BLUE], "varying", "tint") + "\n" + ROUGH + "\n"
    body += color([BLUE, RED, GREEN], "vertex", "second") + "\n" + ROUGH.replace("rough", "smooth")
    text = instancer(body, subsets).replace(TILE, halves) + LOOK + other
    upper = [(x, 0.8) for x, _ in PLACES]
    check(text, copies, [RED, GREEN, BLUE, BLUE, RED, GREEN], PLACES + upper)


@LEVELS
def test_native_instances_in_a_prototype(copies):
    text = f"""class Xform "Class"
{{
    def Mesh "Tile"
    {{
        {TILE}
    }}
}}
def PointInstancer "I"
{{
    {THREE}
    rel prototypes = </I/P>
    {color([RED, GREEN, BLUE], "vertex")}
    def Xform "P"
    {{
        def "One" ( instanceable = true
            inherits = </Class> )
        {{
        }}
        def "Two" ( instanceable = true
            inherits = </Class> )
        {{
            double3 xformOp:translate = (0, 2, 0)
            uniform token[] xformOpOrder = ["xformOp:translate"]
        }}
    }}
}}
"""
    check(text, copies, [RED, GREEN, BLUE] * 2, PLACES + [(x, 2.2) for x, _ in PLACES])


@LEVELS
def test_mirrored_and_flat_places_keep_their_values(copies):
    body = THREE + "\nfloat3[] scales = [(-1, 1, 1), (1, 1, 1), (1, 1, 0)]\n" + color([RED, GREEN, BLUE], "vertex")
    check(instancer(body), copies, [RED, GREEN, BLUE])


@LEVELS
def test_far_instances_that_are_left_out_take_their_values_along(copies):
    body = "int[] protoIndices = [0, 0, 0]\npoint3f[] positions = [(1e30, 0, 0), (2, 0, 0), (4, 0, 0)]\n"
    scene = check(instancer(body + color([RED, GREEN, BLUE], "vertex")), copies, [GREEN, BLUE], PLACES[1:], warned=True)
    assert mentions(scene, "/I/Tile", "1 of its instances")


@LEVELS
def test_equal_values_are_a_constant(copies):
    scene = reading(instancer(color([RED] * 3, "vertex")), copies)
    assert scene.materials[0].diffuse_color == pytest.approx(RED)
    assert not detect(scene).vertex_colors


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (color([RED, GREEN], "vertex"), ("2 vertex values", "3 are needed")),
        (color([RED, GREEN], "vertex") + "\nint[] primvars:displayColor:indices = [0, 1, 7]", ("indices", "2 values")),
        ('string[] primvars:displayColor = ["a"] ( interpolation = "vertex" )', ("wrong type",)),
        ('float[] primvars:displayColor = [1, 2, 3] ( interpolation = "vertex" )', ("wrong type",)),
        (color([RED, GREEN, BLUE], "constant"), ("constant", "3 values", "first")),
    ],
)
def test_what_is_wrong_is_one_warning(body, words):
    scene = load(instancer(body))
    assert mentions(scene, "/I.primvars:displayColor", *words), scene.warnings
    assert len(scene.warnings) == 1
    expected = RED if "first" in words else GREY
    np.testing.assert_allclose(seen_at(scene, PLACES)["diffuse"], [expected] * 3, atol=1e-6)


def test_colors_of_instances_have_a_color_space():
    scene = load(instancer(color([RED, GREEN, BLUE], "vertex", more='colorSpace = "srgb_rec709_scene"')))
    np.testing.assert_allclose(seen_at(scene, PLACES)["diffuse"][0, 0], 0.5225216, atol=1e-5)


def test_instances_glow_in_their_colors_and_light_what_is_beside_them():
    """Each lights the ground in front of it: emission per instance is sampled as it is seen."""
    glow = LOOK.replace("diffuseColor.connect", "emissiveColor.connect")
    body = color([(4, 0, 0), (0, 4, 0), (0, 0, 4)], "varying", "tint")
    text = instancer(body + "\n" + ROUGH, "rel material:binding = </Look>\nuniform bool doubleSided = 1") + glow
    scene = load(text, width=30)
    np.testing.assert_allclose(seen_at(scene, PLACES)["emission"], np.diag([4, 4, 4]), atol=1e-6)
    picture = render(scene, method="nee", spp=4, max_depth=1, device="cpu").image
    seen = {tuple(np.round(pixel).astype(int)) for pixel in picture.reshape(-1, 3) if pixel.max() > 3.9}
    assert seen == {(4, 0, 0), (0, 4, 0), (0, 0, 4)}


def test_a_thousand_colors_take_a_row_each_not_a_prototype():
    count = 1000
    colors = [tuple(row) for row in np.random.default_rng(0).random((count, 3)).round(3).tolist()]
    body = f"int[] protoIndices = {[0] * count}\npoint3f[] positions = {[(2 * i, 0, 0) for i in range(count)]}\n"
    scene = reading(instancer(body + color(colors, "vertex")), 0)
    (prototype,) = scene.prototypes
    assert prototype.primvars.shape == (count, 3)
    assert len(scene.materials) == 1
    assert sum(part.nbytes for part in scene.parts) < 2000
    some = [0, 17, 999]
    found = seen_at(scene, [(2 * i + 0.1, 0.2) for i in some])["diffuse"]
    np.testing.assert_allclose(found, [colors[i] for i in some], atol=1e-6)
