"""AOVs of light: they add up to the picture, are what their names say, and change nothing of the picture."""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scenes

import warpmis
from warpmis.methods import METHODS
from warpmis.scene import Material, Scene, SphereLight
from warpmis.scene.light_control import LightControl

MIRROR = Material(path="/mirror", diffuse_color=(0.8, 0.8, 0.8), metallic=1.0, roughness=0.0)
PANE = Material(path="/pane", diffuse_color=(0.3, 0.5, 0.4), opacity=0.4)
GLOW = Material(path="/glow", emissive_color=(2.0, 1.0, 0.5))
SUMS = (
    ("emission", "direct", "indirect"),
    ("emission", "diffuse", "specular", "transmission"),
    ("light.key", "light.fill", "light.rest"),
    ("emission", "direct_diffuse", "direct_specular", "direct_transmission", "indirect"),
    ("glow", "no_glow"),
)
ASKED = (
    "emission", "direct", "indirect", "diffuse", "specular", "transmission", "direct_diffuse", "direct_specular",
    "direct_transmission", "lights", "glow=C.*O", "no_glow=C.*L", "key_lit=C..*<L.'key'>",
)  # fmt: skip


@functools.cache
def room() -> Scene:
    """Few lights, of every kind: near, at infinity and without extent, a surface that glows, a mirror, and a
    pane that lets paths through."""
    base = scenes.open_room(12)
    walls = scenes.box_faces((-1, 0, -1), (1, 2, 1), inward=True)
    faces = [(wall, m) for wall, m in zip(walls, [0, 0, 2, 0, 1, -1], strict=True) if m >= 0]
    faces += [(face, 3) for face in scenes.box_faces((-0.8, 0.2, -0.8), (-0.3, 0.9, -0.4), inward=False)]
    faces += [(face, 4) for face in scenes.box_faces((0.2, 0.3, -0.3), (0.6, 0.9, -0.29), inward=False)]
    faces += [(face, 5) for face in scenes.box_faces((0.5, 1.2, -0.8), (0.7, 1.4, -0.6), inward=False)[4:5]]
    lamp = replace(base.lights[0], control=LightControl(group="key"))
    bulb = SphereLight("/bulb", np.array([0.5, 1.0, 0.2]), 0.0, np.array([0.2, 0.1, 0.3]), LightControl(group="fill"))
    materials = [*base.materials, MIRROR, PANE, GLOW]
    return scenes.scene(scenes.quads(faces), materials, [lamp, *base.lights[1:], bulb], base.camera, 12)


def render(scene: Scene | None = None, **settings: Any) -> warpmis.RenderResult:
    return warpmis.render(scene or room(), **{"method": "nee", "spp": 32, **settings})


def picture(result: warpmis.RenderResult, *names: str) -> np.ndarray:
    return sum(result.aovs[name].astype(np.float64) for name in names)


# Those whose kernels the others do not have; nine seconds each for kernels.
QUICK = ("nee", "balance", "murray20", "guided")


@pytest.mark.parametrize(
    "method", [pytest.param(method, marks=[pytest.mark.slow] * (method not in QUICK)) for method in METHODS]
)
def test_aovs_add_up_and_change_nothing(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    settings = {"allocation": (0.3, 0.7)} if method == "fixed" else {}
    plain = render(method=method, **settings)
    result = render(method=method, aov=ASKED, **settings)
    np.testing.assert_array_equal(plain.image, result.image)
    np.testing.assert_array_equal(plain.allocation, result.allocation)
    # Of a control variate no light path is the source. What it is taken off is next-event estimation's picture.
    whole = render().image if METHODS[method].allocation == "control" else result.image
    for names in SUMS:
        np.testing.assert_allclose(picture(result, *names), whole, rtol=1e-5, atol=0.0, err_msg=str(names))
    assert all(picture.any() for name, picture in result.aovs.items() if "transmission" not in name)


def test_same_bits_for_any_threads() -> None:
    one, two = (render(aov=ASKED, threads=threads) for threads in (1, 2))
    for name in one.aovs:
        np.testing.assert_array_equal(one.aovs[name], two.aovs[name])


def test_direct_light_is_that_of_paths_of_one_bounce() -> None:
    """The same random numbers, so the same paths."""
    whole, short, nothing = (render(aov=ASKED, max_depth=depth) for depth in (8, 1, 0))
    np.testing.assert_allclose(picture(whole, "emission", "direct"), short.image, rtol=1e-5)
    np.testing.assert_allclose(whole.aovs["emission"], nothing.image, rtol=1e-5)
    assert not short.aovs["indirect"].any() and not nothing.aovs["direct"].any()


def with_controls(**of_lights: Any) -> Scene:
    lights = tuple(replace(light, control=replace(light.control, **of_lights)) for light in room().lights)
    prims = tuple(replace(prim, control=LightControl(**of_lights)) for prim in room().prims)
    return replace(room(), lights=lights, prims=prims)


def test_lobes_are_those_that_lights_tell_apart() -> None:
    """Lights that shine on one lobe alone show it alone; the random numbers are the same."""
    plain = render(aov=ASKED, max_depth=1)
    without = render(with_controls(diffuse=0.0), max_depth=1)
    np.testing.assert_allclose(picture(plain, "emission", "direct_specular"), without.image, rtol=1e-4, atol=1e-6)
    both = render(with_controls(diffuse=0.5, specular=3.0), aov=ASKED, max_depth=1)
    for name, factor in (("direct_diffuse", 0.5), ("direct_specular", 3.0)):
        np.testing.assert_allclose(both.aovs[name], factor * plain.aovs[name], rtol=1e-4, atol=1e-6)


def test_light_of_a_group_is_what_no_other_light_brings() -> None:
    """All others reach no prim; how lights are chosen does not change by that."""
    result = render(aov=ASKED)
    nothing = np.zeros(len(room().prims), bool)
    lights = tuple(
        light if light.control.group == "key" else replace(light, control=LightControl(illuminates=nothing))
        for light in room().lights
    )
    dark = tuple(replace(prim, control=LightControl(illuminates=nothing)) for prim in room().prims)
    alone = render(replace(room(), lights=lights, prims=dark), aov=("emission",))
    lit = alone.image.astype(np.float64) - alone.aovs["emission"]
    np.testing.assert_allclose(result.aovs["key_lit"], lit, rtol=1e-4, atol=1e-5)


def test_light_through_glass_is_transmission() -> None:
    """A block of glass in place of the mirror: what is behind it comes by transmission, what it mirrors by specular
    reflection, and none of its light is diffuse."""
    glass = Material(path="/glass", roughness=0.0, ior=1.5, transmission=1.0, transmission_color=(0.9, 0.5, 0.5))
    materials = tuple(glass if one is MIRROR else one for one in room().materials)
    result = render(replace(room(), materials=materials), aov=ASKED, ids=True)
    for names in SUMS:
        np.testing.assert_allclose(picture(result, *names), result.image, rtol=1e-5, atol=0.0, err_msg=str(names))
    behind = result.ids[..., 0] == 3
    inner = behind & np.roll(behind, 1, 0) & np.roll(behind, -1, 0) & np.roll(behind, 1, 1) & np.roll(behind, -1, 1)
    assert inner.any()
    assert (result.aovs["transmission"][inner].sum(axis=-1) > 0.0).all()
    assert not result.aovs["diffuse"][inner].any()


def test_a_camera_s_exposure_is_that_of_aovs() -> None:
    bright = replace(room(), camera=replace(room().camera, exposure=4.0))
    np.testing.assert_allclose(render(bright, aov=ASKED).aovs["direct"], 4.0 * render(aov=ASKED).aovs["direct"])


def test_only_what_is_asked_for_is_kept() -> None:
    """One sum for each kind of light that some picture tells apart."""
    plain = render().stats["bytes"]["picture"]
    pixels = 12 * 12
    direct = render(aov=("direct",)).stats["bytes"]["picture"] - plain
    assert direct == pixels * (24 + 12 + 2 * 12)  # sum, sample, what a ray meets
    assert not {"direct.R"} & set(render().channels())
