"""Chosen by a tree, lights make the same picture as weighed one by one: paired t-tests, Sidak-corrected.

The kernels with a tree that all tests share serve all cases: they go by it where the scene has been uploaded with one.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any
from unittest import mock

import numpy as np
import pytest
import scenes
from numpy.typing import NDArray
from statistical.estimates import REGIONS, block_means, caught_bias, paired_p_values
from stats import sidak
from superset import TREES

import warpmis
from warpmis.rendering.render import Uploads
from warpmis.scene import (
    CylinderLight,
    DiskLight,
    DistantLight,
    DomeLight,
    Light,
    Material,
    Prim,
    RectLight,
    Scene,
    SphereLight,
    features,
)
from warpmis.scene.light_control import LightControl, Shaping

SEEDS = 24
WAYS: dict[str, dict[str, Any]] = {
    "next-event": {"method": "nee"},
    "light": {"method": "balance"},
    "area and dome": {"method": "balance", "strategies": ("bsdf", "area", "dome")},
}
DOWN_U, DOWN_V = np.array([0.12, 0.0, 0.0]), np.array([0.0, 0.0, -0.12])
GLOW = Material(path="/glow", diffuse_color=(0.0, 0.0, 0.0), emissive_color=(4.0, 3.0, 2.0), lambertian=True)


def hall(lights: list[Light], double_sided: bool = False) -> Scene:
    """A room without its front wall, a shut crate in it, and four panes that glow, of which one is in the crate."""
    walls = scenes.box_faces((-1, 0, -1), (1, 2, 1), inward=True)
    crate = scenes.box_faces((-0.5, 0.2, -0.6), (0.3, 0.9, 0.1), inward=False)
    panes = [
        np.array([(x - 0.1, y, z - 0.1), (x + 0.1, y, z - 0.1), (x + 0.1, y, z + 0.1), (x - 0.1, y, z + 0.1)])
        for x, y, z in [(-0.7, 1.8, 0.3), (0.7, 1.7, -0.4), (0.6, 1.1, 0.2), (-0.1, 0.5, -0.2)]
    ]
    faces = list(zip(walls, [0, 0, 2, 0, 1, -1], strict=True)) + [(face, 0) for face in crate]
    geometry = scenes.quads([(face, m) for face, m in faces if m >= 0] + [(pane, 3) for pane in panes])
    materials = [scenes.WHITE, scenes.RED, scenes.METAL, GLOW]
    view = scenes.camera((0, 1, 0.95), (0, 0.8, -1), half_width=0.8)
    made = scenes.scene(geometry, materials, lights, view, pixels=18)
    return replace(made, prims=(*made.prims[:3], Prim("/glow", double_sided)))


def lamps() -> list[Light]:
    """One of each kind at a distance, and one shut in the crate."""
    white = np.ones(3)
    return [
        RectLight("/rect", np.array([-0.4, 1.9, -0.4]), DOWN_U, DOWN_V, 12.0 * white),
        DiskLight("/disk", np.array([0.4, 1.9, 0.4]), DOWN_U, 0.5 * DOWN_V + 0.3 * DOWN_U, 9.0 * white),
        SphereLight("/sphere", np.array([0.5, 1.2, -0.7]), 0.08, np.array([9.0, 6.0, 3.0])),
        CylinderLight("/tube", np.array([-0.8, 1.2, -0.3]), np.array([0.0, 0.3, 0.1]), 0.03, 8.0 * white),
        SphereLight("/shut in", np.array([-0.1, 0.7, -0.3]), 0.1, 40.0 * white),
    ]


def infinite() -> list[Light]:
    direction = np.array([0.1, 0.5, 1.0]) / np.linalg.norm([0.1, 0.5, 1.0])
    return [DistantLight("/sun", direction, 0.05, 20.0 * np.ones(3)), DomeLight("/sky", np.eye(3), 0.3 * np.ones(3))]


def controlled() -> list[Light]:
    """Lamps that do not reach all prims, that not all prims shade, and that shine in a cone."""
    reaches, casters = np.array([True, False, True, True]), np.array([False, True, True, True])
    axis_down = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # its -Z is the world's -Y
    controls = [
        LightControl(illuminates=reaches),
        LightControl(shadow_casters=casters),
        LightControl(shaping=Shaping(axis_down, cone_angle=0.6, cone_softness=0.5)),
        LightControl(illuminates=~reaches, diffuse=0.5),
        LightControl(shadow_casters=casters),
    ]
    return [replace(light, control=control) for light, control in zip(lamps(), controls, strict=True)]


def points() -> list[Light]:
    """Point lights, of which one is shut in the crate, one shines in a cone and two do not reach all prims."""
    axis_down = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    reaches = np.array([True, False, True, True])
    asked = {
        0: LightControl(shaping=Shaping(axis_down, cone_angle=0.5, cone_softness=0.5)),
        1: LightControl(illuminates=reaches),
        2: LightControl(illuminates=~reaches),
    }
    places = [(-0.6, 1.8, 0.0), (0.6, 1.6, 0.4), (0.0, 1.9, -0.8), (0.8, 0.3, 0.6), (-0.8, 0.4, 0.7), (-0.1, 0.7, -0.3)]
    return [
        SphereLight(f"/point{k}", np.array(place), 0.0, (1.0 + k) * np.ones(3), control=asked.get(k, LightControl()))
        for k, place in enumerate(places)
    ]


def delta_suns() -> list[Light]:
    direction = np.array([-0.2, 0.4, 1.0]) / np.linalg.norm([-0.2, 0.4, 1.0])
    return [DistantLight("/thin sun", direction, 0.0, 4.0 * np.ones(3))]


CASES = {
    "a light of each kind": hall(lamps()),
    "lights at infinity too": hall(lamps() + infinite()),
    "two-sided panes alone": hall([], double_sided=True),
    "links, shadow links and cones": hall(controlled()),
    "points": hall(points()),
    "points and suns among lamps": hall(points()[1:] + delta_suns() + controlled()),
}
NOISIEST = ("a light of each kind", "two-sided panes alone", "links, shadow links and cones")
LEVEL = sidak(0.01, len(CASES) * len(WAYS) * REGIONS)


def pictures(
    scene: Scene, few: int, settings: dict[str, Any], effects: features.Features = TREES, spp: int = 12
) -> NDArray[np.float64]:
    """Chosen by trees where there are more lights than `few`."""
    uploads = Uploads()
    with mock.patch.object(features, "FEW_LIGHTS", few):
        found = (
            warpmis.render(scene, spp=spp, seed=k, features=effects, uploads=uploads, **settings).image
            for k in range(SEEDS)
        )
        return np.array([block_means(image) for image in found])


def test_the_choice_by_glossy_lobes_changes_no_mean() -> None:
    """With trees and without, against a choice that knows irradiance alone; the back wall is of rough metal."""
    case = CASES["points and suns among lamps"]
    reference = pictures(case, 1000, {"method": "nee"}, replace(TREES, glossy_choice=False))
    level = sidak(0.01, 2 * REGIONS)
    for few in (0, 1000):
        found = pictures(case, few, {"method": "nee"})
        assert (found != reference).any()
        assert paired_p_values(found, reference).min() > level
        assert caught_bias(found, reference, level) < 0.03


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("case", CASES)
def test_a_tree_changes_no_mean(case: str, way: str) -> None:
    spp = 24 if case in NOISIEST else 12
    by_tree, one_by_one = (pictures(CASES[case], few, WAYS[way], spp=spp) for few in (0, 1000))
    assert (by_tree != one_by_one).any(), "the tree changes nothing: it was not taken"
    assert paired_p_values(by_tree, one_by_one).min() > LEVEL
    assert caught_bias(by_tree, one_by_one, LEVEL) < 0.03
