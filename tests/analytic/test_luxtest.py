"""The luxtest stages, which animate one light's attributes frame by frame, against the schema's integrals: within 1 %.

The expectation reads the stage's attributes itself. Of each frame two points of the floor are rendered, without the
occluder beside it; the floor is made Lambertian, for the light is what is tested. Without the files (the folder
`luxtest` in WARPMIS_ASSETS) the tests are skipped.

Reference: https://github.com/pmolodo/luxtest
"""

from __future__ import annotations

import math
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scenes
from pxr import Usd, UsdGeom, UsdLux

import warpmis
from warpmis.scene import Material

FOLDER = Path(os.environ.get("WARPMIS_ASSETS", "missing")) / "luxtest" / "usd"
pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason="WARPMIS_ASSETS holds no luxtest")

WHITE = Material(diffuse_color=(1.0, 1.0, 1.0), lambertian=True)
POINTS = ((3.0, 0.0, -1.0), (2.5, 0.0, -2.0))
FRAMES = range(1, 46)  # from 46 on: an IES file that is not with the stages


def rendered(name: str, frame: int, point: tuple[float, float, float], spp: int) -> np.ndarray:
    """Irradiance of the floor at a point, shape (3,)."""
    scene = warpmis.load_stage(FOLDER / name, time=frame, mask=("/lights", "/floor_plane"))
    above = (point[0], point[1] + 0.02, point[2])
    view = scenes.camera(above, point, half_width=0.01)
    scene = replace(scene, camera=view, resolution=(8, 8), materials=(WHITE,) * len(scene.materials))
    return warpmis.render(scene, spp=spp, method="nee", max_depth=1).image.astype(float).mean(axis=(0, 1)) * math.pi


class Authored:
    """A light's attributes at one frame, straight from the stage."""

    def __init__(self, name: str, path: str, frame: int) -> None:
        self.stage = Usd.Stage.Open(str(FOLDER / name))
        self.prim = self.stage.GetPrimAtPath(path)
        self.frame = frame
        matrix = UsdGeom.Xformable(self.prim).ComputeLocalToWorldTransform(frame)
        self.axes, self.place = np.array(matrix)[:3, :3], np.array(matrix)[3, :3]

    def __getitem__(self, name: str):
        return self.prim.GetAttribute(f"inputs:{name}").Get(self.frame)

    @property
    def radiance(self) -> np.ndarray:
        color = np.array(self["color"]) * self["intensity"] * 2.0 ** self["exposure"]
        if self["enableColorTemperature"]:
            color = color * np.array(UsdLux.BlackbodyTemperatureAsRgb(min(self["colorTemperature"], 10000.0)))
        return color


def rect_irradiance(light: Authored, point: tuple[float, float, float]) -> np.ndarray:
    """Sum over the rectangle of L cos cos / d^2, with the schema's cone and focus, shape (3,)."""
    width, height = light["width"], light["height"]
    grid = (np.arange(300) + 0.5) / 300 - 0.5
    x, y = np.meshgrid(grid * width, grid * height)
    places = light.place + x[..., None] * light.axes[0] + y[..., None] * light.axes[1]
    towards = np.array(point) - places
    d2 = (towards**2).sum(axis=-1)
    cos_light = towards @ -light.axes[2] / np.sqrt(d2)
    cos_floor = np.maximum(-towards[..., 1], 0.0) / np.sqrt(d2)
    theta, cutoff = np.arccos(np.clip(cos_light, -1, 1)), math.radians(light["shaping:cone:angle"])
    softness = light["shaping:cone:softness"]
    t = np.clip((theta - (1 - softness) * cutoff) / max(softness * cutoff, 1e-9), 0, 1)
    cone = np.where(theta > cutoff, 0.0, 1 - t * t * (3 - 2 * t))
    share = (np.abs(cos_light) ** light["shaping:focus"])[..., None]
    focus = share + (1 - share) * np.array(light["shaping:focusTint"])
    form = np.maximum(cos_light, 0.0) * cos_floor / d2 * cone * width * height / grid.size**2
    size = width * height if light["normalize"] else 1.0
    return light.radiance / size * (form[..., None] * focus).sum(axis=(0, 1))


@pytest.mark.parametrize("frame", FRAMES)
def test_rect(frame: int) -> None:
    light = Authored("rect.usda", "/lights/rect_light", frame)
    for point in POINTS:
        expected = rect_irradiance(light, point)
        np.testing.assert_allclose(rendered("rect.usda", frame, point, 4096), expected, rtol=0.01, atol=1e-6)


@pytest.mark.parametrize("frame", range(1, 36))
def test_distant(frame: int) -> None:
    """E = L pi sin^2(angle / 2) cos t, of a cone that lies above the horizon; normalized, or of angle 0: L cos t."""
    light = Authored("distant.usda", "/lights/distant_light", frame)
    half = math.radians(light["angle"]) / 2
    size = 1.0 if light["normalize"] or half == 0.0 else math.pi * math.sin(half) ** 2
    expected = light.radiance * size * light.axes[2][1]
    np.testing.assert_allclose(rendered("distant.usda", frame, POINTS[0], 1024), expected, rtol=0.01)


def test_visible_rect() -> None:
    """A light of intensity 1 in view is a pixel of 1; its picture is not with the stage."""
    scene = warpmis.load_stage(FOLDER / "visibleRect.usda", time=1, width=64)
    image = warpmis.render(scene, spp=4, method="nee").image
    np.testing.assert_allclose(image[30:34, 30:34], 1.0, rtol=1e-5)
    assert any("dome_grid_2k.exr" in warning for warning in scene.warnings)
