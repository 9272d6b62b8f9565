"""The trees over a scene's triangles, of the kind that the device is best at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpmis.device.mesh import watertight_meshes
from warpmis.device.open_nodes import open_nodes
from warpmis.device.wide_tree import wide_trees


@dataclass(frozen=True, eq=False)
class Trees:
    """Trees on a device, one for each mesh.

    Attributes:
        kind: "mesh" or "root", the field of a SceneView or InstanceView that names a tree.
        handles: of each mesh its value.
        fields: of a SceneView, the points among them.
        owned: keeps alive what these point into.
    """

    kind: str
    handles: Sequence[int]
    fields: dict[str, Any]
    owned: tuple[Any, ...]


def tree_of(device: str) -> str:
    """Features.tree for a device, by its name alone: kernels are also compiled for devices that this machine lacks."""
    return "wide" if device == "cpu" else "warp"


def tree_kernels(device: str) -> list[wp.Kernel]:
    """What `upload_trees` launches."""
    return [open_nodes] if tree_of(device) == "wide" else []


def upload_trees(
    points: NDArray[np.float32], triangles: NDArray[np.int32], first: Sequence[int], reaches: Sequence[float]
) -> Trees:
    """Trees on the present device, with the arguments of mesh.watertight_meshes."""
    if tree_of(str(wp.get_device())) == "wide":
        tree, roots = wide_trees(points, triangles, first, reaches)
        arrays = tuple(getattr(tree, name) for name in ("bounds", "children", "corners", "faces"))
        return Trees("root", roots, {"tree": tree, "points": wp.array(points, dtype=wp.vec3)}, arrays)
    meshes, rows = watertight_meshes(points, triangles, first, reaches)
    return Trees("mesh", [mesh.id for mesh in meshes], {"points": rows}, tuple(meshes))
