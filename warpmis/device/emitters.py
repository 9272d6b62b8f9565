"""The emissive triangles on the device, in world space and of prototypes, and what finds all of them on a line."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpmis.device.instance_views import EmitterPlaceView
from warpmis.device.instances import largest_shrinking, padded_bounds
from warpmis.device.light import LightTables
from warpmis.device.mesh import padded_boxes
from warpmis.device.place_lights import PlaceLights
from warpmis.device.struct_arrays import records
from warpmis.device.views import SceneView
from warpmis.scene.geometry import Geometry


def upload_emitters(view: SceneView, geometry: Geometry, tables: LightTables, extent: float) -> list[wp.Bvh]:
    """The triangles of mesh lights and of prototypes that emit, into the view; their trees, to be kept alive.

    Args:
        geometry: of the scene and all prototypes; extent: of the scene [scene units].
    """
    mesh, placed = tables.mesh, tables.placed
    triangles = tables.emitter_triangles
    if len(triangles) == 0:
        return []
    view.emitter_triangles = wp.array(triangles, dtype=int)
    lights = np.concatenate([tables.analytic + mesh.lights, placed.slots])
    view.emitter_lights = wp.array(lights.astype(np.int32), dtype=int)
    view.emitter_cdf = wp.array(mesh.cdf, dtype=float)
    owned = []
    if len(mesh.triangles):
        owned.append(bvh_over(*padded_boxes(geometry.points, geometry.triangles[mesh.triangles])))
        view.emitter_bvh = owned[0].id
    if placed.prototypes:
        owned += upload_places(view, geometry, tables, extent)
    return owned


def bvh_over(low: NDArray[Any], high: NDArray[Any]) -> wp.Bvh:
    return wp.Bvh(wp.array(low, dtype=wp.vec3), wp.array(high, dtype=wp.vec3))


def upload_places(view: SceneView, geometry: Geometry, tables: LightTables, extent: float) -> list[wp.Bvh]:
    """The places of prototypes that emit."""
    placed = tables.placed
    trees, boxes = [], []
    for one in placed.prototypes:
        reach = extent * largest_shrinking(one.prototype)
        trees.append(bvh_over(*padded_boxes(geometry.points, geometry.triangles[one.triangles], reach)))
        boxes.append(padded_bounds(one.prototype, extent))
    low, high = (np.concatenate(corner) for corner in zip(*boxes, strict=True))
    trees.append(bvh_over(low, high))
    view.emitter_place_bvh = trees[-1].id
    count = sum(one.place_count for one in placed.prototypes)
    columns = place_columns(placed, tables, [tree.id for tree in trees[:-1]])
    view.emitter_places = records(EmitterPlaceView, columns, count)
    place_of_instance = np.full(view.instance_count, -1, np.int32)
    place_of_instance[columns["instance"]] = np.arange(count)
    view.place_of_instance = wp.array(place_of_instance, dtype=int)
    return trees


def place_columns(placed: PlaceLights, tables: LightTables, bvhs: list[int]) -> dict[str, NDArray[Any]]:
    """EmitterPlaceView's fields."""
    counts = [one.place_count for one in placed.prototypes]
    first_light = np.concatenate([one.first_light for one in placed.prototypes])
    instances = [one.first_instance + np.arange(one.place_count) for one in placed.prototypes]
    first_emitter = len(tables.mesh.triangles) + placed.first_emitters[:-1]
    return {
        "instance": np.concatenate(instances),
        "root": np.repeat(tables.roots, counts),
        "first_light": tables.analytic + len(tables.mesh.records) + first_light,
        "first_emitter": np.repeat(first_emitter, counts),
        "bvh": np.repeat(np.array(bvhs, np.uint64), counts),
    }
