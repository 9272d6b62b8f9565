"""Colour spaces: whose they are, their names, and the colours in linear Rec.709."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Gf
from usd.pictures import diffuse, stage, write
from usd.stages import load, mentions

from warpmis.usd.color_space import LINEAR, RAW, known_space, linear_rec709

NAMES = sorted({str(getattr(Gf.ColorSpaceNames, name)) for name in dir(Gf.ColorSpaceNames) if not name.startswith("_")})
SRGB_OF_HALF = 0.2140411
# (0.5, 0.25, 0.125) of ACEScg in linear Rec.709, by the matrix of ACES (AP1 to Rec.709, D60 to D65).
AP1 = np.array([[1.70505, -0.62179, -0.08326], [-0.13026, 1.14080, -0.01055], [-0.02400, -0.12897, 1.15297]])
COLOR = np.array([0.5, 0.25, 0.125])


@pytest.mark.parametrize("name", NAMES)
def test_all_of_gfs_spaces_become_what_gf_makes_of_them(name):
    space = known_space(name)
    source, target = Gf.ColorSpace(name), Gf.ColorSpace(LINEAR)
    colors = np.random.default_rng(1).random((50, 3))
    expected = [target.Convert(source, Gf.Vec3f(*color.tolist())).GetRGB() for color in colors]
    found = colors if space == RAW else linear_rec709(colors, space)
    np.testing.assert_allclose(found, expected, atol=2e-6)


@pytest.mark.parametrize(
    ("names", "space"),
    [
        ("raw|Raw|data|Non-Color|Utility - Raw|Non-Color Data|identity|unknown", RAW),
        ("sRGB|srgb_texture|srgb_tx|Utility - sRGB - Texture|sRGB - Texture", "srgb_rec709_scene"),
        ("sRGB Encoded Rec.709 (sRGB)|srgb_rec709_scene|SRGB", "srgb_rec709_scene"),
        ("linear|Linear|lin_rec709|Linear Rec.709 (sRGB)|Linear Rec.709|Utility - Linear - sRGB", LINEAR),
        ("scene_linear|lin_srgb|lin_rec709_scene", LINEAR),
        ("ACEScg|acescg|ACES - ACEScg|lin_ap1|Linear ACEScg", "lin_ap1_scene"),
        ("ACES2065-1|ACES - ACES2065-1|lin_ap0", "lin_ap0_scene"),
        ("Linear Rec.2020|Utility - Linear - Rec.2020|lin_rec2020", "lin_rec2020_scene"),
        ("Display P3|srgb_displayp3", "srgb_p3d65_scene"),
        ("lin_displayp3|Linear P3-D65|Linear DCI-P3 D65", "lin_p3d65_scene"),
        ("g22_rec709|Gamma 2.2 Rec.709 - Texture", "g22_rec709_scene"),
        ("g18_rec709|Gamma 1.8 Rec.709 - Texture", "g18_rec709_scene"),
        ("rec709_display|Rec.1886", "g24_rec709_scene"),
        ("adobergb", "g22_adobergb_scene"),
        ("lin_adobergb", "lin_adobergb_scene"),
        ("Linear CIE-XYZ D65", "lin_ciexyzd65_scene"),
    ],
)  # fmt: skip
def test_names_of_blender_ocio_and_materialx(names, space):
    assert {name: known_space(name) for name in names.split("|")} == dict.fromkeys(names.split("|"), space)


@pytest.mark.parametrize("name", ["", "nonsense", "Filmic Log", "sRGBs"])
def test_names_that_are_not_known(name):
    assert known_space(name) is None


def looked_up(tmp_path, texture: str, metadata: str = "", around: str = "", color=(0.5, 0.5, 0.5)):
    file = write(tmp_path / "half.png", np.full((2, 2, 3), 1.0) * color, "uint8")
    text = stage(file, texture=texture).replace(f"@{file}@", f"@{file}@ {metadata}")
    scene = load(text.replace('def Material "M"', f'def Material "M" {around}'))
    return scene, diffuse(scene, [(0.5, 0.5)])[0]


API = '( prepend apiSchemas = ["ColorSpaceAPI"] )'
SHADER = 'def Shader "T"\n    {'


def of_shader(space: str) -> str:
    return f'def Shader "T" {API}\n{{\nuniform token colorSpace:name = "{space}"\n'


@pytest.mark.parametrize(
    ("texture", "metadata", "expected"),
    [
        ("", "", SRGB_OF_HALF),
        ('token inputs:sourceColorSpace = "raw"', "", 0.5),
        ("", '( colorSpace = "raw" )', 0.5),
        ("", '( colorSpace = "Non-Color" )', 0.5),
        ("", '( colorSpace = "Utility - Linear - sRGB" )', 0.5),
        ("", '( colorSpace = "g22_rec709_scene" )', 0.5**2.2),
        ('token inputs:sourceColorSpace = "auto"', '( colorSpace = "lin_rec709_scene" )', SRGB_OF_HALF),
        ('token inputs:sourceColorSpace = "sRGB"', '( colorSpace = "raw" )', SRGB_OF_HALF),
        ('token inputs:sourceColorSpace = "raw"', '( colorSpace = "srgb_texture" )', 0.5),
        ('token inputs:sourceColorSpace = "Non-Color"', "", 0.5),
    ],
)
def test_the_attributes_space_counts_where_source_color_space_is_not_authored(tmp_path, texture, metadata, expected):
    scene, found = looked_up(tmp_path, texture, metadata)
    assert scene.warnings == ()
    np.testing.assert_allclose(found, expected, atol=0.004)  # a byte is 128 / 255


def test_a_prims_space_counts_where_the_attribute_has_none_and_the_nearest_before_others(tmp_path):
    around = API + '\n{\nuniform token colorSpace:name = "raw"\n'
    file = write(tmp_path / "half.png", np.full((2, 2, 3), 0.5), "uint8")
    text = stage(file).replace('def Material "M"\n{', f'def Material "M" {around}')
    np.testing.assert_allclose(diffuse(load(text), [(0.5, 0.5)])[0], 0.5, atol=0.004)
    nearer = text.replace(
        'def Shader "T"\n    {', f'def Shader "T" {API}\n{{\nuniform token colorSpace:name = "sRGB"\n'
    )
    assert nearer != text
    np.testing.assert_allclose(diffuse(load(nearer), [(0.5, 0.5)])[0], SRGB_OF_HALF, atol=0.004)
    own = nearer.replace(f"@{file}@", f'@{file}@ ( colorSpace = "lin_rec709" )')
    np.testing.assert_allclose(diffuse(load(own), [(0.5, 0.5)])[0], 0.5, atol=0.004)


@pytest.mark.parametrize("suffix", ["png", "exr"])
def test_texels_of_another_gamut(tmp_path, suffix):
    file = write(tmp_path / f"c.{suffix}", np.full((2, 2, 3), 1.0) * COLOR, "uint8" if suffix == "png" else "float")
    scene = load(stage(file).replace(f"@{file}@", f'@{file}@ ( colorSpace = "ACEScg" )'))
    np.testing.assert_allclose(diffuse(scene, [(0.5, 0.5)])[0], AP1 @ COLOR, atol=0.006 if suffix == "png" else 5e-4)


@pytest.mark.parametrize("where", ["attribute", "prim", "source"])
def test_an_unknown_space_is_a_warning_and_auto_is_used(tmp_path, where):
    texture = 'token inputs:sourceColorSpace = "Filmic Log"' if where == "source" else ""
    metadata = '( colorSpace = "Filmic Log" )' if where == "attribute" else ""
    file = write(tmp_path / "half.png", np.full((2, 2, 3), 0.5), "uint8")
    text = stage(file, texture=texture).replace(f"@{file}@", f"@{file}@ {metadata}")
    if where == "prim":
        text = text.replace(
            'def Shader "T"\n    {', f'def Shader "T" {API}\n{{\nuniform token colorSpace:name = "Filmic Log"\n'
        )
    scene = load(text)
    assert mentions(scene, "/M/T", "Filmic Log", "not known", "auto is used"), scene.warnings
    np.testing.assert_allclose(diffuse(scene, [(0.5, 0.5)])[0], SRGB_OF_HALF, atol=0.004)


CONSTANTS = {
    "a shader's color": ("color3f inputs:diffuseColor = (0.5, 0.25, 0.125) META", "material"),
    "displayColor": ("color3f[] primvars:displayColor = [(0.5, 0.25, 0.125)] META", "display"),
    "a light's color": ("color3f inputs:color = (0.5, 0.25, 0.125) META", "light"),
}


@pytest.mark.parametrize("case", CONSTANTS)
@pytest.mark.parametrize(
    ("space", "expected"), [("", COLOR), ("raw", COLOR), ("acescg", AP1 @ COLOR), ("lin_rec709", COLOR)]
)
@pytest.mark.parametrize("by", ["attribute", "prim"])
def test_colors_in_the_file_are_in_their_space(case, space, expected, by):
    line, kind = CONSTANTS[case]
    own = f'( colorSpace = "{space}" )' if space and by == "attribute" else ""
    line = line.replace("META", own)
    head = API if space and by == "prim" else ""
    name = f'uniform token colorSpace:name = "{space}"\n' if head else ""
    if kind == "light":
        text = f'def Xform "X" {head}\n{{\n{name}def SphereLight "L"\n{{\n{line}\n}}\n}}\ndef Cube "C"\n{{\n}}\n'
        found = load(text).lights[0].radiance
    elif kind == "display":
        found = load(f'def Xform "X" {head}\n{{\n{name}def Cube "C"\n{{\n{line}\n}}\n}}\n').materials[0].diffuse_color
    else:
        text = stage("", inputs=line).replace('def Material "M"\n{', f'def Material "M" {head}\n{{\n{name}')
        found = load(text).materials[0].diffuse_color
    np.testing.assert_allclose(found, expected, atol=5e-4)


def test_what_is_no_color_has_no_space():
    inputs = 'float inputs:roughness = 0.5 ( colorSpace = "acescg" )\nfloat3 inputs:normal = (0, 0, 1)'
    assert load(stage("", inputs=inputs)).materials[0].roughness == 0.5


@pytest.mark.parametrize("light", ["DomeLight", "RectLight"])
def test_the_picture_of_a_light_is_in_its_space(tmp_path, light):
    file = write(tmp_path / "c.png", np.full((4, 8, 3), 0.5), "uint8")
    for meta, expected in (
        ("", SRGB_OF_HALF),
        ('( colorSpace = "raw" )', 0.5),
        ('( colorSpace = "sRGB" )', SRGB_OF_HALF),
    ):
        scene = load(f'def {light} "L"\n{{\nasset inputs:texture:file = @{file}@ {meta}\n}}\ndef Cube "C"\n{{\n}}\n')
        found = scene.lights[0].picture if light == "DomeLight" else scene.lights[0].control.picture
        np.testing.assert_allclose(found.mean(), expected, atol=0.004)
