"""The camera for a stage that has none: it frames the geometry, from a side on which there is something to see."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf

from warpmis.scene import CylinderLight, DiskLight, Light, RectLight, SphereLight
from warpmis.scene.geometry import Bounds, Geometry, Prototype, bounds
from warpmis.usd.shapes.surfaces import cofactors

Vector = NDArray[np.float64]

# So many triangles of a mesh tell from where it can be seen, and so many places of a prototype.
SAMPLED_TRIANGLES = 1 << 16
SAMPLED_PLACES = 16

# From the front, unless from above and aside ten times as much is to be seen: a floor, or a floor with little on it.
FRONT_SHARE = 0.1
# Of the directions from aside the first one that shows so much of what the best one does.
ASIDE_SHARE = 0.5


def framing_camera(geometry: Geometry, prototypes: tuple[Prototype, ...], lights: list[Light], up_axis: str) -> Any:
    """A Gf.Camera with the default lens that looks at all of the geometry, or, without any, at the lights.

    It looks from the front as usdrecord's does, along -Z (+Y where Z is up). Where that shows next to nothing, as of a
    floor, it looks from above and aside, or from whichever of eight corners shows enough.
    """
    box = world_bounds(geometry, prototypes, lights)
    to_world = np.eye(3) if up_axis == "Y" else np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    towards = _best_direction(visible_area(geometry, prototypes, lights), to_world)
    return from_the_front(box, up_axis) if towards is None else _from(towards @ to_world, box, to_world[1])


def _best_direction(area: Callable[[Vector], float], to_world: NDArray[np.float64]) -> Vector | None:
    """From the scene towards the camera, in the axes right, up and front, shape (3,); None for the front."""
    corners = np.array(
        [[0.5 * x, 0.6 * y, z] for y in (1.0, -1.0) for z in (1.0, -1.0) for x in (1.0, -1.0)]
    ) / math.sqrt(0.25 + 0.36 + 1.0)  # fmt: skip
    seen = [area(corner @ to_world) for corner in corners]
    if max(seen) == 0.0 or area(to_world[2]) >= FRONT_SHARE * max(seen):
        return None
    return next(corner for corner, one in zip(corners, seen, strict=True) if one >= ASIDE_SHARE * max(seen))


def visible_area(
    geometry: Geometry, prototypes: tuple[Prototype, ...], lights: list[Light]
) -> Callable[[Vector], float]:
    """How much the surfaces, or without any the lights, cover when seen from a direction, as if none hid another.

    The function returned takes the unit vector towards the camera and gives about that area [square scene units].
    """
    surfaces = [_area_vectors(geometry.points, geometry.triangles), *map(_prototype_vectors, prototypes)]
    vectors = np.concatenate(surfaces)
    if len(vectors):
        return lambda towards: float(np.abs(vectors @ towards).sum())
    return lambda towards: sum(_light_area(light, towards) for light in lights)


def _area_vectors(points: NDArray[Any], triangles: NDArray[Any]) -> Vector:
    """Area times normal of some of the triangles, such that the sum is about that of all, shape (n, 3)."""
    step = max(1, len(triangles) // SAMPLED_TRIANGLES)
    corners = points[triangles[::step]].astype(np.float64)
    return 0.5 * step * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _prototype_vectors(prototype: Prototype) -> Vector:
    vectors = _area_vectors(prototype.geometry.points, prototype.geometry.triangles)
    step = max(1, len(prototype.linear) // SAMPLED_PLACES)
    carried = vectors @ cofactors(prototype.linear[::step].swapaxes(1, 2))
    return step * carried.reshape(-1, 3)


def _light_area(light: Light, towards: Vector) -> float:
    """What a light that has a place covers, from the side that it shines to."""
    match light:
        case RectLight() | DiskLight():
            return max(0.0, 4.0 * float(np.cross(light.half_v, light.half_u) @ towards))
        case SphereLight():
            return math.pi * light.radius**2
        case CylinderLight():
            return 4.0 * light.radius * float(np.linalg.norm(np.cross(light.half_axis, towards)))
        case _:
            return 0.0


def from_the_front(box: Bounds, up_axis: str) -> Any:
    """usdrecord's camera: in front of the bounds, upright."""
    low, high = box
    center, size = (low + high) / 2, high - low
    gf_camera = Gf.Camera()
    across, depth = (1, 2) if up_axis == "Y" else (2, 1)
    radius = 0.5 * math.hypot(size[0], size[across]) or 0.5 * size[depth] or 1.0
    half_view = math.radians(gf_camera.GetFieldOfView(Gf.Camera.FOVHorizontal)) / 2
    distance = radius / math.tan(half_view) + size[depth] / 2
    matrix = Gf.Matrix4d(1.0)
    if up_axis == "Y":
        matrix.SetTranslate(Gf.Vec3d(*center.tolist()) + Gf.Vec3d(0, 0, distance))
    else:
        matrix.SetRotate(Gf.Rotation(Gf.Vec3d(1, 0, 0), 90))
        matrix.SetTranslateOnly(Gf.Vec3d(*center.tolist()) + Gf.Vec3d(0, -distance, 0))
    gf_camera.transform = matrix
    return gf_camera


def _from(towards: Vector, box: Bounds, up: Vector) -> Any:
    """A camera in the direction `towards` of the box's middle, as near as it sees the whole box."""
    gf_camera = Gf.Camera()
    right = np.cross(up, towards)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(towards, right), towards])
    center, half = (box[0] + box[1]) / 2, (box[1] - box[0]) / 2
    corners = np.stack(np.meshgrid(*np.stack([-half, half], axis=-1), indexing="ij"), axis=-1).reshape(8, 3) @ axes.T
    tangents = np.array([gf_camera.horizontalAperture, gf_camera.verticalAperture]) / (2.0 * gf_camera.focalLength)
    distance = float((np.abs(corners[:, :2]) / tangents + corners[:, 2:]).max()) or 1.0
    matrix = np.eye(4)
    matrix[:3, :3], matrix[3, :3] = axes, center + distance * towards
    gf_camera.transform = Gf.Matrix4d(matrix.tolist())
    return gf_camera


def world_bounds(geometry: Geometry, prototypes: tuple[Prototype, ...], lights: list[Light]) -> Bounds:
    """Smallest and largest corner of the geometry, or, without any, of the lights that have a place."""
    found = bounds(geometry, prototypes)
    if found is not None:
        return found
    places = light_boxes(lights)
    if not places:
        return np.zeros(3), np.zeros(3)
    return np.min([low[0] for low, _ in places], axis=0), np.max([high[0] for _, high in places], axis=0)


def light_boxes(lights: list[Light]) -> list[Bounds]:
    """The bounds of every light that has a place, shape (1, 3) each."""
    return [(box[0][None], box[1][None]) for light in lights if (box := _box(light)) is not None]


def _box(light: Light) -> Bounds | None:
    """Smallest and largest corner of a light, shape (3,) each; None for one at infinity."""
    match light:
        case RectLight() | DiskLight():
            reach = np.abs(light.half_u) + np.abs(light.half_v)
        case SphereLight():
            reach = np.full(3, light.radius)
        case CylinderLight():
            reach = np.abs(light.half_axis) + light.radius
        case _:
            return None
    return light.center - reach, light.center + reach
