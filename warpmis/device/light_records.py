"""Scene lights as the records that kernels read, all lights of a kind at a time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpmis.device.environment import LUMINANCE, Environment
from warpmis.device.struct_arrays import Records, blank
from warpmis.device.views import (
    CYLINDER,
    DELTA_DISTANT,
    DELTA_POINT,
    DISK,
    DISTANT,
    DOME,
    RECT,
    SPHERE,
    DeltaLightView,
    LightView,
)
from warpmis.scene import CylinderLight, DiskLight, DistantLight, Light, RectLight, SphereLight
from warpmis.scene.light_control import PLAIN

FloatArray = NDArray[np.float64]


def light_records(lights: Sequence[Light]) -> Records:
    """The records (views.LightView) of lights that have an extent, other than domes, in their order."""
    records = blank(LightView, len(lights))
    for kind, of_kind in KINDS.items():
        rows = [i for i, light in enumerate(lights) if isinstance(light, kind)]
        if rows:
            found = [lights[i] for i in rows]
            for name, column in (common(found) | of_kind(found)).items():
                records[name][rows] = column
    return records


def column(lights: Sequence[Light], name: str) -> FloatArray:
    return np.array([getattr(light, name) for light in lights], np.float64)


def common(lights: Sequence[Light]) -> dict[str, Any]:
    shares = np.ones((len(lights), 3))
    for i, light in enumerate(lights):
        if light.control is not PLAIN:
            shares[i] = light.control.mean_share
    radiance = column(lights, "radiance")
    return {"radiance": radiance, "luminance": (radiance * shares) @ LUMINANCE}


def of_spheres(lights: Sequence[Light]) -> dict[str, Any]:
    radius = column(lights, "radius")
    area = 4.0 * np.pi * radius**2
    return {"kind": SPHERE, "center": column(lights, "center"), "radius": radius, "bound": radius, "area": area}


def of_cylinders(lights: Sequence[Light]) -> dict[str, Any]:
    radius, half_axis = column(lights, "radius"), column(lights, "half_axis")
    half_length = np.linalg.norm(half_axis, axis=1)
    return {
        "kind": CYLINDER,
        "center": column(lights, "center"),
        "u": half_axis,
        "radius": radius,
        "bound": np.hypot(half_length, radius),
        "area": 4.0 * np.pi * radius * half_length,
    }


def of_distant(lights: Sequence[Light]) -> dict[str, Any]:
    one_minus_cos = 2.0 * np.sin(0.5 * column(lights, "half_angle")) ** 2
    return {"kind": DISTANT, "n": column(lights, "direction"), "one_minus_cos": one_minus_cos}


def of_rects(lights: Sequence[Light]) -> dict[str, Any]:
    """A sheared rectangle is farthest at a corner."""
    u, v = column(lights, "half_u"), column(lights, "half_v")
    flat = flat_columns(lights, u, v)
    x, y = flat["lengths"].T
    return flat | {
        "kind": RECT,
        "bound": np.maximum(np.linalg.norm(u + v, axis=1), np.linalg.norm(u - v, axis=1)),
        "area": 4.0 * np.linalg.norm(np.cross(v, u), axis=1),
        "samples_solid_angle": np.abs((u * v).sum(axis=1)) < 1e-6 * x * y,
    }


def of_disks(lights: Sequence[Light]) -> dict[str, Any]:
    """No point of an ellipse lies beyond the root of its axes' squares."""
    u, v = column(lights, "half_u"), column(lights, "half_v")
    flat = flat_columns(lights, u, v)
    area = np.pi * np.linalg.norm(np.cross(v, u), axis=1)
    return flat | {"kind": DISK, "bound": np.hypot(*flat["lengths"].T), "area": area}


def flat_columns(lights: Sequence[Light], u: FloatArray, v: FloatArray) -> dict[str, Any]:
    normal = np.cross(v, u)
    duals = np.linalg.pinv(np.stack([u, v], axis=2))
    return {
        "center": column(lights, "center"),
        "u": u,
        "v": v,
        "n": normal / np.linalg.norm(normal, axis=1, keepdims=True),
        "dual_u": duals[:, 0],
        "dual_v": duals[:, 1],
        "lengths": np.stack([np.linalg.norm(u, axis=1), np.linalg.norm(v, axis=1)], axis=1),
    }


KINDS: dict[type, Callable[[Sequence[Light]], dict[str, Any]]] = {
    RectLight: of_rects,
    DiskLight: of_disks,
    SphereLight: of_spheres,
    CylinderLight: of_cylinders,
    DistantLight: of_distant,
}


def dome_record(environment: Environment) -> Records:
    """The record of all domes as one light."""
    record = blank(LightView, 1)
    record["kind"], record["radiance"], record["luminance"] = DOME, environment.radiance, environment.luminance
    return record


def delta_records(lights: Sequence[Light]) -> Records:
    """The records (views.DeltaLightView) of point lights and of distant lights of angle 0."""
    records = blank(DeltaLightView, len(lights))
    for i, light in enumerate(lights):
        assert isinstance(light, SphereLight | DistantLight)
        is_point = isinstance(light, SphereLight)
        records["kind"][i] = DELTA_POINT if is_point else DELTA_DISTANT
        records["vector"][i] = light.center if isinstance(light, SphereLight) else light.direction
        records["intensity"][i] = light.radiance
        records["luminance"][i] = light.radiance @ LUMINANCE
    return records
