"""UsdLux's controls of a light as they are read."""

from __future__ import annotations

import math

import numpy as np
import pytest
from usd.stages import load, mentions

from warpmis.scene.light_control import PLAIN

SHAPING = '"ShapingAPI"'


def light(kind: str, attributes: str = "", apis: str = "", ops: str = "") -> str:
    head = f" (\nprepend apiSchemas = [{apis}]\n)" if apis else ""
    return f'def {kind} "L"{head}\n{{\n{attributes}\n{ops}\n}}\ndef Cube "C"\n{{\n}}\n'


def shaping_of(text: str):
    scene = load(text)
    assert scene.warnings == ()
    return scene.lights[0].control.shaping


def test_applying_the_api_alone_darkens_the_back_of_a_sphere_and_changes_no_flat_light():
    assert shaping_of(light("SphereLight", apis=SHAPING)).cone_angle == pytest.approx(math.pi / 2)
    assert shaping_of(light("CylinderLight", apis=SHAPING)).cone_angle == pytest.approx(math.pi / 2)
    for kind in ("RectLight", "DiskLight"):
        assert load(light(kind, apis=SHAPING)).lights[0].control is PLAIN
    # without the API the attributes mean nothing
    assert load(light("SphereLight", "float inputs:shaping:cone:angle = 20")).lights[0].control is PLAIN


def test_shaping_is_clamped_to_what_the_schema_lets_it_be():
    found = shaping_of(
        light(
            "RectLight",
            "float inputs:shaping:cone:angle = 40\nfloat inputs:shaping:cone:softness = 3\n"
            "float inputs:shaping:focus = -2\ncolor3f inputs:shaping:focusTint = (1, 0.5, 0)",
            SHAPING,
        )
    )
    assert (found.cone_softness, found.focus) == (1.0, 0.0)
    assert found.cone_angle == pytest.approx(math.radians(40))
    np.testing.assert_allclose(found.focus_tint, [1, 0.5, 0])


def test_the_axis_follows_the_transform_and_no_scale():
    ops = """double3 xformOp:scale = (3, 2, 0.5)
    float xformOp:rotateX = -90
    uniform token[] xformOpOrder = ["xformOp:rotateX", "xformOp:scale"]"""
    found = shaping_of(light("RectLight", "float inputs:shaping:focus = 1", SHAPING, ops))
    np.testing.assert_allclose(found.to_world @ [0, 0, -1], [0, -1, 0], atol=1e-9)
    np.testing.assert_allclose(found.to_world @ found.to_world.T, np.eye(3), atol=1e-9)


def test_a_stretched_sphere_keeps_its_shaping_as_triangles():
    ops = 'double3 xformOp:scale = (2, 1, 1)\nuniform token[] xformOpOrder = ["xformOp:scale"]'
    scene = load(light("SphereLight", "float inputs:shaping:cone:angle = 25", SHAPING, ops))
    controls = {prim.path: prim.control for prim in scene.prims}
    assert controls["/L"].shaping.cone_angle == pytest.approx(math.radians(25))
    assert controls["/C"] is PLAIN


@pytest.mark.parametrize("name", ["cone:angle", "cone:softness", "focus"])
def test_shaping_that_is_no_number_is_left_out_with_one_warning(name):
    scene = load(light("SphereLight", f"float inputs:shaping:{name} = nan", SHAPING))
    assert mentions(scene, "/L", f"shaping:{name} is not finite")
    assert scene.lights[0].control.shaping.cone_angle == pytest.approx(math.pi / 2)
