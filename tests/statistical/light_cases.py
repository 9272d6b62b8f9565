"""The cases of the lights' samplers: scenes of one light, and of many."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any
from unittest import mock

import numpy as np
from numpy.typing import NDArray
from statistical.lights import (
    COUNT,
    RECEIVER,
    SAMPLE,
    TURN,
    cylinder,
    disk,
    distant,
    dome,
    everything,
    make_scene,
    patch,
    rect,
    run,
    sphere,
    starry_picture,
)

from warpmis.device.upload import DeviceScene, upload
from warpmis.scene import Light, Scene, features


@dataclass(frozen=True)
class Case:
    """A scene with one light, except where `overlaps` says that a line may meet light more than once.

    yields: share of the samples that have a direction (an emitter's back has none), where it is known.
    """

    scene: Callable[[], Scene]
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)
    yields: float = 1.0
    overlaps: bool = False
    # Of the emitted directions, those that rounding leaves beside the light when asked again.
    stray: float = 1e-4
    # Cells on the light's surface, see SurfaceGrid.
    by_surface: bool = False
    # Lights chosen by a tree, however few; else one by one, however many.
    by_tree: bool = False


def one(make: Callable[..., Light], *arguments: Any, **options: Any) -> Case:
    return Case(lambda: make_scene(make(*arguments)), **options)


CASES: dict[str, Case] = {
    # half_u = +X and half_v = +Y emit along -Z, towards the receiver.
    "rect": one(rect, (0.2, 0.1, 3.0), (0.5, 0, 0), (0, 1.0, 0), by_surface=True),
    "rect_near": one(rect, (0.2, 0.1, 0.25), (0.5, 0, 0), (0, 0.5, 0)),
    "rect_touching": one(rect, (0.1, 0.2, 0.01), (0.5, 0, 0), (0, 0.5, 0), by_surface=True),  # solid angle > 6.1
    "rect_far": one(rect, (3.0, 2.0, 40.0), (0.5, 0, 0), (0, 1.0, 0), stray=1e-3),  # solid angle < 0.01
    "rect_grazing": one(rect, (0.0, 1.6, 0.05), (2.0, 0, 0), (0, 1.5, 0), stray=1e-3, by_surface=True),
    "rect_skimming": one(rect, (0.0, 1.6, 0.002), (2.0, 0, 0), (0, 1.5, 0), stray=5e-3, by_surface=True),
    "rect_skimming_by_area": one(rect, (0.0, 2.6, 0.002), (2.0, 0, 0), (0, 1.5, 0), stray=5e-3, by_surface=True),
    "rect_over_its_edge": one(rect, (0.5, 0.5, 0.2), (0.5, 0, 0), (0, 0.5, 0)),
    "rect_long": one(rect, (0.0, 0.1, 0.3), (0.02, 0, 0), (0, 4.0, 0), by_surface=True),
    "parallelogram": one(rect, (0.2, 0.1, 0.8), (0.5, 0, 0), (0.4, 0.5, 0)),
    "disk": one(disk, (0.2, 0.1, 0.5), (0.5, 0, 0), (0, 0.5, 0)),
    "ellipse_sheared": one(disk, (0.2, 0.1, 1.5), (1.5, 0, 0), (0.6, 0.4, 0.3)),
    "disk_grazing": one(disk, (0.0, 1.6, 0.05), (1.5, 0, 0), (0, 1.5, 0), stray=1e-3, by_surface=True),
    "sphere": one(sphere, (0.0, 1.0, 2.0), 1.0),
    "sphere_near": one(sphere, (0.0, 0.0, 1.001), 1.0, stray=1e-3),
    "sphere_far": one(sphere, (1.0, 2.0, 50.0), 1.0, stray=1e-3),
    "sphere_tiny": one(sphere, (0.1, 0.2, 3.0), 3e-4, stray=1e-2),
    # Only the visible part is sampled: every sample has a direction.
    "cylinder": one(cylinder, (0, 0, 2.0), (1.0, 1.0, 0.2), 0.3, stray=1e-3, by_surface=True),
    "cylinder_beside": one(cylinder, (0, 0, 1.5), (2.0, 0, 0), 0.75, stray=1e-3, by_surface=True),
    "cylinder_end_on": one(cylinder, (0, 0.6, 2.0), (0, 0, 0.5), 0.3, stray=1e-3, by_surface=True),
    "sun": one(distant, 0.265, stray=2e-3),
    "distant_wide": one(distant, 10.0),
    "distant_beyond_the_horizon": one(distant, 100.0),
    "dome": Case(lambda: make_scene(dome()), normal=(-0.48, 0.6, -0.64)),
    "dome_picture": Case(lambda: make_scene(dome(starry_picture())), stray=1e-3),
    "mesh_one_sided": Case(lambda: patch(False), yields=float(np.nan), overlaps=True),
    "mesh_two_sided": Case(lambda: patch(True), overlaps=True),
    "mesh_lights": Case(lambda: patch(True, False, True), yields=float(np.nan), overlaps=True),
    "all_kinds": Case(lambda: everything(dome()), yields=float(np.nan), overlaps=True),
    "all_kinds_and_picture": Case(lambda: everything(dome(starry_picture())), yields=float(np.nan), overlaps=True),
}
BY_TREE = (
    "rect",
    "ellipse_sheared",
    "sphere",
    "cylinder",
    "mesh_one_sided",
    "mesh_two_sided",
    "mesh_lights",
    "all_kinds",
)
CASES |= {f"{name}_by_tree": replace(CASES[name], by_tree=True) for name in (*BY_TREE, "all_kinds_and_picture")}
SINGLE = [name for name, case in CASES.items() if not case.overlaps]


@cache
def device_scene(name: str) -> DeviceScene:
    case = CASES[name]
    with mock.patch.object(features, "FEW_LIGHTS", 0 if case.by_tree else 1000):
        return upload(case.scene(), "cpu")


def normal_of(name: str) -> NDArray[np.float64]:
    return TURN @ np.array(CASES[name].normal)


@cache
def sampled(name: str, count: int = COUNT, seed: int = 1) -> tuple[NDArray[np.float32], NDArray[Any]]:
    return run(device_scene(name), SAMPLE, RECEIVER, normal_of(name), count, seed=seed)
