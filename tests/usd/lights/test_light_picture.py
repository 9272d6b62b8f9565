"""Pictures of rect lights, and of domes in layouts other than lat-long."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from usd.pictures import write
from usd.stages import load, mentions, stage_of

import warpmis

CUBE = 'def Cube "C"\n{\n}\n'
# Upper left red, upper right green, lower left blue, lower right white.
CORNERS = np.array([[[1, 0, 0], [0, 1, 0]], [[0, 0, 1], [1, 1, 1]]], float)


@pytest.mark.parametrize("mirror", [1, -1])
def test_a_rect_light_shows_its_picture_upright_to_whom_it_shines_at(mirror: int, tmp_path: Path) -> None:
    """The schema: the picture's first texel is at the local (+X, +Y), whose left and right a mirroring swaps."""
    path = write(tmp_path / "corners.exr", np.repeat(np.repeat(CORNERS, 8, axis=0), 8, axis=1))
    text = f"""def RectLight "L" {{
    float inputs:intensity = 3
    asset inputs:texture:file = @{path}@
    double3 xformOp:scale = ({mirror}, 1, 1)
    uniform token[] xformOpOrder = ["xformOp:scale"]
}}
def Camera "Camera" {{
    float focalLength = 2
    float horizontalAperture = 1
    float verticalAperture = 1
    double3 xformOp:translate = (0, 0, -2)
    float xformOp:rotateY = 180
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateY"]
}}
"""
    image = warpmis.render(stage_of(text), width=4, spp=4, method="nee").image
    seen = image[[0, 0, 3, 3], [0, 3, 0, 3]].reshape(2, 2, 3)
    np.testing.assert_allclose(seen, 3.0 * CORNERS[:, ::mirror], rtol=1e-5)


def test_a_picture_that_is_not_there_is_one_warning_and_the_light_stays_plain(tmp_path: Path) -> None:
    scene = load('def RectLight "L" {\n asset inputs:texture:file = @none.exr@\n}\n' + CUBE)
    assert mentions(scene, "/L", "plain color", "none.exr")
    assert scene.lights[0].control.picture is None


def glow(d: np.ndarray) -> np.ndarray:
    """A smooth environment, different in all directions, of directions of shape (..., 3)."""
    return 0.5 + 0.3 * d + 0.1 * d[..., [1, 2, 0]] * d


def places(rows: int, columns: int) -> tuple[np.ndarray, np.ndarray]:
    """x to the right and y upwards of the texels' centres, in [-1, 1]."""
    x, y = np.meshgrid((np.arange(columns) + 0.5) / columns, (np.arange(rows) + 0.5) / rows)
    return 2 * x - 1, 1 - 2 * y


def mirrored_ball(size: int = 256) -> np.ndarray:
    """What a camera that looks along -Z sees in a mirror ball, by the law of reflection."""
    x, y = places(size, size)
    normal = np.stack([x, y, np.sqrt(np.maximum(1 - x * x - y * y, 0))], axis=-1)
    view = np.array([0.0, 0.0, -1.0])
    reflected = view - 2 * (normal @ view)[..., None] * normal
    return glow(reflected / np.maximum(np.linalg.norm(reflected, axis=-1, keepdims=True), 1e-9))


def angular(size: int = 256) -> np.ndarray:
    x, y = places(size, size)
    r = np.hypot(x, y)
    sine = np.sin(np.pi * np.minimum(r, 1)) / r
    return glow(np.stack([sine * x, sine * y, np.cos(np.pi * np.minimum(r, 1))], axis=-1))


def vertical_cross(size: int = 64) -> np.ndarray:
    """A cube folded about a viewer who looks along +Z with +Y up, and so has -X on the right."""
    x, y = places(size, size)
    one = np.ones_like(x)
    faces = {(0, 1): (-x, one, -y), (1, 0): (one, y, x), (1, 1): (-x, y, one), (1, 2): (-one, y, -x),
             (2, 1): (-x, -one, y), (3, 1): (-x, -y, -one)}  # fmt: skip
    cross = np.zeros((4 * size, 3 * size, 3))
    for (row, column), parts in faces.items():
        d = np.stack(parts, axis=-1)
        d = glow(d / np.linalg.norm(d, axis=-1, keepdims=True))
        cross[row * size : (row + 1) * size, column * size : (column + 1) * size] = d
    return cross


LAYOUTS = {"mirroredBall": mirrored_ball, "angular": angular, "cubeMapVerticalCross": vertical_cross}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_layout_becomes_the_same_environment(layout: str, tmp_path: Path) -> None:
    path = write(tmp_path / "sky.exr", LAYOUTS[layout]())
    text = f'def DomeLight "L" {{\nasset inputs:texture:file = @{path}@\ntoken inputs:texture:format = "{layout}"\n}}\n'
    scene = load(text + CUBE)
    assert scene.warnings == ()
    picture = scene.lights[0].picture
    rows, columns = picture.shape[:2]
    v, u = np.meshgrid((np.arange(rows) + 0.5) / rows, (np.arange(columns) + 0.5) / columns, indexing="ij")
    d = np.stack(
        [np.sin(np.pi * v) * np.sin(2 * np.pi * u), np.cos(np.pi * v), -np.sin(np.pi * v) * np.cos(2 * np.pi * u)], -1
    )
    # A ball shows the direction behind it, -Z, in its rim alone, stretched around it: what no texel resolves.
    shown = d[..., 2] > -0.98 if layout == "mirroredBall" else np.ones(d.shape[:2], bool)
    np.testing.assert_allclose(picture[shown], glow(d)[shown], atol=0.02)
