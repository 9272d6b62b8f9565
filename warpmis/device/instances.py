"""Prototypes on the device: a tree over the places, and a mesh for each prototype."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpmis.device.instance_views import InstanceView
from warpmis.device.mesh import MAX_SHARE, PAD, padding, triangle_boxes
from warpmis.device.struct_arrays import records
from warpmis.scene.geometry import Bounds, Prototype

# The boxes are widened by this share of their largest coordinate: float32 carries the triangles to about there.
MARGIN = 1e-6


def largest_shrinking(prototype: Prototype) -> float:
    """How many units along an axis of the prototype's space a unit of the world makes, in the place that has most."""
    return float(np.linalg.norm(np.linalg.inv(prototype.linear), axis=2).max())


def padded_bounds(prototype: Prototype, extent: float) -> Bounds:
    """Boxes of the places that a ray meets wherever it meets a padded box of the prototype's tree, shape (k, 3) each.

    `extent` is the scene's, as in mesh.padded_boxes: these boxes grow for their own tree's test in the same way.
    """
    low, high = prototype.boxes
    geometry = prototype.geometry
    own = triangle_boxes(geometry.points, geometry.triangles)
    inside = padding(*own, extent * largest_shrinking(prototype)).max()
    side = (high - low).max(axis=1, keepdims=True)
    pad = np.abs(prototype.linear).sum(axis=2) * float(inside) + np.minimum(PAD * extent, MAX_SHARE * side)
    reach = high - low + np.abs(prototype.translation)
    carried = MARGIN * np.maximum(np.maximum(np.abs(low), np.abs(high)), reach).max(axis=1, keepdims=True)
    return low - pad - carried, high + pad + carried


def upload_instances(
    prototypes: Sequence[Prototype], kind: str, handles: Sequence[int], first_triangles: Sequence[int], extent: float
) -> tuple[dict[str, Any], tuple[Any, ...]]:
    """The prototypes' places as fields of a SceneView, and what these point into, to be kept alive.

    Args:
        kind, handles: of trees.Trees, the latter of each prototype.
        first_triangles: of each prototype its first row in SceneView.triangles.
        extent: of the scene [scene units].
    """
    counts = [len(prototype.prims) for prototype in prototypes]
    if not counts:
        return {"instance_count": 0}, ()
    linear = np.concatenate([prototype.linear for prototype in prototypes])
    translation = np.concatenate([prototype.translation for prototype in prototypes])
    columns = {
        kind: np.repeat(np.array(handles, np.uint64), counts),
        "first_triangle": np.repeat(first_triangles, counts),
        "prim": np.concatenate([prototype.prims for prototype in prototypes]),
        "copy": np.concatenate([prototype.copies for prototype in prototypes]),
        "linear": linear,
        "translation": translation,
        "inverse": np.linalg.inv(linear),
    }
    low, high = (np.concatenate(e) for e in zip(*(padded_bounds(one, extent) for one in prototypes), strict=True))
    tree = wp.Bvh(wp.array(low, dtype=wp.vec3), wp.array(high, dtype=wp.vec3))
    instances = records(InstanceView, columns, sum(counts))
    return {"instances": instances, "instance_count": sum(counts), "instance_bvh": tree.id}, (tree,)


def place_primvars(prototypes: Sequence[Prototype], width: int) -> NDArray[np.float32]:
    """What all places have of so many columns of primvars, shape (K, width); (0, width) where none has any."""
    if not any(prototype.primvars.size for prototype in prototypes):
        return np.zeros((0, width), np.float32)
    blocks = [np.zeros((len(prototype.prims), width), np.float32) for prototype in prototypes]
    for block, prototype in zip(blocks, prototypes, strict=True):
        if prototype.primvars.size:
            block[:, : prototype.primvars.shape[1]] = prototype.primvars
    return np.concatenate(blocks)
