"""Prototypes on the device: a tree over the places, and a mesh for each prototype."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp

from warpmis.device.records import records
from warpmis.device.views import InstanceView
from warpmis.geometry import Prototype

# The boxes are widened by this share of their largest coordinate: float32 carries the triangles to about there.
MARGIN = 1e-6


def upload_instances(
    prototypes: Sequence[Prototype], meshes: Sequence[wp.Mesh], first_triangles: Sequence[int]
) -> tuple[dict[str, Any], tuple[Any, ...]]:
    """The prototypes' places as fields of a SceneView, and what these point into, to be kept alive.

    Args:
        meshes, first_triangles: of each prototype, the latter its first row in SceneView.triangles.
    """
    counts = [len(prototype.prims) for prototype in prototypes]
    if not counts:
        return {"instance_count": 0}, ()
    linear = np.concatenate([prototype.linear for prototype in prototypes])
    translation = np.concatenate([prototype.translation for prototype in prototypes])
    columns = {
        "mesh": np.repeat(np.array([mesh.id for mesh in meshes], np.uint64), counts),
        "first_triangle": np.repeat(first_triangles, counts),
        "prim": np.concatenate([prototype.prims for prototype in prototypes]),
        "copy": np.concatenate([prototype.copies for prototype in prototypes]),
        "linear": linear,
        "translation": translation,
        "inverse": np.linalg.inv(linear),
    }
    low = np.concatenate([prototype.boxes[0] for prototype in prototypes])
    high = np.concatenate([prototype.boxes[1] for prototype in prototypes])
    reach = high - low + np.abs(translation)
    margin = MARGIN * np.maximum(np.maximum(np.abs(low), np.abs(high)), reach).max(axis=1, keepdims=True)
    tree = wp.Bvh(wp.array(low - margin, dtype=wp.vec3), wp.array(high + margin, dtype=wp.vec3))
    instances = records(InstanceView, columns, sum(counts))
    return {"instances": instances, "instance_count": sum(counts), "instance_bvh": tree.id}, (tree,)
