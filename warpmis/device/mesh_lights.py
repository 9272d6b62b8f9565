"""The lights made of triangles that emit, one for each pair of prim and emissive material."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpmis.device.environment import LUMINANCE
from warpmis.device.light_records import FloatArray
from warpmis.device.struct_arrays import Records, blank
from warpmis.device.views import MESH, LightView
from warpmis.scene import Scene
from warpmis.scene.features import is_emissive
from warpmis.scene.geometry import Geometry
from warpmis.scene.light_control import LightControl


@dataclass(frozen=True, eq=False)
class MeshLights:
    """Mesh lights and their triangles, the emitters.

    Attributes:
        records: of views.LightView.
        controls: what is asked of each light; glows: whether it is a surface that glows, and no light prim.
        triangles, corners: of each emitter, one light after the other, shape (t,) and (t, 3, 3).
        lights: of each emitter the row of its light in `records`, shape (t,).
        cdf: of each emitter the cumulative share of its light's area, shape (t,).
    """

    records: Records
    controls: list[LightControl]
    glows: list[bool]
    triangles: NDArray[np.int32]
    corners: FloatArray
    lights: NDArray[np.int64]
    cdf: NDArray[np.float32]


NONE = MeshLights(
    records=blank(LightView, 0),
    controls=[],
    glows=[],
    triangles=np.zeros(0, np.int32),
    corners=np.zeros((0, 3, 3)),
    lights=np.zeros(0, np.int64),
    cdf=np.zeros(0, np.float32),
)


def mesh_lights(scene: Scene, geometry: Geometry) -> MeshLights:
    """The scene's mesh lights; `geometry` is the scene's, in the order in which it is uploaded."""
    emissive = np.array([is_emissive(material) for material in scene.materials], dtype=bool)
    if not emissive.any():  # a scene of lights alone has no materials at all
        return NONE
    triangles = np.flatnonzero(emissive[geometry.materials])
    corners = geometry.points[geometry.triangles[triangles]].astype(np.float64)
    areas = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    triangles, corners, areas = triangles[areas > 0.0], corners[areas > 0.0], areas[areas > 0.0]
    if len(triangles) == 0:
        return NONE
    keys = geometry.prims[triangles].astype(np.int64) * len(scene.materials) + geometry.materials[triangles]
    order = np.argsort(keys, kind="stable")
    triangles, corners, areas = triangles[order], corners[order], areas[order]
    starts = np.flatnonzero(np.diff(keys[order], prepend=-1))
    lights = np.repeat(np.arange(len(starts)), np.diff(starts, append=len(order)))
    prims = [scene.prims[prim] for prim in geometry.prims[triangles[starts]]]
    emission = np.array([scene.materials[k].mean_emission for k in geometry.materials[triangles[starts]]], np.float64)
    shares = np.array([prim.control.mean_share for prim in prims])
    records = blank(LightView, len(starts))
    records["kind"], records["radiance"], records["luminance"] = MESH, emission, (emission * shares) @ LUMINANCE
    records["center"], records["bound"] = bounding_balls(corners, starts, lights)
    records["area"] = np.add.reduceat(areas, starts)
    records["first"], records["count"] = starts, np.diff(starts, append=len(order))
    records["two_sided"] = [prim.double_sided for prim in prims]
    controls, glows = [prim.control for prim in prims], [not prim.is_light for prim in prims]
    cdf = shares_of_area(areas, starts, lights)
    return MeshLights(records, controls, glows, triangles.astype(np.int32), corners, lights, cdf)


def bounding_balls(
    corners: FloatArray, starts: NDArray[np.int64], lights: NDArray[np.int64]
) -> tuple[FloatArray, FloatArray]:
    """Centres and radii of balls that hold each light's triangles."""
    low = np.minimum.reduceat(corners.min(axis=1), starts, axis=0)
    high = np.maximum.reduceat(corners.max(axis=1), starts, axis=0)
    center = 0.5 * (low + high)
    apart = ((corners - center[lights][:, None]) ** 2).sum(axis=2).max(axis=1)
    return center, np.sqrt(np.maximum.reduceat(apart, starts))


def shares_of_area(areas: FloatArray, starts: NDArray[np.int64], lights: NDArray[np.int64]) -> NDArray[np.float32]:
    """The cumulative share of each light's area, ending with 1 of each light."""
    sums = np.cumsum(areas / np.add.reduceat(areas, starts)[lights])
    before = np.concatenate([[0.0], sums])[starts]
    cdf = (sums - before[lights]).astype(np.float32)
    cdf[np.append(starts[1:], len(areas)) - 1] = 1.0
    return cdf
