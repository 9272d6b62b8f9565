"""Light linking, shadow linking and lights made of geometry as they are read."""

from __future__ import annotations

import numpy as np
import pytest
from usd.lights.test_light_control import light
from usd.stages import area, load, mentions

from warpmis.scene.light_control import PLAIN

BALL = 'def Xform "G" {\ndef Sphere "Ball" {\n}\n}\n'


def test_collections_become_a_mask_over_the_prims() -> None:
    link = "uniform bool collection:lightLink:includeRoot = 0\nrel collection:lightLink:includes = </G>"
    scene = load(light("RectLight", f"{link}\nrel collection:shadowLink:excludes = </C>") + BALL)
    assert [prim.path for prim in scene.prims] == ["/C", "/G/Ball"]
    control = scene.lights[0].control
    np.testing.assert_array_equal(control.illuminates, [False, True])
    np.testing.assert_array_equal(control.shadow_casters, [False, True])
    assert scene.warnings == ()


def test_a_collection_that_holds_everything_asks_for_nothing() -> None:
    links = "rel collection:lightLink:excludes = </Nowhere>\nrel collection:shadowLink:excludes = </Nowhere>"
    assert load(light("RectLight", links)).lights[0].control is PLAIN


def test_shadows_that_are_off_are_cast_by_no_prim() -> None:
    scene = load(light("RectLight", "bool inputs:shadow:enable = 0", '"ShadowAPI"') + BALL)
    np.testing.assert_array_equal(scene.lights[0].control.shadow_casters, [False, False])
    assert scene.warnings == ()


def test_what_several_domes_ask_for_is_one_warning() -> None:
    scene = load(light("DomeLight", "float inputs:diffuse = 0.5") + 'def DomeLight "Other" {\n}\n')
    assert [dome.control for dome in scene.lights] == [PLAIN, PLAIN]
    assert mentions(scene, "/L", "several domes")


@pytest.mark.parametrize(
    ("value", "used", "word"), [("-2", 0.0, "negative"), ("nan", 1.0, "not finite"), ("1e38", 1.0, "beyond 1e+18")]
)
def test_impossible_multipliers(value: str, used: float, word: str) -> None:
    scene = load(light("RectLight", f"float inputs:diffuse = {value}"))
    assert scene.lights[0].control.diffuse == used
    assert mentions(scene, "/L", "diffuse", word)


def mesh_light(apis: str, attributes: str = "") -> str:
    scale = 'double3 xformOp:scale = (1, 2, 3)\nuniform token[] xformOpOrder = ["xformOp:scale"]'
    return f'def Cube "L" (\nprepend apiSchemas = [{apis}]\n)\n{{\n{attributes}\n{scale}\n}}\n'


def test_a_mesh_light_without_material_response_is_black_and_shines_over_its_world_space_area() -> None:
    scene = load(mesh_light('"LightAPI"', "float inputs:intensity = 5\nbool inputs:normalize = 1"))
    (material,) = scene.materials
    assert material.diffuse_color == (0.0, 0.0, 0.0)
    np.testing.assert_allclose(material.emissive_color, 5.0 / area(scene), rtol=1e-6)
    assert scene.lights == ()
    assert scene.warnings == scene.notes[1:] == ()


def test_a_mesh_light_whose_material_does_not_glow_says_so() -> None:
    scene = load(mesh_light('"MeshLightAPI"'))
    assert mentions(scene, "/L", "does not glow")
    assert scene.lights == ()  # no default dome: the stage has a light


def test_an_independent_mesh_light_keeps_its_material_and_shines_in_its_own_color() -> None:
    mode = 'uniform token light:materialSyncMode = "independent"\ncolor3f[] primvars:displayColor = [(0.2, 0.3, 0.4)]'
    scene = load(mesh_light('"MeshLightAPI"', f"{mode}\nfloat inputs:intensity = 2"))
    material = scene.materials[scene.geometry.materials[0]]
    np.testing.assert_allclose(material.diffuse_color, (0.2, 0.3, 0.4), rtol=1e-6)
    assert material.emissive_color == (2.0, 2.0, 2.0)
    assert mentions(scene, "/L", "independent")


def test_shadow_controls_of_a_mesh_light_are_one_warning() -> None:
    scene = load(mesh_light('"LightAPI", "ShadowAPI"', "bool inputs:shadow:enable = 0"))
    assert mentions(scene, "/L", "shadow controls")
    assert scene.prims[0].control.shadow_casters is None
