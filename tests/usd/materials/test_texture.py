"""Textures: what a texel becomes on its way to a material's input."""

from __future__ import annotations

import dataclasses

import numpy as np
import OpenImageIO
import pytest
from pxr import UsdUtils
from usd.pictures import CENTRES, GREYS, diffuse, grey, stage, write
from usd.points import seen_at
from usd.stages import load, mentions

from warpmis.scene import features
from warpmis.scene.texture import TextureLookup
from warpmis.usd import load_stage
from warpmis.usd.materials.image import srgb_to_linear


def test_st_origin_is_the_pictures_lower_left_corner(tmp_path):
    scene = load(stage(grey(tmp_path)))
    assert scene.warnings == ()
    np.testing.assert_allclose(diffuse(scene, CENTRES)[:, 0], GREYS.ravel(), atol=1e-6)
    np.testing.assert_allclose(diffuse(scene, [(0.5, 0.5)]), [[0.5] * 3], atol=1e-6)  # bilinear: the mean of the four
    np.testing.assert_allclose(diffuse(scene, [(0.4, 0.25)])[0, 0], 0.6 * 0.7 + 0.8 * 0.3, atol=1e-6)


def test_a_mesh_that_is_left_handed_or_mirrored_has_its_picture_in_the_same_places(tmp_path):
    text = stage(grey(tmp_path), mesh='uniform token orientation = "leftHanded"')
    np.testing.assert_allclose(diffuse(load(text), CENTRES)[:, 0], GREYS.ravel(), atol=1e-6)
    mirror = 'double3 xformOp:scale = (-1, 1, 1)\nuniform token[] xformOpOrder = ["xformOp:scale"]'
    mirrored = diffuse(load(stage(grey(tmp_path), mesh=mirror)), [(-x, y) for x, y in CENTRES])
    np.testing.assert_allclose(mirrored[:, 0], GREYS.ravel(), atol=1e-6)


# st runs from -1 to 2: the picture itself is the middle third of the square.
WRAPS = {
    "black": [0.0, 0.0, 0.2, 0.4, 0.0, 0.0],
    "clamp": [0.2, 0.2, 0.2, 0.4, 0.4, 0.4],
    "repeat": [0.2, 0.4, 0.2, 0.4, 0.2, 0.4],
    "mirror": [0.4, 0.2, 0.2, 0.4, 0.4, 0.2],
    "useMetadata": [0.0, 0.0, 0.2, 0.4, 0.0, 0.0],
}
SIXTHS = (np.arange(6) + 0.5) / 6


@pytest.mark.parametrize("mode", WRAPS)
@pytest.mark.parametrize("axis", ["S", "T"])
def test_wrap_mode_of_each_axis(tmp_path, mode, axis):
    row = np.array([[0.2, 0.4]])
    picture = row if axis == "S" else row.T[::-1]
    st = "[(-1, 0.5), (2, 0.5), (2, 0.5), (-1, 0.5)]" if axis == "S" else "[(0.5, -1), (0.5, -1), (0.5, 2), (0.5, 2)]"
    other = "T" if axis == "S" else "S"
    wrap = f'token inputs:wrap{axis} = "{mode}"\ntoken inputs:wrap{other} = "clamp"'
    scene = load(stage(grey(tmp_path, picture), texture=wrap, st=st))
    xy = [(x, 0.5) if axis == "S" else (0.5, x) for x in SIXTHS]
    np.testing.assert_allclose(diffuse(scene, xy)[:, 0], WRAPS[mode], atol=1e-5)


def test_wrap_mode_holds_between_the_outermost_texels_too(tmp_path):
    """On the picture's left edge the neighbour is black, the same, the one on the right, or the same."""
    expected = {"black": 0.1, "clamp": 0.2, "repeat": 0.3, "mirror": 0.2}
    for mode, value in expected.items():
        text = stage(
            grey(tmp_path, np.array([[0.2, 0.4]])),
            texture=f'token inputs:wrapS = "{mode}"\ntoken inputs:wrapT = "clamp"',
            st="[(-0.5, 0.5), (0.5, 0.5), (0.5, 0.5), (-0.5, 0.5)]",
        )
        assert diffuse(load(text), [(0.5, 0.5)])[0, 0] == pytest.approx(value, abs=1e-5), mode


DECODED = {0.5: 0.21404, 0.2: 0.03310}


@pytest.mark.parametrize(
    ("suffix", "kind", "channels", "space", "is_srgb"),
    [
        ("png", "uint8", 3, "auto", True),
        ("png", "uint8", 4, "auto", True),
        ("png", "uint8", 1, "auto", False),
        ("png", "uint8", 2, "auto", False),
        ("png", "uint8", 3, "raw", False),
        ("png", "uint8", 1, "sRGB", True),
        ("png", "uint16", 3, "auto", False),
        ("png", "uint16", 3, "sRGB", True),
        ("tga", "uint8", 3, "auto", True),
        ("tga", "uint8", 4, "auto", True),
        ("jpg", "uint8", 3, "auto", True),
        ("jpg", "uint8", 1, "auto", False),
        ("tif", "uint16", 4, "auto", False),
        ("tif", "float", 3, "auto", False),
        ("exr", "half", 4, "auto", False),
        ("exr", "float", 3, "sRGB", True),
        ("hdr", "float", 3, "auto", False),
    ],
)
def test_color_space_by_format_and_channels(tmp_path, suffix, kind, channels, space, is_srgb):
    color = {1: [0.5], 2: [0.5, 0.2], 3: [0.5, 0.5, 0.2], 4: [0.5, 0.5, 0.2, 0.2]}[channels]
    picture = np.broadcast_to(np.array(color), (8, 8, channels))
    inputs = """color3f inputs:diffuseColor.connect = </M/T.outputs:rgb>
    float inputs:roughness.connect = </M/T.outputs:a>
    """
    wrap = 'token inputs:wrapS = "repeat"\ntoken inputs:wrapT = "repeat"'
    text = stage(
        write(tmp_path / f"p.{suffix}", picture, kind),
        texture=f'token inputs:sourceColorSpace = "{space}"\n{wrap}',
        inputs=inputs,
    )
    scene = load(text)
    assert scene.warnings == ()
    seen = seen_at(scene, [(0.5, 0.5)])
    blue = 0.2 if channels >= 3 else 0.5
    expected = [DECODED[value] if is_srgb else value for value in (0.5, 0.5, blue)]
    tolerance = 0.02 if suffix == "jpg" else 0.005
    np.testing.assert_allclose(seen["diffuse"][0], expected, atol=tolerance)
    alpha = 0.2 if channels in (2, 4) else 1.0  # never sRGB, never multiplied in
    np.testing.assert_allclose(seen["alpha"][0], alpha**2, atol=0.005)


def test_auto_takes_a_files_own_word_that_it_is_srgb(tmp_path):
    for word, expected in ((1, DECODED[0.5]), (65535, 0.5)):
        spec = OpenImageIO.ImageSpec(2, 2, 3, "uint16")
        spec["Exif:ColorSpace"] = word
        output = OpenImageIO.ImageOutput.create(str(tmp_path / f"{word}.tif"))
        assert output.open(str(tmp_path / f"{word}.tif"), spec)
        assert output.write_image(np.full((2, 2, 3), 0.5, np.float32))
        output.close()
        np.testing.assert_allclose(diffuse(load(stage(tmp_path / f"{word}.tif")), [(0.5, 0.5)]), expected, atol=1e-3)


def test_texture_without_connected_coordinates_is_looked_up_in_one_point_with_a_warning(tmp_path):
    """Hydra's picture too: with the default wrap mode three quarters of what (0, 0) sees are beyond the picture."""
    text = stage(grey(tmp_path)).replace("float2 inputs:st.connect = </M/R.outputs:result>", "")
    scene = load(text)
    np.testing.assert_allclose(diffuse(scene, CENTRES)[:, 0], 0.6 / 4, atol=1e-6)
    assert mentions(scene, "/M/T", "st is not connected")


def test_bytes_are_decoded_before_they_are_interpolated(tmp_path):
    picture = np.array([[[0.0] * 3, [1.0] * 3]])
    scene = load(stage(write(tmp_path / "p.png", picture, "uint8"), texture='token inputs:wrapT = "clamp"'))
    np.testing.assert_allclose(diffuse(scene, [(0.5, 0.5)]), [[0.5] * 3], atol=1e-5)
    assert srgb_to_linear(np.float32(0.5)) == pytest.approx(0.214, abs=1e-3)


def test_scale_and_bias_and_the_range_of_the_input(tmp_path):
    adjust = "float4 inputs:scale = (2, 1, 1, 1)\nfloat4 inputs:bias = (-0.5, 0.125, -0.75, 0)"
    scene = load(stage(grey(tmp_path), texture=adjust))
    expected = [np.clip([2 * g - 0.5, g + 0.125, g - 0.75], 0, 1) for g in GREYS.ravel()]
    np.testing.assert_allclose(diffuse(scene, CENTRES), expected, atol=1e-6)


def test_transform_2d_scales_then_rotates_then_translates(tmp_path):
    """By (1, 2), 90 degrees and (1, 0): (s, t) is looked up at (1 - 2 t, s)."""
    more = """def Shader "X"
    {
        uniform token info:id = "UsdTransform2d"
        float2 inputs:in.connect = </M/R.outputs:result>
        float2 inputs:scale = (1, 2)
        float inputs:rotation = 90
        float2 inputs:translation = (1, 0)
        float2 outputs:result
    }
"""
    scene = load(stage(grey(tmp_path), st_source="</M/X.outputs:result>", more=more))
    assert scene.warnings == ()
    points = [(0.25, 0.375), (0.75, 0.375), (0.25, 0.125), (0.75, 0.125)]
    # looked up at (0.25, 0.25), (0.25, 0.75), (0.75, 0.25), (0.75, 0.75)
    np.testing.assert_allclose(diffuse(scene, points)[:, 0], [0.6, 0.2, 0.8, 0.4], atol=1e-5)


def test_circle_of_transforms_and_wrong_types_end_in_a_warning(tmp_path):
    more = """def Shader "X"
    {
        uniform token info:id = "UsdTransform2d"
        float2 inputs:in.connect = </M/X.outputs:result>
        string inputs:rotation = "much"
        float2 outputs:result
    }
"""
    scene = load(
        stage(grey(tmp_path), st_source="</M/X.outputs:result>", more=more, texture='string inputs:scale = "big"')
    )
    assert mentions(scene, "/M/X", "rotation")
    assert mentions(scene, "/M/T", "scale")
    assert np.isfinite(diffuse(scene, CENTRES)).all()


def test_each_output_is_its_channel(tmp_path):
    picture = np.broadcast_to(np.array([0.1, 0.3, 0.5, 0.7]), (2, 2, 4))
    names = {"metallic": "r", "roughness": "g", "clearcoatRoughness": "b", "clearcoat": "a"}
    inputs = "\n".join(f"float inputs:{name}.connect = </M/T.outputs:{c}>" for name, c in names.items())
    scene = load(stage(write(tmp_path / "p.tif", picture), inputs=inputs))
    (material,) = scene.materials
    assert (material.metallic.channels, material.clearcoat.channels) == ("r", "a")
    seen = seen_at(scene, [(0.5, 0.5)])
    np.testing.assert_allclose(seen["alpha"], 0.3**2, rtol=1e-5)
    np.testing.assert_allclose(seen["coat_alpha"], 0.5**2, rtol=1e-5)
    np.testing.assert_allclose(seen["coat"], 0.7, rtol=1e-5)
    np.testing.assert_allclose(seen["specular_f0"], 0.04 * 0.9 + 0.18 * 0.1, rtol=1e-5)
    np.testing.assert_allclose(seen["diffuse"], 0.18 * 0.9, rtol=1e-5)


def test_specular_workflow_and_emission_take_colors(tmp_path):
    picture = np.broadcast_to(np.array([0.25, 0.5, 4.0]), (1, 1, 3))
    inputs = """int inputs:useSpecularWorkflow = 1
    color3f inputs:specularColor.connect = </M/T.outputs:rgb>
    color3f inputs:emissiveColor.connect = </M/T.outputs:rgb>
    color3f inputs:diffuseColor.connect = </M/T.outputs:g>
    """
    wrap = 'token inputs:wrapS = "clamp"\ntoken inputs:wrapT = "clamp"'
    scene = load(stage(write(tmp_path / "p.tif", picture), inputs=inputs, texture=wrap))
    seen = seen_at(scene, [(0.3, 0.4)])
    np.testing.assert_allclose(seen["specular_f0"], [[0.25, 0.5, 1.0]])
    np.testing.assert_allclose(seen["emission"], [[0.25, 0.5, 4.0]])
    np.testing.assert_allclose(seen["diffuse"], [[0.5, 0.5, 0.5]])
    assert features.is_emissive(scene.materials[0])


@pytest.mark.parametrize("workflow", ["int inputs:useSpecularWorkflow = 1", ""])
def test_looked_up_inputs_resolve_as_constant_ones_do(tmp_path, workflow):
    """Two programs resolve a material, the upload and the kernel: they must agree."""
    values = {
        "diffuseColor": (0.5, 0.25, 0.125),
        "specularColor": (0.125, 0.25, 0.75),
        "emissiveColor": (0.25, 0.5, 1.0),
        "metallic": 0.375,
        "roughness": 0.75,
        "clearcoat": 0.625,
        "clearcoatRoughness": 0.25,
        "opacity": 0.875,
    }
    common = f'float inputs:ior = 1.8\ntoken inputs:opacityMode = "presence"\n{workflow}\n'
    constant, varying, more = common, common, ""
    for name, value in values.items():
        kind, output = ("color3f", "rgb") if isinstance(value, tuple) else ("float", "r")
        constant += f"{kind} inputs:{name} = {value}\n"
        varying += f"{kind} inputs:{name}.connect = </M/{name}.outputs:{output}>\n"
        # The second row differs, so that no lookup is folded to a constant.
        rows = np.array([np.broadcast_to(value, 3), np.zeros(3)])[:, None]
        more += f"""def Shader "{name}"
    {{
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @{write(tmp_path / f"{name}.exr", rows)}@
        float2 inputs:st.connect = </M/R.outputs:result>
        token inputs:wrapS = "clamp"
        token inputs:wrapT = "clamp"
        float3 outputs:rgb
        float outputs:r
    }}
"""
    file = grey(tmp_path)
    top = [(0.5, 0.875)]
    expected = seen_at(load(stage(file, inputs=constant)), top)
    found = seen_at(load(stage(file, inputs=varying, more=more)), top)
    for name in set(expected) - {"inputs"}:
        np.testing.assert_allclose(found[name], expected[name], rtol=1e-5, err_msg=name)


def test_udim_tiles_stand_beside_and_above_each_other_and_a_missing_one_is_the_fallback(tmp_path):
    for number, value in {1001: 0.1, 1002: 0.2, 1011: 0.3}.items():
        write(tmp_path / f"p.{number}.png", np.full((2, 2, 3), value), "uint8")
    settings = 'token inputs:sourceColorSpace = "raw"\nfloat4 inputs:fallback = (0.9, 0, 0, 1)'
    scene = load(stage(tmp_path / "p.<UDIM>.png", texture=settings, st="[(0, 0), (2, 0), (2, 2), (0, 2)]"))
    assert scene.warnings == ()
    found = diffuse(scene, [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75), (0.49, 0.49)])
    np.testing.assert_allclose(found[:, 0], [0.1, 0.2, 0.3, 0.9, 0.1], atol=0.003)


def test_opacity_threshold_cuts_out_where_the_texture_is_below(tmp_path):
    inputs = "float inputs:opacity.connect = </M/T.outputs:r>\nfloat inputs:opacityThreshold = 0.5"
    scene = load(stage(grey(tmp_path), inputs=inputs))
    np.testing.assert_array_equal(seen_at(scene, CENTRES)["opacity"], [0, 0, 1, 1])
    assert features.detect(scene).opacity
    assert scene.materials[0].opacity_mode == "presence"


def test_an_alpha_of_1_everywhere_is_no_transparency(tmp_path):
    picture = np.random.default_rng(0).random((4, 4, 4))
    picture[..., 3] = 1.0
    wrap = 'token inputs:wrapS = "repeat"\ntoken inputs:wrapT = "repeat"'
    inputs = "float inputs:opacity.connect = </M/T.outputs:a>"
    scene = load(stage(write(tmp_path / "p.png", picture, "uint8"), inputs=inputs, texture=wrap))
    assert scene.materials[0].opacity == 1.0
    assert not features.detect(scene).opacity


NORMAL = "normal3f inputs:normal.connect = </M/T.outputs:rgb>"
NORMAL_SETTINGS = """float4 inputs:scale = (2, 2, 2, 1)
float4 inputs:bias = (-1, -1, -1, 0)
token inputs:sourceColorSpace = "raw"
token inputs:wrapS = "clamp"
token inputs:wrapT = "clamp"
"""
TILT = np.radians(20.0)


@pytest.mark.parametrize(
    ("st", "toward"),
    [
        ("[(0, 0), (1, 0), (1, 1), (0, 1)]", [1, 0]),  # s along +x
        ("[(0, 0), (0, 3), (-3, 3), (-3, 0)]", [0, -1]),  # s along -y: turned and scaled
        ("[(1, 0), (0, 0), (0, 1), (1, 1)]", [-1, 0]),  # s along -x: mirrored
    ],
)
@pytest.mark.parametrize("from_behind", [False, True])
def test_normal_map_tilts_the_normal_towards_growing_s(tmp_path, st, toward, from_behind):
    direction = np.array([np.sin(TILT), 0.0, np.cos(TILT)])
    picture = np.broadcast_to(0.5 + 0.5 * direction, (2, 2, 3))
    file = write(tmp_path / "n.png", picture, "uint16")
    scene = load(stage(file, inputs=NORMAL, texture=NORMAL_SETTINGS, st=st))
    assert scene.warnings == ()
    assert features.detect(scene).normal_maps
    side = -1.0 if from_behind else 1.0
    found = seen_at(scene, [(0.3, 0.6)], wi=(0.0, 0.0, -side))["normal"]
    expected = side * np.array([*(np.sin(TILT) * np.array(toward)), np.cos(TILT)])
    np.testing.assert_allclose(found[0], expected, atol=1e-4)


def test_normal_map_of_bytes_without_scale_and_bias_is_a_warning(tmp_path):
    picture = np.broadcast_to([0.5, 0.5, 1.0], (2, 2, 3))
    assert mentions(load(stage(write(tmp_path / "n.png", picture, "uint8"), inputs=NORMAL)), "/M", "scale 2")


def test_normal_maps_y_is_towards_growing_t(tmp_path):
    picture = np.broadcast_to(0.5 + 0.5 * np.array([0.0, np.sin(TILT), np.cos(TILT)]), (2, 2, 3))
    scene = load(stage(write(tmp_path / "n.png", picture, "uint16"), inputs=NORMAL, texture=NORMAL_SETTINGS))
    np.testing.assert_allclose(seen_at(scene, [(0.3, 0.6)])["normal"], [[0, np.sin(TILT), np.cos(TILT)]], atol=1e-4)


def test_texture_in_a_usdz_package(tmp_path):
    write(tmp_path / "p.png", np.repeat(GREYS[..., None], 3, axis=-1), "uint8")
    (tmp_path / "s.usda").write_text("#usda 1.0\n" + stage("p.png", texture='token inputs:sourceColorSpace = "raw"'))
    assert UsdUtils.CreateNewUsdzPackage(str(tmp_path / "s.usda"), str(tmp_path / "s.usdz"))
    (tmp_path / "p.png").unlink()
    scene = load_stage(tmp_path / "s.usdz")
    assert scene.warnings == ()
    np.testing.assert_allclose(diffuse(scene, CENTRES)[:, 0], GREYS.ravel(), atol=0.003)


def test_one_picture_of_two_materials_is_decoded_and_stored_once(tmp_path):
    text = stage(write(tmp_path / "p.png", np.full((2, 2, 3), 0.5), "uint8"))
    scene = load(text + text.replace("/M", "/N").replace('"M"', '"N"').replace('"Q"', '"P"'))
    first, second = (material.diffuse_color for material in scene.materials)
    assert isinstance(first, TextureLookup)
    assert first.texture is second.texture


def test_texels_that_are_not_finite_are_black_with_a_warning(tmp_path):
    values = GREYS.copy()
    values[1, 0] = np.nan
    scene = load(stage(grey(tmp_path, values)))
    np.testing.assert_allclose(diffuse(scene, CENTRES)[:, 0], [0.2, 0.4, 0.0, 0.8], atol=1e-6)
    assert mentions(scene, "1 texels", "not finite")


@pytest.mark.parametrize("content", [b"", b"\x89PNG\r\n\x1a\n broken", b"no picture at all"])
def test_damaged_picture_is_the_fallback_with_one_warning(tmp_path, content):
    (tmp_path / "p.png").write_bytes(content)
    scene = load(stage(tmp_path / "p.png", texture="float4 inputs:fallback = (0.25, 0.5, 0.75, 1)"))
    assert scene.materials[0].diffuse_color == (0.25, 0.5, 0.75)
    assert len(scene.warnings) == 1
    assert mentions(scene, "/M/T", "p.png", "fallback")


def test_mean_of_lookups_is_what_lights_are_chosen_by(tmp_path):
    inputs = "color3f inputs:emissiveColor.connect = </M/T.outputs:rgb>"
    wrap = 'token inputs:wrapS = "clamp"\ntoken inputs:wrapT = "clamp"'
    scene = load(stage(grey(tmp_path, np.array([[0.25, 0.5], [0.75, 0.5]])), inputs=inputs, texture=wrap))
    assert scene.materials[0].mean_emission == (0.5, 0.5, 0.5)
    dark = dataclasses.replace(scene.materials[0].emissive_color, scale=(0.0,) * 4)
    assert not features.is_emissive(dataclasses.replace(scene.materials[0], emissive_color=dark))


def test_float_texels_are_summed_up_to_one_part_in_128_and_a_uniform_one_is_not_cut(tmp_path):
    texels = np.random.default_rng(0).random((16, 16)).astype(np.float32)
    wrap = 'token inputs:wrapS = "clamp"\ntoken inputs:wrapT = "clamp"'
    scene = load(
        stage(grey(tmp_path, texels), inputs="float inputs:roughness.connect = </M/T.outputs:r>", texture=wrap)
    )
    assert texels.mean() * 127 / 128 < scene.materials[0].mean.roughness <= texels.mean()
    uniform = grey(tmp_path, np.full((2, 2), 0.3001))
    scene = load(stage(uniform, inputs="float inputs:roughness.connect = </M/T.outputs:r>", texture=wrap))
    np.testing.assert_allclose(seen_at(scene, [(0.5, 0.5)])["alpha"], 0.3001**2, rtol=1e-5)
