"""Bytes in a device's memory that a scene and a picture take (docs/effects.md states them per triangle and pixel).

The nodes of Warp's trees are not counted: Warp does not tell their size.
"""

from __future__ import annotations

from collections import Counter
from typing import Any

import warp as wp

from warpmis.device.upload import DeviceScene
from warpmis.device.views import ControlView, DomeView, FilmView, LightTreeView, SceneView, VaryingView, WideTreeView

# What an array of a view is for; "geometry" where nothing else is said.
PURPOSES = {
    "normals": "normals",
    "materials": "materials",
    "varying": "materials",
    "inputs": "materials",
    "albedos": "materials",
    "lookups": "materials",
    "tiles": "textures",
    "texels": "textures",
    "byte_values": "textures",
    "primvars": "primvars",
    "lights": "lights",
    "delta_lights": "lights",
    "emitter_triangles": "lights",
    "emitter_lights": "lights",
    "emitter_cdf": "lights",
    "emitter_places": "lights",
    "place_of_instance": "lights",
    "light_tree": "lights",
    "delta_tree": "lights",
    "rows": "lights",
    "child_nodes": "lights",
    "links": "lights",
    "analytic": "lights",
    "paths": "lights",
    "prim_links": "lights",
    "instances": "instances",
    "controls": "light controls",
    "prims": "prims",
    "faces": "ids",
    "copies": "ids",
    "dome": "dome",
}
STRUCTS: tuple[Any, ...] = (SceneView, WideTreeView, LightTreeView, VaryingView, DomeView, ControlView, FilmView)


def scene_bytes(scene: DeviceScene) -> dict[str, int]:
    """Bytes of a scene's arrays by what they are for, nothing that is not there."""
    total: Counter[str] = Counter()
    for part in (scene.view, *scene.owned):
        if isinstance(part, wp.Mesh):
            total["geometry"] += array_bytes(part.indices)  # the points are the view's
        elif isinstance(part, wp.Bvh):
            purpose = "instances" if part.id == scene.view.instance_bvh else "lights"
            total[purpose] += array_bytes([part.lowers, part.uppers])
        elif isinstance(part, list):
            total["light controls"] += array_bytes(part)
        else:
            for name, value in fields_of(part).items():
                total[PURPOSES.get(name, "geometry")] += array_bytes(value)
    return {purpose: size for purpose, size in total.items() if size}


def array_bytes(value: Any) -> int:
    """Bytes of an array, or of all arrays in a struct or a sequence; 0 for anything else."""
    if isinstance(value, wp.array):
        return int(value.size * wp.types.type_size_in_bytes(value.dtype))
    parts = value if isinstance(value, list | tuple) else fields_of(value).values()
    return sum(array_bytes(part) for part in parts)


def fields_of(value: Any) -> dict[str, Any]:
    """The fields of a struct; none of anything else."""
    for struct in STRUCTS:
        if isinstance(value, struct.cls):
            return {name: getattr(value, name) for name in struct.vars}
    return {}
