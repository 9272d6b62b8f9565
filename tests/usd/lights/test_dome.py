"""Dome lights: their frame and their pictures."""

from __future__ import annotations

import math

import numpy as np
import OpenEXR
import OpenImageIO
import pytest
from pxr import Sdf, Usd, UsdGeom, UsdLux, UsdUtils
from usd.stages import load, mentions

from warpmis.scene import DomeLight
from warpmis.usd import load_stage
from warpmis.usd.materials.image import PictureError, read_picture, srgb_to_linear

CUBE = 'def Cube "C"\n{\n}\n'


def look(dome: DomeLight, u: float, v: float) -> np.ndarray:
    """World direction of a picture coordinate, as scene.DomeLight documents it."""
    local = [
        math.sin(math.pi * v) * math.sin(2 * math.pi * u),
        math.cos(math.pi * v),
        -math.sin(math.pi * v) * math.cos(2 * math.pi * u),
    ]
    return dome.to_world @ np.array(local)


def dome(kind: str = "DomeLight", body: str = "", up: str = "Y") -> DomeLight:
    scene = load(f'(\n    upAxis = "{up}"\n)\ndef {kind} "D"\n{{\n{body}\n}}\n' + CUBE)
    (found,) = scene.lights
    assert isinstance(found, DomeLight)
    return found


# (prim type, poleAxis, upAxis) -> pole, longitude 0 (middle of the picture), longitude pi/2 (a quarter from its left)
Y_POLE = ([0, 1, 0], [0, 0, 1], [1, 0, 0])
Z_POLE = ([0, 0, 1], [0, -1, 0], [1, 0, 0])
FRAMES = [
    ("DomeLight", "", "Y", Y_POLE),
    ("DomeLight", "", "Z", Y_POLE),
    ("DomeLight_1", "", "Y", Y_POLE),
    ("DomeLight_1", "", "Z", Z_POLE),
    ("DomeLight_1", "Y", "Z", Y_POLE),
    ("DomeLight_1", "Z", "Y", Z_POLE),
]


@pytest.mark.parametrize(("kind", "pole_axis", "up", "expected"), FRAMES)
def test_frame_is_the_schemas_lat_long_map(kind, pole_axis, up, expected):
    found = dome(kind, f'uniform token poleAxis = "{pole_axis}"' if pole_axis else "", up)
    np.testing.assert_allclose(look(found, 0.5, 0.0), expected[0], atol=1e-12)
    np.testing.assert_allclose(look(found, 0.5, 0.5), expected[1], atol=1e-12)
    np.testing.assert_allclose(look(found, 0.25, 0.5), expected[2], atol=1e-12)


def test_rotation_counts_and_scale_and_translation_do_not():
    body = """double3 xformOp:translate = (9, 9, 9)
    float xformOp:rotateY = 90
    double3 xformOp:scale = (5, 2, 7)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateY", "xformOp:scale"]
"""
    found = dome(body=body)
    np.testing.assert_allclose(found.to_world @ found.to_world.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(look(found, 0.5, 0.5), [1, 0, 0], atol=1e-12)  # +Z turned by 90 degrees about Y


def test_z_pole_turns_before_the_transform():
    body = """float xformOp:rotateZ = 90
    uniform token[] xformOpOrder = ["xformOp:rotateZ"]
"""
    found = dome("DomeLight_1", body, "Z")
    np.testing.assert_allclose(look(found, 0.5, 0.5), [1, 0, 0], atol=1e-12)  # -Y turned by 90 degrees about Z
    np.testing.assert_allclose(look(found, 0.5, 0.0), [0, 0, 1], atol=1e-12)


PIXELS = np.arange(4 * 8 * 3, dtype=np.float32).reshape(4, 8, 3) / 64


def write_exr(path, pixels=PIXELS, names="RGB"):
    channels = {name: np.ascontiguousarray(pixels[..., i]) for i, name in enumerate(names)}
    OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, channels).write(str(path))


def write_other(path, pixels):
    rows, columns, channels = pixels.shape
    output = OpenImageIO.ImageOutput.create(str(path))
    output.open(str(path), OpenImageIO.ImageSpec(columns, rows, channels, str(pixels.dtype)))
    output.write_image(pixels)
    output.close()


def dome_with(path, body: str = "") -> str:
    return f'def DomeLight "D"\n{{\nasset inputs:texture:file = @{path}@\n{body}\n}}\n' + CUBE


def test_exr_is_read_as_it_is_with_row_0_on_top(tmp_path):
    write_exr(tmp_path / "sky.exr")
    scene = load(dome_with(tmp_path / "sky.exr", "float inputs:intensity = 2\ncolor3f inputs:color = (1, 0.5, 0.25)"))
    assert scene.warnings == ()
    picture = scene.lights[0].picture
    assert picture.dtype == np.float32
    np.testing.assert_array_equal(picture, PIXELS)
    np.testing.assert_allclose(scene.lights[0].radiance, [2, 1, 0.5])


def test_half_float_rgba_and_grey_exr(tmp_path):
    rgba = np.concatenate([PIXELS, np.full((4, 8, 1), 0.5, np.float32)], axis=-1).astype(np.float16)
    write_exr(tmp_path / "rgba.exr", rgba, "RGBA")
    np.testing.assert_array_equal(read_picture(str(tmp_path / "rgba.exr")), PIXELS)
    write_exr(tmp_path / "grey.exr", PIXELS[..., :1], "Y")
    np.testing.assert_array_equal(read_picture(str(tmp_path / "grey.exr")), np.repeat(PIXELS[..., :1], 3, axis=-1))


def test_radiance_hdr_is_linear(tmp_path):
    write_other(tmp_path / "sky.hdr", PIXELS)
    picture = load(dome_with(tmp_path / "sky.hdr")).lights[0].picture
    np.testing.assert_allclose(picture, PIXELS, atol=1.5 / 128)  # shared exponent: 8 bits of the largest component


def test_eight_bit_pictures_are_srgb_and_sixteen_bit_ones_linear(tmp_path):
    write_other(tmp_path / "sky.png", np.full((2, 4, 3), 188, np.uint8))
    np.testing.assert_allclose(read_picture(str(tmp_path / "sky.png")), 0.5029, atol=1e-4)
    write_other(tmp_path / "deep.png", np.full((2, 4, 3), 32768, np.uint16))
    np.testing.assert_allclose(read_picture(str(tmp_path / "deep.png")), 32768 / 65535, atol=1e-6)


def test_srgb_transfer_function_at_known_points():
    values = np.array([0.0, 0.04045, 0.5, 1.0], np.float32)
    np.testing.assert_allclose(srgb_to_linear(values), [0, 0.0031308, 0.2140411, 1], atol=1e-6)


def test_picture_inside_a_usdz_package_is_found(tmp_path):
    write_exr(tmp_path / "sky.exr")
    stage = Usd.Stage.CreateNew(str(tmp_path / "in.usda"))
    UsdLux.DomeLight.Define(stage, "/D").CreateTextureFileAttr(Sdf.AssetPath("./sky.exr"))
    UsdGeom.Cube.Define(stage, "/C")
    stage.Save()
    assert UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(tmp_path / "in.usda")), str(tmp_path / "out.usdz"))
    (tmp_path / "sky.exr").unlink()
    scene = load_stage(tmp_path / "out.usdz")
    assert scene.warnings == ()
    np.testing.assert_array_equal(scene.lights[0].picture, PIXELS)


def test_texels_that_are_no_radiance_become_zero_with_a_warning(tmp_path):
    pixels = PIXELS.copy()
    pixels[0, 0, 1], pixels[1, 2, 0], pixels[3, 7, 2] = np.nan, -np.inf, -1
    write_exr(tmp_path / "sky.exr", pixels)
    scene = load(dome_with(tmp_path / "sky.exr"))
    expected = PIXELS.copy()
    expected[0, 0] = expected[1, 2] = expected[3, 7] = 0
    np.testing.assert_array_equal(scene.lights[0].picture, expected)
    assert mentions(scene, "/D", "3 texels")


def test_a_sun_beyond_half_precision_has_the_largest_finite_value(tmp_path):
    """Infinite channels alone; with a NaN beside it, or nothing finite, the texel is black."""
    pixels = PIXELS.copy()
    pixels[1, 2], pixels[2, 3, 0], pixels[0, 0] = np.inf, np.inf, (np.nan, np.inf, 1)
    pixels[3, 1, 2] = 40
    write_exr(tmp_path / "sky.exr", pixels)
    scene = load(dome_with(tmp_path / "sky.exr"))
    expected = pixels.copy()
    expected[1, 2], expected[2, 3, 0], expected[0, 0] = 40, 40, 0
    np.testing.assert_array_equal(scene.lights[0].picture, expected)
    assert mentions(scene, "/D", "3 texels of", "are infinite; its largest finite value is used there")
    assert mentions(scene, "/D", "1 texels of", "negative or not finite")
    write_exr(tmp_path / "sky.exr", np.full_like(PIXELS, np.inf))
    scene = load(dome_with(tmp_path / "sky.exr"))
    assert not scene.lights[0].picture.any()


def test_missing_broken_and_odd_pictures_leave_the_plain_color_with_one_warning(tmp_path):
    (tmp_path / "noise.exr").write_bytes(b"\x76\x2f\x31\x01" + b"\x00" * 40)
    (tmp_path / "noise.hdr").write_bytes(b"not a picture at all")
    (tmp_path / "empty.exr").touch()
    (tmp_path / "folder.exr").mkdir()
    write_exr(tmp_path / "sky.exr")
    odd = 'token inputs:texture:format = "fishEye"'
    for name, body, word in (
        ("nowhere.exr", "", "nowhere.exr does not exist"),
        ("noise.exr", "", f"plain color: {tmp_path / 'noise.exr'} cannot be decoded: damaged OpenEXR file"),
        ("noise.hdr", "", f"plain color: {tmp_path / 'noise.hdr'} cannot be decoded"),
        ("empty.exr", "", f"plain color: {tmp_path / 'empty.exr'} is empty"),
        ("folder.exr", "", f"plain color: {tmp_path / 'folder.exr'} cannot be opened"),
        ("sky.exr", odd, "fishEye"),
    ):
        scene = load(dome_with(tmp_path / name, body + "\nfloat inputs:intensity = 3"))
        assert scene.lights[0].picture is None
        np.testing.assert_allclose(scene.lights[0].radiance, 3.0)
        assert mentions(scene, "/D", word), scene.warnings
        assert len(scene.warnings) == 1


def test_exr_without_color_is_a_picture_error(tmp_path):
    write_exr(tmp_path / "depth.exr", PIXELS[..., :1], "Z")
    with pytest.raises(PictureError, match="neither R, G, B nor Y"):
        read_picture(str(tmp_path / "depth.exr"))
