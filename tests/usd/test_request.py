"""What callers ask in place of the RenderSettings is what the RenderSettings would give; nonsense is one sentence."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pxr import Usd
from usd.stages import load, stage_of

import warpmis
from warpmis.cli import main
from warpmis.errors import ConfigError, StageError
from warpmis.output.exr import read_exr
from warpmis.scene import Scene
from warpmis.usd import load_stage

# A lens with depth of field, an open shutter, a material for each purpose of bindings, and a proxy.
ROOM = """(
    renderSettingsPrimPath = "/Render"
)
def RenderSettings "Render"
{
    int2 resolution = (64, 32)
    %s
}
def Camera "Cam"
{
    float horizontalAperture = 36
    float verticalAperture = 24
    float focalLength = 50
    float fStop = 2
    float focusDistance = 5
    double shutter:open = 0
    double shutter:close = 0.5
}
def Cube "Cube" (
    prepend apiSchemas = ["MaterialBindingAPI"]
)
{
    rel material:binding = </Plain>
    rel material:binding:preview = </Preview>
}
def Material "Plain" {
    token outputs:surface.connect = </Plain/S.outputs:surface>
    def Shader "S"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (0.1, 0.2, 0.3)
        token outputs:surface
    }
}
def Material "Preview" {
    token outputs:surface.connect = </Preview/S.outputs:surface>
    def Shader "S"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (0.4, 0.5, 0.6)
        token outputs:surface
    }
}
def Sphere "Proxy"
{
    uniform token purpose = "proxy"
}
"""

# Each argument, what it is to be, and how RenderSettings author the same.
OVERRIDES: dict[str, tuple[Any, str]] = {
    "disable_depth_of_field": (True, "bool disableDepthOfField = 1"),
    "disable_motion_blur": (True, "bool disableMotionBlur = 1"),
    "pixel_aspect_ratio": (2.0, "float pixelAspectRatio = 2"),
    "aspect_ratio_conform_policy": ("cropAperture", 'token aspectRatioConformPolicy = "cropAperture"'),
    "data_window_ndc": ((0.25, 0.0, 0.75, 0.5), "float4 dataWindowNDC = (0.25, 0, 0.75, 0.5)"),
    "material_binding_purposes": (("preview", ""), 'uniform token[] materialBindingPurposes = ["preview", ""]'),
    "purposes": (("proxy",), 'uniform token[] includedPurposes = ["proxy"]'),
}
# What else RenderSettings may say, which an argument beats.
OTHERWISE = {
    "disable_depth_of_field": (False, "bool disableDepthOfField = 1"),
    "disable_motion_blur": (False, "bool disableMotionBlur = 1"),
    "pixel_aspect_ratio": (1.0, "float pixelAspectRatio = 3"),
    "aspect_ratio_conform_policy": ("expandAperture", 'token aspectRatioConformPolicy = "cropAperture"'),
    "data_window_ndc": ((0, 0, 1, 1), "float4 dataWindowNDC = (0, 0.5, 1, 1)"),
    "material_binding_purposes": (("full", ""), 'uniform token[] materialBindingPurposes = ["preview", ""]'),
    "purposes": (("render",), 'uniform token[] includedPurposes = ["proxy"]'),
}


def seen(scene: Scene) -> dict[str, Any]:
    """What of a scene the overrides may change, as plain values."""
    camera = {name: np.asarray(value).tolist() for name, value in vars(scene.camera).items() if name != "path"}
    prims = sorted({scene.prims[index].path for index in scene.geometry.prims})
    colors = sorted(str(scene.materials[index].diffuse_color) for index in scene.used_materials)
    return {"camera": camera, "resolution": scene.resolution, "prims": prims, "colors": colors}


@pytest.mark.parametrize("name", OVERRIDES)
def test_an_argument_does_what_the_render_settings_would(name: str) -> None:
    value, authored = OVERRIDES[name]
    plain, asked, said = load(ROOM % ""), load(ROOM % "", **{name: value}), load(ROOM % authored)
    assert seen(asked) == seen(said) != seen(plain)


@pytest.mark.parametrize("name", OTHERWISE)
def test_an_argument_beats_the_render_settings(name: str) -> None:
    value, authored = OTHERWISE[name]
    plain, said = load(ROOM % ""), load(ROOM % authored)
    assert seen(load(ROOM % authored, **{name: value})) == seen(plain) != seen(said)


def test_without_depth_of_field_and_motion_blur() -> None:
    open_, shut = load(ROOM % ""), load(ROOM % "", disable_depth_of_field=True, disable_motion_blur=True)
    assert open_.camera.lens_radius == pytest.approx(0.1 * 50 / (2 * 2)) and open_.camera.shutter == (0.0, 0.5)
    assert shut.camera.lens_radius == 0.0 and shut.camera.shutter == (0.0, 0.0)
    assert load(ROOM % "", data_window_ndc=(0.25, 0.0, 0.75, 0.5)).resolution == (32, 16)
    # The width asked for goes with the aperture's aspect, 36:24, and pixels of twice the width need twice the rows.
    assert load(ROOM % "", width=36, pixel_aspect_ratio=2.0).resolution == (36, 48)


@pytest.mark.parametrize(
    ("asked", "resolution"),
    [
        ({}, (64, 32)),
        ({"width": 36}, (36, 24)),
        ({"height": 24}, (36, 24)),
        ({"height": 1}, (1, 1)),
        ({"width": 36, "height": 36}, (36, 36)),
        ({"height": 24, "pixel_aspect_ratio": 2.0}, (18, 24)),
    ],
)
def test_size_of_the_picture(asked: dict[str, Any], resolution: tuple[int, int]) -> None:
    """The aperture is 36:24. Of a square picture the window is widened by the policy, expandAperture."""
    scene = load(ROOM % "", **asked)
    assert scene.resolution == resolution
    if resolution == (36, 36):
        left, right, bottom, top = scene.camera.window
        assert (right - left, top - bottom) == pytest.approx((0.72, 0.72))


def test_a_picture_of_a_height(tmp_path: Path) -> None:
    (tmp_path / "room.usda").write_text("#usda 1.0\n" + ROOM % "")
    result = warpmis.render(tmp_path / "room.usda", height=4, spp=1, method="nee")
    assert result.image.shape == (4, 6, 3)
    out = tmp_path / "out.exr"
    options = "--image-width 5 --imageHeight 7 --spp 1 --method nee --quiet".split()
    assert main(["render", str(tmp_path / "room.usda"), str(out), *options]) == 0
    assert read_exr(out)[0]["R"].shape == (7, 5)


def test_the_command_line_has_the_same_options(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`inspect` shows the camera that each makes; a value of argparse and one of Python end at one place."""
    (tmp_path / "room.usda").write_text("#usda 1.0\n" + ROOM % "")
    options = "--disable-depth-of-field --disableMotionBlur --pixel-aspect-ratio 2 --dataWindowNDC 0,0,0.5,1"
    options += " --aspect-ratio-conform-policy cropAperture --material-binding-purposes preview,allPurpose"
    assert main(["inspect", str(tmp_path / "room.usda"), *options.split()]) == 0
    text = capsys.readouterr().out
    scene = load_stage(
        tmp_path / "room.usda", disable_depth_of_field=True, disable_motion_blur=True, pixel_aspect_ratio=2,
        data_window_ndc=[0, 0, 0.5, 1], aspect_ratio_conform_policy="cropAperture",
        material_binding_purposes=["preview", ""],
    )  # fmt: skip
    assert f"{scene.resolution[0]} x {scene.resolution[1]} pixels" in text and scene.resolution == (32, 32)
    assert "window " + " ".join(f"{side + 0.0:.4g}" for side in scene.camera.window) in text
    assert "lens_radius 0" in text and "/Preview" in text and "/Plain" not in text


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"camera": 3}, "camera must be a prim's path as text, got 3"),
        ({"render_settings": ["/A"]}, "render settings must be a prim's path as text"),
        ({"product": 1.0}, "product must be a prim's path as text"),
        ({"time": "3"}, "time must be a finite number, a time code such as 12, got '3'"),
        ({"time": float("nan")}, "time must be a finite number"),
        ({"time": True}, "time must be a finite number"),
        ({"height": 0}, "image height must be from 1 to"),
        ({"width": "640"}, "image width must be a whole number from 1 to"),
        ({"purposes": "render"}, "purposes must be a list of texts, such as ['render'], not one text"),
        ({"purposes": ("magic",)}, "unknown purpose 'magic'; choose from default, guide, proxy, render"),
        ({"variants": "/A{b=c}"}, "variants must be a list of texts, such as ['/A{b=c}'], not one text"),
        ({"mask": [3]}, "mask must be a list of texts, got [3]"),
        ({"session_layer": 3}, "session layer must be a file's path, got 3"),
        ({"complexity": ["high"]}, "unknown complexity ['high']; choose from low, medium, high, veryhigh"),
        ({"disable_depth_of_field": "no"}, "disable depth of field must be True, False or None, got 'no'"),
        ({"disable_motion_blur": 1}, "disable motion blur must be True, False or None, got 1"),
        ({"pixel_aspect_ratio": 0.0}, "pixel aspect ratio must be a number above 0, got 0.0"),
        ({"pixel_aspect_ratio": float("inf")}, "pixel aspect ratio must be a number above 0, got inf"),
        ({"aspect_ratio_conform_policy": "fit"}, "unknown aspect ratio conform policy 'fit'; choose from adjust"),
        ({"data_window_ndc": (0, 0, 1)}, "data window must be four numbers xmin, ymin, xmax, ymax from -16 to 16"),
        ({"data_window_ndc": (1, 0, 0, 1)}, "data window must be four numbers"),
        ({"data_window_ndc": (0, 0, 1, 17)}, "data window must be four numbers"),
        ({"data_window_ndc": (0, 0, 1, float("nan"))}, "data window must be four numbers"),
        ({"data_window_ndc": 4}, "data window must be four numbers"),
        ({"material_binding_purposes": "full"}, "material binding purposes must be a list of texts"),
    ],
)
def test_nonsense_is_one_sentence(options: dict[str, Any], message: str) -> None:
    stage = stage_of(ROOM % "")
    for function in (load_stage, warpmis.render):
        with pytest.raises(ConfigError) as error:
            function(stage, **options)
        assert message in str(error.value) and "\n" not in str(error.value)


def test_numpy_numbers_are_numbers() -> None:
    scene = load(ROOM % "", time=np.float32(2), width=np.int64(12), pixel_aspect_ratio=np.float64(1))
    assert (scene.time, scene.resolution) == (2.0, (12, 8))


@pytest.mark.parametrize(
    ("source", "message"),
    [
        (3, "a stage is the path of a USD file, a Usd.Stage or a Scene, not int"),
        (None, "a stage is the path of a USD file, a Usd.Stage or a Scene, not NoneType"),
        (["a.usda"], "a stage is the path of a USD file, a Usd.Stage or a Scene, not list"),
        (Usd.Stage, "a stage is the path of a USD file, a Usd.Stage or a Scene, not class"),
        ("", "the stage's path is empty: name a USD file"),
        (".", ".: it is a folder: name a USD file"),
        (Path("/nowhere/a.usda"), "/nowhere/a.usda: there is no such file"),
        (b"/nowhere/a.usda", "/nowhere/a.usda: there is no such file"),
        ("\udcff.usda", "'\\udcff.usda': USD opens only files with UTF-8 names: rename it"),
    ],
)
def test_what_is_no_stage(source: Any, message: str) -> None:
    for function in (load_stage, warpmis.render):
        with pytest.raises(StageError) as error:
            function(source)
        assert str(error.value) == message


def test_every_override_is_tested() -> None:
    from warpmis.usd.request import Request

    new = {field.name for field in dataclasses.fields(Request)} & set(OVERRIDES)
    assert new == set(OVERRIDES) == set(OTHERWISE)
