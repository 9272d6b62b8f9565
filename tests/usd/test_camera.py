"""Which camera, its frame and window, and the picture's resolution."""

from __future__ import annotations

import math

import numpy as np
import pytest
from usd.stages import load, mentions

from warpmis.errors import ConfigError, StageError

CUBE = 'def Cube "C"\n{\n}\n'


def camera(name: str = "Cam", body: str = "", ops: str = "", order: str = "") -> str:
    transform = f"{ops}\nuniform token[] xformOpOrder = {order}" if order else ""
    return f'def Camera "{name}"\n{{\n{body}\n{transform}\n}}\n'


SQUARE_LENS = "float horizontalAperture = 20\nfloat verticalAperture = 20\nfloat focalLength = 10"


def direction(found, x: float, y: float) -> np.ndarray:
    """The ray direction of a picture point, by scene.Camera's formula."""
    left, right, bottom, top = found.window
    return found.forward + (left + x * (right - left)) * found.right_axis + (top + y * (bottom - top)) * found.up_axis


def test_lens_in_tenths_of_a_unit_gives_the_window():
    scene = load(
        CUBE + camera(body="float horizontalAperture = 36\nfloat verticalAperture = 24\nfloat focalLength = 50"),
        width=300,
    )
    assert scene.resolution == (300, 200)
    np.testing.assert_allclose(scene.camera.window, [-0.36, 0.36, -0.24, 0.24], rtol=1e-6)
    np.testing.assert_allclose(scene.camera.forward, [0, 0, -1])
    np.testing.assert_allclose(direction(scene.camera, 0, 0), [-0.36, 0.24, -1], rtol=1e-6)  # upper left
    np.testing.assert_allclose(direction(scene.camera, 1, 1), [0.36, -0.24, -1], rtol=1e-6)


def test_aperture_offset_moves_the_window():
    body = SQUARE_LENS + "\nfloat horizontalApertureOffset = 5\nfloat verticalApertureOffset = -2"
    np.testing.assert_allclose(load(CUBE + camera(body=body)).camera.window, [-0.5, 1.5, -1.2, 0.8], rtol=1e-6)


def test_camera_is_placed_by_its_transform_without_its_scale():
    ops = "double3 xformOp:translate = (1, 2, 3)\nfloat xformOp:rotateY = 90\ndouble3 xformOp:scale = (4, 4, 4)"
    order = '["xformOp:translate", "xformOp:rotateY", "xformOp:scale"]'
    found = load(CUBE + camera(body=SQUARE_LENS, ops=ops, order=order)).camera
    np.testing.assert_allclose(found.position, [1, 2, 3])
    np.testing.assert_allclose(
        [found.right_axis, found.up_axis, found.forward], [[0, 0, -1], [0, 1, 0], [-1, 0, 0]], atol=1e-9
    )
    np.testing.assert_allclose(found.window, [-1, 1, -1, 1], rtol=1e-6)


THREE = (
    'def Xform "W"\n{\n' + camera("First") + camera("Cam") + "}\n" + 'def Xform "V"\n{\n' + camera("Cam") + "}\n" + CUBE
)


@pytest.mark.parametrize(
    ("asked", "found"),
    [("/V/Cam", "/V/Cam"), ("/W/Cam", "/W/Cam"), ("Cam", "/W/Cam"), ("V/Cam", "/V/Cam"), ("First", "/W/First")],
)
def test_camera_is_found_by_path_or_by_name(asked, found):
    assert load(THREE, camera=asked).camera.path == found


def test_camera_that_is_not_there_names_those_that_are():
    with pytest.raises(StageError, match=r"/W/Nope.*no such camera.*/W/First, /W/Cam, /V/Cam"):
        load(THREE, camera="/W/Nope")
    with pytest.raises(StageError, match=r"am.*cameras: /W/First"):
        load(THREE, camera="am")  # the end of a name is no name
    with pytest.raises(StageError, match="cameras: none"):
        load(CUBE, camera="/C")


def test_primary_camera_goes_before_the_first_and_the_first_is_noted():
    assert load(THREE + camera("main_cam")).camera.path == "/main_cam"
    scene = load(THREE)
    assert scene.camera.path == "/W/First"
    assert any("/W/First" in note and "3 cameras" in note for note in scene.notes)
    assert not any("camera" in note for note in load(camera() + CUBE).notes)


SETTINGS = """def RenderSettings "Settings"
{
    BODY
}
"""


def with_settings(body: str, lens: str = SQUARE_LENS) -> str:
    head = '(\n    renderSettingsPrimPath = "/Settings"\n)\n'
    return head + SETTINGS.replace("BODY", body) + camera("Other") + camera("Cam", lens) + CUBE


def test_render_settings_give_resolution_and_camera():
    scene = load(with_settings("int2 resolution = (320, 200)\nrel camera = </Cam>"))
    assert scene.resolution == (320, 200)
    assert scene.camera.path == "/Cam"


def test_arguments_beat_the_render_settings():
    text = with_settings("int2 resolution = (320, 200)\nrel camera = </Cam>")
    assert load(text, camera="/Other").camera.path == "/Other"
    assert load(text, width=64).resolution == (64, 64)  # height from the aperture


def test_render_settings_by_path_without_metadata():
    text = SETTINGS.replace("BODY", "int2 resolution = (32, 20)") + camera() + CUBE
    assert load(text).resolution[0] == 960
    assert load(text, render_settings="/Settings").resolution == (32, 20)
    for missing in ("/Nope", "/C", "Settings"):
        with pytest.raises(StageError, match="no RenderSettings prim"):
            load(text, render_settings=missing)


def test_render_settings_that_name_nothing_are_warnings():
    scene = load('(\n    renderSettingsPrimPath = "/Nope"\n)\n' + camera() + CUBE)
    assert mentions(scene, "/Nope", "renderSettingsPrimPath")
    scene = load(with_settings("rel camera = </Nope>\nint2 resolution = (0, 5)"))
    assert mentions(scene, "/Settings", "/Nope")
    assert mentions(scene, "/Settings", "0 x 5")
    assert scene.camera.path == "/Other"
    assert scene.resolution[0] == 960


# the aperture is square with half-width 1, the picture 2 : 1
POLICIES = {
    "expandAperture": (2, 1),
    "cropAperture": (1, 0.5),
    "adjustApertureWidth": (2, 1),
    "adjustApertureHeight": (1, 0.5),
    "adjustPixelAspectRatio": (1, 1),
}


@pytest.mark.parametrize("policy", POLICIES)
@pytest.mark.parametrize("tall", [False, True])
def test_aspect_ratio_conform_policies(policy, tall):
    resolution = "(100, 200)" if tall else "(200, 100)"
    text = with_settings(
        f'int2 resolution = {resolution}\nuniform token aspectRatioConformPolicy = "{policy}"\nrel camera = </Cam>'
    )
    _, half_width, _, half_height = load(text).camera.window
    wide, high = POLICIES[policy]
    expected = (wide, high)
    if tall:
        expected = {"adjustApertureWidth": (0.5, 1), "adjustApertureHeight": (1, 2)}.get(policy, (high, wide))
    np.testing.assert_allclose([half_width, half_height], expected, rtol=1e-6)


def test_default_policy_expands_and_pixel_aspect_ratio_counts():
    text = with_settings("int2 resolution = (200, 100)\nfloat pixelAspectRatio = 2\nrel camera = </Cam>")
    np.testing.assert_allclose(load(text).camera.window, [-4, 4, -1, 1], rtol=1e-6)


def test_width_and_default_resolution_follow_the_aperture():
    four_thirds = "float horizontalAperture = 20.955\nfloat verticalAperture = 15.71625"
    assert load(CUBE + camera(body=four_thirds), width=640).resolution == (640, 480)
    assert load(CUBE + camera()).resolution == (960, 700)  # usdrecord: 960 / (20.955 / 15.2908), cut to whole pixels
    assert load(CUBE + camera(), width=1).resolution == (1, 1)
    with pytest.raises(ConfigError, match="width"):
        load(CUBE, width=0)


@pytest.mark.parametrize("up", ["Y", "Z"])
def test_stage_without_camera_is_framed_as_usdrecord_does(up):
    box = """def Xform "X"
{
    double3 xformOp:translate = (10, 20, 30)
    double3 xformOp:scale = (1, 2, 3)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
    def Cube "C"
    {
    }
}
"""
    scene = load(f'(\n    upAxis = "{up}"\n)\n' + box)
    found = scene.camera
    assert found.path == ""
    assert any("no camera" in note for note in scene.notes)
    half_view = math.atan(20.955 / 2 / 50)
    if up == "Y":
        distance = math.hypot(1, 2) / math.tan(half_view) + 3
        np.testing.assert_allclose(found.position, [10, 20, 30 + distance], rtol=1e-6)
        np.testing.assert_allclose([found.forward, found.up_axis], [[0, 0, -1], [0, 1, 0]], atol=1e-9)
    else:
        distance = math.hypot(1, 3) / math.tan(half_view) + 2
        np.testing.assert_allclose(found.position, [10, 20 - distance, 30], rtol=1e-6)
        np.testing.assert_allclose([found.forward, found.up_axis], [[0, 1, 0], [0, 0, 1]], atol=1e-9)


def test_orthographic_aperture_is_the_window_in_tenths_of_a_unit():
    body = 'token projection = "orthographic"\nfloat focalLength = 0\n' + SQUARE_LENS.replace(
        "float focalLength = 10", ""
    )
    found = load(CUBE + camera(body=body)).camera
    assert found.orthographic
    np.testing.assert_allclose(found.window, [-1, 1, -1, 1], rtol=1e-6)


def test_lens_radius_follows_from_the_f_number():
    body = "float focalLength = 50\nfloat fStop = 2\nfloat focusDistance = 7"
    found = load(CUBE + camera(body=body)).camera
    assert (found.lens_radius, found.focus_distance) == (pytest.approx(5.0 / 4.0), 7.0)
    assert load(CUBE + camera(body=body.replace("fStop = 2", "fStop = 0"))).camera.lens_radius == 0.0
    switched_off = load(with_settings("bool disableDepthOfField = 1\nrel camera = </Cam>", lens=body))
    assert switched_off.camera.lens_radius == 0.0
    assert not switched_off.warnings


@pytest.mark.parametrize(
    ("body", "word"),
    [
        ('token projection = "orthographic"\nfloat fStop = 2.8\nfloat focusDistance = 1', "fStop"),
        ("float fStop = 2.8", "focusDistance"),
        ("float fStop = nan\nfloat focusDistance = 1", "fStop"),
        ("float fStop = -1\nfloat focusDistance = 1", "fStop"),
        ("float exposure = 1000", "exposure"),
        ("float exposure:fStop = 0", "exposure"),
        ("float2 clippingRange = (3, 2)", "clippingRange"),
        ("float2 clippingRange = (nan, 2)", "clippingRange"),
        ("float4[] clippingPlanes = [(0, 0, 0, 1)]", "clipping plane"),
        ("float4[] clippingPlanes = [(0, nan, 0, 1)]", "clipping plane"),
    ],
)
def test_what_cannot_be_honoured_is_one_warning(body, word):
    scene = load(camera(body=body) + CUBE)
    assert mentions(scene, "/Cam", word)
    assert len(scene.warnings) == 1
    found = scene.camera
    assert (found.lens_radius, found.exposure, len(found.clipping_planes)) == (0.0, 1.0, 0)


def test_clipping_planes_are_in_world_space_about_the_camera():
    """Moved by (5, 0, 0) and turned about Y by 90 degrees: what was -Z, ahead, is -X."""
    body = "float4[] clippingPlanes = [(0, 0, -2, -4)]"
    ops = "double3 xformOp:translate = (5, 0, 0)\nfloat xformOp:rotateY = 90"
    found = load(CUBE + camera(body=body, ops=ops, order='["xformOp:translate", "xformOp:rotateY"]')).camera
    np.testing.assert_allclose(found.clipping_planes, [[-1, 0, 0, -2]], atol=1e-6)


@pytest.mark.parametrize(("near", "far", "planes"), [(2, 100, 0), (4.5, 100, 1), (2, 5, 1), (4.5, 5, 2)])
def test_ends_of_the_clipping_range_count_where_something_lies_beyond(near, far, planes):
    """The cube reaches from 4 to 6 ahead."""
    ops = camera(
        body=f"float2 clippingRange = ({near}, {far})",
        ops="double3 xformOp:translate = (0, 0, 5)",
        order='["xformOp:translate"]',
    )
    assert len(load(CUBE + ops).camera.clipping_planes) == planes


@pytest.mark.parametrize(
    "text",
    [
        camera(body="float focalLength = 0"),
        camera(body="float horizontalAperture = nan"),
        camera(body="float horizontalAperture = 1e-30"),
        camera(ops="double3 xformOp:scale = (0, 1, 1)", order='["xformOp:scale"]'),
        camera(ops="double3 xformOp:translate = (nan, 1, 1)", order='["xformOp:translate"]'),
    ],
)
def test_impossible_cameras_are_errors_with_their_path(text):
    with pytest.raises(StageError, match=r"^/Cam: "):
        load(text + CUBE)


def test_invisible_camera_still_looks():
    scene = load(f'def Xform "H"\n{{\ntoken visibility = "invisible"\n{camera()}}}\n' + CUBE)
    assert scene.camera.path == "/H/Cam"


@pytest.mark.parametrize(
    ("window", "resolution", "frame"),
    [
        ((0, 0, 1, 1), (40, 20), (-2, 2, -1, 1)),
        ((0.5, 0.25, 1, 1), (20, 15), (0, 2, -0.5, 1)),
        ((0, 0, 0.26, 1), (10, 20), (-2, -1, -1, 1)),  # 10.4 columns: the centre of the eleventh lies at 10.5
        ((0, 0, 0.27, 1), (11, 20), (-2, -0.9, -1, 1)),
        ((-0.5, 0, 1.5, 1), (80, 20), (-4, 4, -1, 1)),  # overscan
        ((0.5, 0.5, 0.501, 0.501), (1, 1), (0, 0.1, 0, 0.1)),  # no centre: one pixel
    ],
)
def test_data_window_keeps_the_pixels_whose_centres_it_contains(window, resolution, frame):
    text = with_settings(f"int2 resolution = (40, 20)\nrel camera = </Cam>\nfloat4 dataWindowNDC = {window}")
    scene = load(text)
    assert scene.resolution == resolution
    np.testing.assert_allclose(scene.camera.window, frame, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("window", ["(0, 0, 0, 1)", "(0, 1, 1, 0)", "(0, 0, nan, 1)", "(0, 0, 1e9, 1)"])
def test_impossible_data_window_is_a_warning(window):
    scene = load(with_settings(f"int2 resolution = (40, 20)\nfloat4 dataWindowNDC = {window}"))
    assert mentions(scene, "/Settings", "dataWindowNDC")
    assert scene.resolution == (40, 20)


def test_unknown_conform_policy_is_a_warning():
    scene = load(with_settings('uniform token aspectRatioConformPolicy = "bend"'))
    assert mentions(scene, "/Settings", "bend")


def test_included_purposes_count_unless_purposes_are_asked_for():
    text = with_settings('uniform token[] includedPurposes = ["default", "proxy", "odd"]')
    for purpose in ("render", "proxy"):
        text += f'def Cube "{purpose}"\n{{\nuniform token purpose = "{purpose}"\n}}\n'
    assert {prim.path for prim in load(text).prims} == {"/C", "/proxy"}
    assert mentions(load(text), "/Settings", "odd")
    assert {prim.path for prim in load(text, purposes=("render",)).prims} == {"/C", "/render"}
    assert {prim.path for prim in load(text, purposes=()).prims} == {"/C"}
