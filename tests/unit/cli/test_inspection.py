"""What `warpmis inspect` tells: closed forms of power, counts, memory, and who called for an effect."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest
from scenes import METAL, USD_SCENES, WHITE, box_faces, camera, quads, room, scene

from warpmis.cli import main
from warpmis.cli.explain import lines
from warpmis.inspection import inspect_scene
from warpmis.scene import CylinderLight, DiskLight, DistantLight, DomeLight, Material, Prim, RectLight, SphereLight
from warpmis.scene.features import Features, detect
from warpmis.scene.light_control import LightControl

pytestmark = pytest.mark.own_kernels

ORIGIN = np.zeros(3)
X, Y, Z = np.eye(3)
TWO = np.full(3, 2.0)  # [nit]
GLOW = Material(path="/glow", emissive_color=(3.0, 3.0, 3.0))


def report_of(*lights):
    return inspect_scene(scene(quads([]), [], list(lights), camera((0, 0, 5), (0, 0, 0)))).lights


@pytest.mark.parametrize(
    ("light", "area"),
    [
        (RectLight("/l", ORIGIN, 1.5 * X, 2 * Y, TWO), 3 * 4),
        (DiskLight("/l", ORIGIN, 2 * X, 3 * Y, TWO), math.pi * 6),
        (SphereLight("/l", ORIGIN, 0.5, TWO), math.pi),
        (CylinderLight("/l", ORIGIN, 2 * X, 0.5, TWO), 2 * math.pi * 0.5 * 4),
    ],
)
def test_power_of_a_lambertian_emitter_is_pi_times_area_times_radiance(light, area):
    (report,) = report_of(light)
    assert (report.path, report.kind, report.unit) == ("/l", type(light).__name__, "nit")
    assert report.power == pytest.approx(2.0 * math.pi * area)
    assert report.irradiance is None


def test_lights_without_an_area():
    point, sun, cone, sky = report_of(
        SphereLight("/p", ORIGIN, 0.0, TWO),
        DistantLight("/d", Y, 0.0, TWO),
        DistantLight("/c", Y, math.radians(30), TWO),
        DomeLight("/s", np.eye(3), np.array([1.0, 0.0, 0.0])),
    )
    assert (point.unit, point.power) == ("cd", pytest.approx(4 * math.pi * 2))
    assert (sun.unit, sun.irradiance, sun.power) == ("lux", 2.0, None)
    assert (cone.unit, cone.irradiance) == ("nit", pytest.approx(2 * math.pi / 4))
    assert sky.luminance == pytest.approx(0.2126)


@pytest.mark.parametrize(("double_sided", "sides"), [(False, 1), (True, 2)])
def test_an_emissive_prim_is_a_light_of_its_area(double_sided, sides):
    base = scene(quads([(box_faces((0, 0, 0), (2, 2, 2), False)[4], 0)]), [GLOW], [], camera((0, 0, 9), (0, 0, 0)))
    (report,) = inspect_scene(dataclasses.replace(base, prims=(Prim("/lamp", double_sided),))).lights
    assert (report.path, report.kind, report.luminance) == ("/lamp", "EmissiveSurface", pytest.approx(3))
    assert report.power == pytest.approx(sides * math.pi * 4 * 3)


def test_counts_bounds_and_memory():
    found = inspect_scene(room())
    counts = {"prims": 3, "triangles": 12, "points": 24, "instances": 0, "materials": 3, "textures": 0, "RectLight": 1}
    assert found.counts == counts
    np.testing.assert_allclose(found.bounds, [[-1, 0, -1], [1, 2, 1]])
    floats_and_ints = 24 * 3 + 12 * 3 + 12 * 3 + 12 + 12
    assert found.memory == {"geometry": 4 * floats_and_ints, "textures": 0, "environments": 0, "total": 672}
    assert [(one.path, one.triangles) for one in found.materials] == [("/white", 8), ("/red", 2), ("/metal", 2)]


def test_every_effect_names_the_first_prim_that_called_for_it():
    base = room()
    walls = quads([(face, n % 2) for n, face in enumerate(box_faces((-1, 0, -1), (1, 2, 1), inward=True))])
    mirror = dataclasses.replace(METAL, roughness=0.0)
    found = inspect_scene(dataclasses.replace(base, geometry=walls, materials=(WHITE, mirror, METAL)))
    assert [effect.name for effect in found.effects] == [
        f.name for f in dataclasses.fields(Features) if f.type == "bool"
    ]
    on = {effect.name: effect.prim for effect in found.effects if effect.on}
    assert on == {"rect_light": "/lamp", "specular": "/red", "smooth": "/red", "indirect": "/white"}
    assert all(effect.prim is None for effect in found.effects if not effect.on)


def test_what_is_on_is_what_is_compiled():
    found = inspect_scene(room())
    features = dataclasses.asdict(detect(room()))
    assert {effect.name: effect.on for effect in found.effects} == {
        k: v for k, v in features.items() if v in (True, False)
    }


def test_what_a_light_made_of_geometry_asks_for_is_called_for_by_its_prim():
    base = scene(quads([(box_faces((0, 0, 0), (2, 2, 2), False)[4], 0)]), [GLOW], [], camera((0, 0, 9), (0, 0, 0)))
    glowing = dataclasses.replace(base, prims=(Prim("/lamp", control=LightControl(tint=TWO)),))
    callers = {effect.name: effect.prim for effect in inspect_scene(glowing).effects}
    assert callers["light_tints"] == "/lamp"


def test_what_several_prims_call_for_together_names_the_first_of_them():
    """A tree takes many lights, and the choice by glossy lobes lights and a lobe."""
    box = quads([(face, 0) for face in box_faces((-1, -1, -1), (1, 1, 1), False)])
    lamps = [SphereLight(f"/lamp{i}", ORIGIN + 0.1 * i * X, 0.01, TWO) for i in range(12)]
    polished = Material(path="/polished", roughness=0.3)
    many = scene(box, [polished], lamps, camera((0, 0, 5), (0, 0, 0)))
    callers = {effect.name: effect.prim for effect in inspect_scene(many).effects if effect.on}
    assert callers["light_tree"] == "/lamp0"
    assert callers["glossy_choice"] == many.prims[0].path
    assert None not in callers.values()


def test_a_supplied_light_is_told_from_what_nothing_calls_for():
    dome = DomeLight("", np.eye(3), np.ones(3))
    found = inspect_scene(scene(quads([]), [], [dome], camera((0, 0, 5), (0, 0, 0))))
    callers = {effect.name: effect.prim for effect in found.effects}
    stats = {"features": ["dome_constant"], "kernels_compiled": 0, "kernels_cached": 0, "compile_seconds": 0.0}
    stats |= {"seconds": {}, "rays": 0, "samples": 0, "rays_per_second": 0.0, "bytes": {"scene": {}, "picture": 0}}
    assert next(lines(stats, callers)) == "effect dome_constant: (supplied)"


def test_warnings_are_split_at_the_prim():
    lines = ("/A/B: it is: odd", "layer.usda is missing: why", "/A/B: it is: odd")
    found = inspect_scene(dataclasses.replace(room(), warnings=lines))
    assert found.not_honoured == (("/A/B", "it is: odd"), ("", "layer.usda is missing: why"))


def test_the_command_prints_one_object_or_text(capsys):
    stage = str(USD_SCENES / "cornell_box" / "scene.usda")
    assert main(["inspect", stage, "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["camera"]["path"] == "/World/Camera"
    assert report["power_unit"] == "nit sr unit^2"
    assert [(light["path"], light["unit"]) for light in report["lights"]] == [("/World/Lamp", "nit")]
    assert main(["inspect", stage]) == 0
    said = capsys.readouterr().out
    assert "/World/Lamp" in said and "nit sr unit^2" in said
    assert "specular" in said and "/World/TallBlock" in said


def test_names_with_brackets_are_text_and_errors_one_line(capsys, tmp_path: Path):
    stage = tmp_path / "[red].usda"
    stage.write_text('#usda 1.0\ndef Cube "C" {}\ndef Volume "V" {}\n')
    assert main(["inspect", str(stage)]) == 0
    said = capsys.readouterr().out
    assert "[red].usda" in said and "/V" in said and "note: the stage has no camera" in said
    assert main(["inspect", str(tmp_path / "none.usda")]) == 1
    assert capsys.readouterr().err.count("\n") == 1
