"""Glass against Mitsuba 3: a block over a floor, under a wide lamp and a sky."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scenes import box_faces, camera, quads, scene

import warpmis
from warpmis.scene import DomeLight, Material, RectLight, Scene

mi = pytest.importorskip("mitsuba")

from peer.mitsuba_scene import reference_image  # noqa: E402
from peer.test_mitsuba import BLOCK_BOUND, MEAN_BOUND, Image, block_errors, mean_errors  # noqa: E402

pytestmark = pytest.mark.peer

SIDE = 36  # [pixel]
# Paths through a pane are shorter by a bounce here than there.
MAX_DEPTH = 16
SPP = 4096
GLASS = {
    "dielectric": Material(path="/glass", transmission=1.0, roughness=0.0, ior=1.5),
    "roughdielectric": Material(path="/glass", transmission=1.0, roughness=0.45, ior=1.5),
    "very rough, tinted": Material(
        path="/glass", transmission=1.0, roughness=0.8, ior=1.33, transmission_color=(0.9, 0.6, 0.4)
    ),
    "thindielectric": Material(path="/glass", transmission=1.0, roughness=0.0, ior=1.5, thin_walled=True),
}


def still_life(name: str) -> Scene:
    floor = np.array([(-3, 0, 3), (3, 0, 3), (3, 0, -3), (-3, 0, -3)], dtype=np.float32)
    stripes = [
        (floor * np.array([1 / 6, 1, 1], np.float32) + np.array([k - 2.5, 0, 0], np.float32), 1 + k % 2)
        for k in range(6)
    ]
    block = [(face, 0) for face in box_faces((-0.8, 0.2, -0.6), (0.8, 1.1, 0.7), inward=False)]
    materials = [
        GLASS[name],
        Material(path="/light", diffuse_color=(0.8, 0.8, 0.7), lambertian=True),
        Material(path="/dark", diffuse_color=(0.1, 0.2, 0.4), lambertian=True),
    ]
    lamp = RectLight(
        "/lamp", np.array([0.0, 4.0, 0.0]), np.array([2.0, 0, 0]), np.array([0.0, 0.0, -2.0]), 2.0 * np.ones(3)
    )
    sky = DomeLight("/sky", np.eye(3), 0.5 * np.ones(3))
    view = camera((1.5, 1.8, 3.0), (0, 0.5, 0), half_width=0.5)
    return scene(quads([*stripes, *block]), materials, [lamp, sky], view, pixels=SIDE)


@cache
def reference(name: str) -> tuple[Image, Image]:
    """The mean of two of Mitsuba's pictures, and its noise."""
    first, second = (
        reference_image(still_life(name), spp=SPP, max_depth=MAX_DEPTH, width=SIDE, height=SIDE, seed=seed)
        for seed in (1, 2)
    )
    return 0.5 * (first + second), 0.5 * (first - second)


@pytest.mark.parametrize("method", ["nee", "balance"])
@pytest.mark.parametrize("name", GLASS)
def test_same_glass_as_mitsuba(name: str, method: str) -> None:
    truth, noise = reference(name)
    assert mean_errors(noise, truth).max() < 0.4 * MEAN_BOUND
    assert np.quantile(block_errors(noise, truth), 0.95) < 0.6 * BLOCK_BOUND
    difference = warpmis.render(still_life(name), spp=SPP, max_depth=MAX_DEPTH, method=method, seed=3).image - truth
    assert mean_errors(difference, truth).max() < MEAN_BOUND
    assert np.quantile(block_errors(difference, truth), 0.95) < BLOCK_BOUND
