"""Glass against closed forms: a furnace, a pane and a slab, Snell's shift, Beer's law, a lamp within.

One kernel a method serves all scenes here.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scenes
from numpy.typing import NDArray

import warpmis
from warpmis.scene import Camera, DomeLight, Light, Material, Scene, SphereLight

DOME = DomeLight("/sky", np.eye(3), np.ones(3))
LAMP = Material(path="/lamp", diffuse_color=(0.0, 0.0, 0.0), emissive_color=(1.0, 1.0, 1.0), lambertian=True)
BACKDROP = np.array([(-9, -9, -4), (9, -9, -4), (9, 9, -4), (-9, 9, -4)], dtype=np.float32)
METHODS = ("nee", "balance")


def glass(**inputs: Any) -> Material:
    return Material(path="/glass", transmission=1.0, **({"roughness": 0.0} | inputs))


def block(
    material: Material, lights: list[Light], view: Camera, backdrop: NDArray[Any] | None = None, thickness: float = 1.0
) -> Scene:
    """A block two units wide, `thickness` deep about z = 0, before a backdrop that glows."""
    half = thickness / 2
    faces = [(face, 0) for face in scenes.box_faces((-1, -1, -half), (1, 1, half), inward=False)]
    faces += [] if backdrop is None else [(backdrop, 1)]
    return scenes.scene(scenes.quads(faces), [material, LAMP], lights, view, pixels=8)


def straight_on(half_width: float = 0.02) -> Camera:
    return scenes.camera((0, 0, 3), (0, 0, 0), half_width=half_width)


def picture(scene: Scene, method: str = "nee", **settings: Any) -> NDArray[np.float32]:
    settings = {"spp": 64, "max_depth": 100} | settings
    result = warpmis.render(scene, method=method, **settings)
    assert result.stats["rejected_samples"] == 0
    return result.image


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("ior", [1.0, 1.0001, 1.5, 10.0])
@pytest.mark.parametrize("thin_walled", [False, True])
def test_smooth_glass_vanishes_in_a_furnace(ior: float, thin_walled: bool, method: str) -> None:
    scene = block(glass(ior=ior, thin_walled=thin_walled), [DOME], straight_on(0.3))
    np.testing.assert_allclose(picture(scene, method), 1.0, atol=2e-5)


@pytest.mark.parametrize("ior", [1.5, 2.0])
def test_slab_lets_through_what_fresnel_says(ior: float) -> None:
    """2 n / (n^2 + 1), all reflections within counted. The standard error is 0.0005 and 0.0008."""
    scene = block(glass(ior=ior), [], straight_on(), BACKDROP)
    assert picture(scene, spp=4096).mean() == pytest.approx(2 * ior / (ior**2 + 1), abs=0.0025)


def test_thin_walls_are_panes() -> None:
    """A box of two panes, each of which reflects R = 2 r / (1 + r), lets (1 - R) / (1 + R) through."""
    r = 0.04
    pane = 2 * r / (1 + r)
    scene = block(glass(ior=1.5, thin_walled=True), [], straight_on(), BACKDROP)
    assert picture(scene, spp=4096).mean() == pytest.approx((1 - pane) / (1 + pane), abs=0.003)


def test_light_samples_go_straight_through_panes() -> None:
    """A small lamp lights a floor through a pane: no path could find it by chance."""
    lamp = SphereLight("/lamp", np.array([0.0, 2.0, 0.0]), 1e-4, np.full(3, 1e8))
    floor = np.array([(-2, 0, 2), (2, 0, 2), (2, 0, -2), (-2, 0, -2)], dtype=np.float32)
    pane = floor + np.array([0, 1, 0], dtype=np.float32)
    view = scenes.camera((0, 0.9, 0.0), (0, 0, 0), half_width=0.05)
    materials = [scenes.WHITE, glass(ior=1.5, thin_walled=True)]
    bare = scenes.scene(scenes.quads([(floor, 0)]), materials, [lamp], view, pixels=4)
    covered = scenes.scene(scenes.quads([(floor, 0), (pane, 1)]), materials, [lamp], view, pixels=4)
    r = 2 * 0.04 / 1.04
    through = picture(covered, max_depth=1).mean() / picture(bare, max_depth=1).mean()
    assert through == pytest.approx(1 - r, rel=1e-3)


def test_slab_shifts_what_is_behind_it() -> None:
    """At 45 degrees a slab of thickness t moves a ray by t (1 - tan(asin(sin 45 / n))) along its faces."""
    ior, thickness = 1.5, 1.0
    shift = thickness * (1.0 - np.tan(np.arcsin(np.sin(np.pi / 4) / ior)))
    glowing = np.array([(-90, -90, -4), (0, -90, -4), (0, 90, -4), (-90, 90, -4)], dtype=np.float32)
    slab = scenes.box_faces((-20, -20, -thickness / 2), (20, 20, thickness / 2), inward=False)
    geometry = scenes.quads([*((face, 0) for face in slab), (glowing, 1)])
    for unbent, glows in ((-shift - 0.01, True), (-shift + 0.01, False)):
        origin = np.array([unbent + 6.0, 0.0, 2.0])  # the ray would meet the plane z = -4 at x = unbent
        view = scenes.camera(origin, origin - np.array([1.0, 0.0, 1.0]), half_width=1e-4)
        scene = scenes.scene(geometry, [glass(ior=ior), LAMP], [], view, pixels=2)
        assert (picture(scene, max_depth=2, spp=256).mean() > 0.5) == glows


def test_beer_s_law() -> None:
    color = np.array([0.25, 0.5, 0.75])
    material = glass(ior=1.0, transmission_color=tuple(color), transmission_depth=2.0)
    scene = block(material, [], straight_on(), BACKDROP)
    np.testing.assert_allclose(picture(scene).mean((0, 1)), color**0.5, rtol=1e-3)


def test_without_depth_each_passage_tints() -> None:
    color = np.array([0.25, 0.5, 0.75])
    scene = block(glass(ior=1.0, transmission_color=tuple(color)), [], straight_on(), BACKDROP)
    np.testing.assert_allclose(picture(scene).mean((0, 1)), color**2, rtol=1e-3)


@pytest.mark.parametrize("method", METHODS)
def test_a_lamp_within_an_absorbing_block(method: str) -> None:
    """From outside it is exp(-a d) as bright as without the block, d the way within."""
    lamp = SphereLight("/lamp", np.zeros(3), 0.2, np.ones(3))
    material = glass(ior=1.0, transmission_color=(0.5, 0.5, 0.5), transmission_depth=1.0)
    scene = block(material, [lamp], straight_on(0.004), thickness=4.0)
    assert picture(scene, method).mean() == pytest.approx(0.5 ** (2.0 - 0.2), rel=2e-3)


@pytest.mark.parametrize("ior", [1.5, 10.0])
def test_a_lamp_shut_in_a_glass_box(ior: float) -> None:
    """Seen from outside through one interface, its radiance is (1 - r) / n^2: Veach (1997), section 5.2."""
    lamp = SphereLight("/lamp", np.zeros(3), 0.3, np.ones(3))
    scene = block(glass(ior=ior), [lamp], straight_on(0.01), thickness=2.0)
    r = ((ior - 1) / (ior + 1)) ** 2
    once = picture(scene, max_depth=1, spp=4096).mean()
    assert once * ior**2 == pytest.approx(1 - r, abs=0.01)
