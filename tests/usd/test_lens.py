"""A camera's lengths are in its own space: a stage that is scaled as a whole gives the same picture."""

from __future__ import annotations

import numpy as np
import pytest
from usd.stages import load, mentions

from warpmis import render

# A row of cubes that recede from the camera, under a dome and a lamp.
CUBES = "".join(
    f"""def Cube "C{i}"
{{
    color3f[] primvars:displayColor = [({0.2 + 0.2 * i}, 0.5, {0.8 - 0.2 * i})]
    double3 xformOp:translate = ({1.5 * i - 2}, {0.4 * i - 0.6}, {-3 * i})
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
"""
    for i in range(4)
)
CAMERAS = {
    "pinhole": "float focalLength = 30",
    "offset": "float focalLength = 30\nfloat horizontalApertureOffset = 4\nfloat verticalApertureOffset = -2",
    "depth of field": "float focalLength = 30\nfloat fStop = 0.6\nfloat focusDistance = 11",
    "clipping range": "float focalLength = 30\nfloat2 clippingRange = (9.3, 15.5)",
    "clipping planes": "float focalLength = 30\nfloat4[] clippingPlanes = [(1, 0, 0.1, 2), (0, -1, 0, 0.5)]",
    "orthographic": 'token projection = "orthographic"\nfloat horizontalAperture = 80\nfloat verticalAperture = 58.4',
    "orthographic, clipped": 'token projection = "orthographic"\nfloat horizontalAperture = 80\n'
    "float verticalAperture = 58.4\nfloat2 clippingRange = (9.3, 15.5)",
}


def world(body: str, scale: str) -> str:
    return f"""def Xform "World"
{{
    double3 xformOp:scale = {scale}
    uniform token[] xformOpOrder = ["xformOp:scale"]
    {CUBES}
    def DomeLight "Sky"
    {{
        float inputs:intensity = 0.6
    }}
    def SphereLight "Lamp"
    {{
        float inputs:intensity = 30
        double3 xformOp:translate = (3, 5, 6)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}
    def Camera "Eye"
    {{
        {body}
        double3 xformOp:translate = (0.5, 1, 10)
        float3 xformOp:rotateXYZ = (-4, 3, 2)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
    }}
}}
"""


def picture(text: str):
    return render(load(text, width=32), method="nee", spp=8, max_depth=2, device="cpu")


@pytest.mark.parametrize("lens", CAMERAS)
def test_the_picture_of_a_scaled_stage_is_that_of_the_stage(lens):
    expected = picture(world(CAMERAS[lens], "(1, 1, 1)"))
    assert 0.05 < expected.alpha.mean() < 0.9
    for factor in (0.01, 64.0):
        found = picture(world(CAMERAS[lens], f"({factor}, {factor}, {factor})"))
        differing = np.abs(found.image - expected.image).max(axis=-1) > 1e-3 * (1.0 + expected.image.max(axis=-1))
        assert differing.mean() < 0.01, factor  # rounding moves a ray across an edge here and there
        np.testing.assert_allclose(found.alpha.mean(), expected.alpha.mean(), rtol=1e-3)


def test_every_lens_changes_the_picture():
    """So that the test above cannot pass for lengths that count for nothing."""
    pictures = {lens: picture(world(body, "(1, 1, 1)")).image for lens, body in CAMERAS.items()}
    names = list(pictures)
    for i, one in enumerate(names):
        for other in names[i + 1 :]:
            assert (np.abs(pictures[one] - pictures[other]).max(axis=-1) > 0.01).mean() > 0.03, (one, other)


@pytest.mark.parametrize("scale", ["(-1, 1, 1)", "(1, -1, 1)", "(-2, -2, -2)", "(0.5, 2, 3)"])
@pytest.mark.parametrize("lens", ["pinhole", "offset", "clipping planes", "clipping range", "orthographic"])
def test_the_camera_of_a_mirrored_or_stretched_stage_sees_the_same_points(lens, scale):
    """Points in front of an unturned camera fall on the same places of the picture."""
    text = world(CAMERAS[lens], scale).replace("(-4, 3, 2)", "(0, 0, 0)")
    factors = np.array(eval(scale))
    plain, scaled = load(world(CAMERAS[lens], "(1, 1, 1)").replace("(-4, 3, 2)", "(0, 0, 0)")), load(text)
    points = np.random.default_rng(3).uniform([-3, -2, -12], [3, 2, 2], (50, 3))
    np.testing.assert_allclose(places(scaled.camera, points * factors), places(plain.camera, points), atol=1e-9)
    kept = [visible(camera, p) for camera, p in ((plain.camera, points), (scaled.camera, points * factors))]
    assert (kept[0] == kept[1]).all()
    if "clip" in lens:
        assert 0 < kept[0].sum() < 50


def places(camera, points: np.ndarray) -> np.ndarray:
    """Where points fall on the picture, shape (n, 2), (0, 0) its lower left corner and (1, 1) its upper right one."""
    along = points - camera.position
    depth = 1.0 if camera.orthographic else (along @ camera.forward)[:, None]
    seen = np.stack([along @ camera.right_axis, along @ camera.up_axis], axis=-1) / depth
    left, right, bottom, top = camera.window
    return (seen - [left, bottom]) / [right - left, top - bottom]


def visible(camera, points: np.ndarray) -> np.ndarray:
    planes = camera.clipping_planes
    return ((points - camera.position) @ planes[:, :3].T + planes[:, 3] >= 0).all(axis=1)


def test_lengths_of_a_scaled_camera():
    body = "float focalLength = 50\nfloat fStop = 2\nfloat focusDistance = 7\nfloat2 clippingRange = (9.3, 15.5)"
    found = load(world(body, "(3, 3, 3)")).camera
    assert found.lens_radius == pytest.approx(3 * 5.0 / 4.0)
    assert found.focus_distance == pytest.approx(21.0)
    np.testing.assert_allclose(found.clipping_planes[:, 3], [-3 * 9.3, 3 * 15.5], rtol=1e-6)


def test_a_sheared_camera_is_one_warning_and_looks_straight_ahead():
    shear = "matrix4d xformOp:transform = ((1, 0, 0, 0), (0.5, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))"
    text = world("", "(1, 1, 1)").replace("double3 xformOp:scale = (1, 1, 1)", shear)
    scene = load(text.replace('"xformOp:scale"', '"xformOp:transform"').replace("(-4, 3, 2)", "(0, 0, 0)"))
    assert mentions(scene, "/World/Eye", "shear")
    np.testing.assert_allclose(scene.camera.forward, [0, 0, -1], atol=1e-12)


def test_an_operation_that_cannot_be_read_is_left_out_of_the_cameras_transform():
    text = world("", "(2, 2, 2)").replace("float3 xformOp:rotateXYZ = (-4, 3, 2)", 'string xformOp:rotateXYZ = "a"')
    scene = load(text)
    assert mentions(scene, "/World/Eye", "left out", "TypeRotateXYZ")
    np.testing.assert_allclose(scene.camera.position, [1, 2, 20])
    np.testing.assert_allclose(scene.camera.forward, [0, 0, -1], atol=1e-12)
