"""What is authored in vain is said: one line for each kind, with the first prim."""

from __future__ import annotations

import pytest
from usd.stages import load, mentions

CUBE = 'def Cube "C"\n{\n}\n'


@pytest.mark.parametrize(
    ("kind", "attributes", "names"),
    [
        ("DistantLight", "float intensity = 3\nfloat angle = 1", "angle, intensity"),
        ("SphereLight", "float radius = 3\nbool normalize = 1", "normalize, radius"),
        ("RectLight", "float width = 3\nasset texture:file = @a.png@", "texture:file, width"),
        ("DiskLight", "float shaping:cone:angle = 3", "shaping:cone:angle"),
        ("CylinderLight", "float length = 3\ncolor3f color = (1, 0, 0)", "color, length"),
        (
            "DomeLight",
            "bool enableColorTemperature = 1\nbool shadow:enable = 0",
            "enableColorTemperature, shadow:enable",
        ),
    ],
)
def test_names_of_before_21_02_are_one_warning_with_the_remedy(kind, attributes, names):
    scene = load(f'def {kind} "L"\n{{\n{attributes}\n}}\n' + CUBE)
    assert mentions(scene, "/L: not read:", names, "inputs:")
    assert len(scene.warnings) == 1


def test_an_old_name_beside_its_new_one_is_no_warning():
    text = 'def RectLight "L"\n{\nfloat intensity = 3\nfloat inputs:intensity = 3\nfloat myOwn = 1\n}\n'
    assert load(text + CUBE).warnings == ()


def test_what_a_shape_calls_its_radius_is_its_own():
    text = (
        'def Sphere "S" (\nprepend apiSchemas = ["LightAPI"]\n)\n{\ndouble radius = 2\nfloat inputs:intensity = 1\n}\n'
    )
    assert load(text).warnings == ()


@pytest.mark.parametrize(
    ("attribute", "schema"),
    [
        ("float inputs:shaping:cone:angle = 20", "ShapingAPI"),
        ("float inputs:shaping:focus = 4", "ShapingAPI"),
        ("asset inputs:shaping:ies:file = @a.ies@", "ShapingAPI"),
        ("bool inputs:shadow:enable = 0", "ShadowAPI"),
    ],
)
def test_attributes_without_their_schema_are_one_warning(attribute, schema):
    text = 'def DiskLight "L"{api}\n{{\n{attribute}\n}}\n'
    scene = load(text.format(api="", attribute=attribute) + CUBE)
    assert mentions(scene, "/L: not read:", attribute.split()[1], schema, "apiSchemas")
    applied = load(text.format(api=f' (\nprepend apiSchemas = ["{schema}"]\n)', attribute=attribute) + CUBE)
    assert not any(schema in line for line in applied.warnings)


def test_what_a_light_is_connected_to_is_one_warning():
    text = 'def DiskLight "L"\n{\ncolor3f inputs:color.connect = </N.outputs:out>\n}\ndef Shader "N"\n{\n}\n'
    assert mentions(load(text + CUBE), "/L: not supported", "inputs:color")


def model(mode: str, kind: str = "component", more: str = "") -> str:
    return f"""def Xform "Set" ( kind = "assembly" )
{{
    def Xform "Model" ( kind = "{kind}"
        prepend apiSchemas = ["GeomModelAPI"] )
    {{
        uniform token model:drawMode = "{mode}"
        {more}
        def Cube "C"
        {{
        }}
    }}
}}
"""


@pytest.mark.parametrize("mode", ["bounds", "cards", "origin"])
def test_a_draw_mode_is_one_warning_and_the_geometry_is_rendered(mode):
    scene = load(model(mode))
    assert mentions(scene, "/Set/Model", "drawMode", mode)
    assert len(scene.geometry.triangles) == 12
    assert mentions(load(model(mode, "group", "bool model:applyDrawMode = 1")), "/Set/Model", "drawMode")


@pytest.mark.parametrize(
    "text", [model("default"), model("inherited"), model("cards", "group"), model("cards", "prop")]
)
def test_a_draw_mode_that_changes_nothing_is_no_warning(text):
    assert load(text).warnings == ()


def test_models_inherit_their_draw_mode():
    text = model("inherited").replace('kind = "assembly"', 'kind = "assembly"\nprepend apiSchemas = ["GeomModelAPI"]')
    text = text.replace("{", '{\nuniform token model:drawMode = "bounds"', 1)
    assert mentions(load(text), "/Set/Model", "drawMode bounds")


@pytest.mark.parametrize("purpose", ["preview", "full"])
@pytest.mark.parametrize("way", ["direct", "collection"])
def test_a_material_for_another_purpose_alone_is_one_warning(purpose, way):
    settings = (
        'def RenderSettings "R"\n{\nuniform token[] materialBindingPurposes = ["preview", ""]\n}\n'
        if purpose == "full"
        else ""
    )
    binding = (
        f"rel material:binding:{purpose} = </Look>"
        if way == "direct"
        else f"rel material:binding:collection:{purpose}:all = [</Set.collection:all>, </Look>]"
    )
    balls = "".join(f'def Sphere "B{i}"\n{{\n}}\n' for i in range(3))
    text = f"""def Xform "Set" ( prepend apiSchemas = ["MaterialBindingAPI", "CollectionAPI:all"] )
{{
    uniform token collection:all:expansionRule = "expandPrims"
    rel collection:all:includes = </Set>
    {binding}
    {balls}
}}
def Material "Look"
{{
}}
"""
    scene = load(text + settings, render_settings="/R" if settings else None)
    (line,) = scene.warnings
    assert line.startswith(f"/Set/B0: its material is bound for the purpose {purpose} only")
    assert line.endswith("displayColor is used (and 2 more like it)")


def test_a_prim_of_an_unknown_type_is_one_warning_and_what_is_below_it_is_rendered():
    teapots = "".join(f'def Teapot "T{i}"\n{{\n{CUBE}}}\n' for i in range(4))
    scene = load(teapots)
    assert len(scene.geometry.triangles) == 48
    (line,) = scene.warnings
    assert line.startswith("/T0: its type Teapot is not known")
    assert line.endswith("(and 3 more like it)")


@pytest.mark.parametrize("kind", ["ParticleField", "Volume", "NurbsPatch", "NurbsCurves", "TetMesh", "HermiteCurves"])
def test_known_types_that_are_not_supported_are_named(kind):
    scene = load(f'def {kind} "X"\n{{\n}}\n' + CUBE)
    assert mentions(scene, f"/X: {kind} is not supported; it is left out")
    assert len(scene.warnings) == 1


def test_bindings_without_their_schema_count_and_are_one_warning():
    balls = "".join(f'def Sphere "B{i}"\n{{\nrel material:binding = </Look>\n}}\n' for i in range(40))
    look = """def Material "Look"
{
    token outputs:surface.connect = </Look/S.outputs:surface>
    def Shader "S"
    {
        uniform token info:id = "UsdPreviewSurface"
        token outputs:surface
    }
}
"""
    scene = load(balls + look)
    (line,) = scene.warnings
    assert line.startswith("/B0: MaterialBindingAPI is not applied")
    assert line.endswith("(and 39 more like it)")
    assert {material.path for material in scene.materials} == {"/Look"}
