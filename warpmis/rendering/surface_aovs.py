"""Pictures of the surface in the middle of each pixel: its texture coordinates, prim, material and motion.

They are values of one point, not means: a mean of two ids or of two coordinates is neither.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpmis.device.order import morton_order
from warpmis.scene import Camera, Material, Scene
from warpmis.scene.geometry import Geometry
from warpmis.scene.texture import TextureLookup

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Places:
    """Where pixels' middles lie on surfaces.

    Attributes:
        pixels: those that see one, shape (n,).
        parts: of each the row in Scene.parts, shape (n,).
        triangles: the row in that part's geometry, shape (n,).
        instances: which of all prototypes' places, -1 for a triangle in world space, shape (n,).
        weights: of the triangle's corners, shape (n, 3).
    """

    pixels: NDArray[np.int64]
    parts: NDArray[np.int64]
    triangles: NDArray[np.int64]
    instances: NDArray[np.int64]
    weights: Array


def places_of(scene: Scene, rows: NDArray[np.int32], weights: NDArray[np.float32]) -> Places:
    """rows, weights: what kernels/first_surface.py finds, shape (pixels, 2) each; triangles are rows on the device."""
    pixels = np.flatnonzero(rows[:, 0] >= 0)
    triangles, instances = rows[pixels].astype(np.int64).T
    # On the device an empty part has one triangle (device/upload.py).
    counts = [max(len(part.triangles), 1) for part in scene.parts]
    first = np.cumsum([0, *counts])
    parts = np.searchsorted(first, triangles, side="right") - 1
    local = triangles - first[parts]
    for index, part in enumerate(scene.parts):
        of_part = parts == index
        if of_part.any():
            local[of_part] = morton_order(part.points, part.triangles)[local[of_part]]
    u, v = weights[pixels].astype(np.float64).T
    return Places(pixels, parts, local, instances, np.stack([u, v, 1.0 - u - v], axis=1))


def surface_aovs(asked: Sequence[str], scene: Scene, places: Places) -> dict[str, NDArray[np.float32]]:
    """Those of surfaces among the AOVs that were asked for: (H, W) of ids, (H, W, 2) of all else."""
    width, height = scene.resolution
    make: dict[str, Callable[[], NDArray[np.float32]]] = {
        "uv": lambda: _spread(texture_coordinates(scene, places), places, width * height, 0.0),
        "materialId": lambda: _spread(_of_triangles(scene, places, "materials"), places, width * height, -1.0),
        "primId": lambda: _spread(prims(scene, places), places, width * height, -1.0),
        "motion": lambda: motion(scene, places),
    }
    return {
        name: picture().reshape(height, width, -1).squeeze(axis=2)
        if name.endswith("Id")
        else picture().reshape(height, width, 2)
        for name, picture in make.items()
        if name in asked
    }


def _spread(
    values: NDArray[np.floating] | NDArray[np.integer], places: Places, count: int, empty: float
) -> NDArray[np.float32]:
    found = np.full((count, *values.shape[1:]), empty, np.float32)
    found[places.pixels] = values
    return found


def _of_triangles(scene: Scene, places: Places, column: str) -> NDArray[np.int64]:
    found = np.zeros(len(places.pixels), np.int64)
    for index, part in enumerate(scene.parts):
        of_part = places.parts == index
        found[of_part] = getattr(part, column)[places.triangles[of_part]]
    return found


def prims(scene: Scene, places: Places) -> NDArray[np.int64]:
    """Rows of Scene.prims."""
    found = _of_triangles(scene, places, "prims")
    if scene.prototypes:
        of_places = np.concatenate([prototype.prims for prototype in scene.prototypes])
        is_placed = places.instances >= 0
        found[is_placed] = of_places[places.instances[is_placed]]
    return found


def texture_coordinates(scene: Scene, places: Places) -> Array:
    """Those by which the material's first texture is looked up, 0 where it has none, shape (n, 2)."""
    found = np.zeros((len(places.pixels), 2))
    materials = _of_triangles(scene, places, "materials")
    columns = np.array([_coordinate_column(material) for material in scene.materials] or [-1])[materials]
    for index, part in enumerate(scene.parts):
        rows = np.flatnonzero((places.parts == index) & (columns >= 0))
        if rows.size:
            corners = part.primvars[places.triangles[rows]].astype(np.float64)
            both = columns[rows][:, None] + np.arange(2)
            values = np.take_along_axis(corners, np.repeat(both[:, None], 3, axis=1), axis=2)
            found[rows] = np.nan_to_num((values * places.weights[rows][..., None]).sum(axis=1))
    return found


def _coordinate_column(material: Material) -> int:
    lookups = list(material.lookups.values())
    return next((lookup.column for lookup in lookups if isinstance(lookup, TextureLookup)), -1)


def motion(scene: Scene, places: Places) -> NDArray[np.float32]:
    """How far what each pixel shows moves until Scene.next_frame, x to the right and y upwards [pixel], shape
    (pixels, 2). Where nothing is seen, what is infinitely far away moves; 0 where a part has other triangles then."""
    width, height = scene.resolution
    later = scene.next_frame
    found = np.zeros((width * height, 2))
    if later is None:
        return found.astype(np.float32)
    column, row = np.arange(width * height) % width, np.arange(width * height) // width
    ahead = directions(scene.camera, (column + 0.5) / width, (row + 0.5) / height)
    if not scene.camera.orthographic:
        found = _projected(later.camera, ahead) - _projected(scene.camera, ahead)
    found[places.pixels] = 0.0
    moves = np.array([np.array_equal(a.triangles, b.triangles) for a, b in zip(scene.parts, later.parts, strict=False)])
    if len(scene.parts) == len(later.parts) and scene.instance_count == later.instance_count:
        known = moves[places.parts]
        now, then = points(scene, places) + scene.origin, points(later, places, known) + later.origin
        apart = _projected(later.camera, then - later.camera.position - later.origin)
        apart = apart - _projected(scene.camera, now - scene.camera.position - scene.origin)
        found[places.pixels[known]] = apart[known]
    return (np.nan_to_num(found, posinf=0.0, neginf=0.0) * (width, height)).astype(np.float32)


def points(scene: Scene, places: Places, known: NDArray[np.bool_] | None = None) -> Array:
    """The places in the scene's space, shape (n, 3); of those `known` alone."""
    found = np.zeros((len(places.pixels), 3))
    for index, part in enumerate(scene.parts):
        rows = np.flatnonzero((places.parts == index) if known is None else (places.parts == index) & known)
        if rows.size:
            corners = _corners(part, places.triangles[rows])
            found[rows] = (corners * places.weights[rows][..., None]).sum(axis=1)
    if scene.prototypes:
        linear = np.concatenate([prototype.linear for prototype in scene.prototypes])
        translation = np.concatenate([prototype.translation for prototype in scene.prototypes])
        rows = np.flatnonzero(places.instances >= 0)
        of_place = places.instances[rows]
        found[rows] = np.einsum("nij,nj->ni", linear[of_place], found[rows]) + translation[of_place]
    return found


def _corners(part: Geometry, triangles: NDArray[np.int64]) -> Array:
    return np.asarray(part.points[part.triangles[triangles]], np.float64)


def directions(camera: Camera, x: Array, y: Array) -> Array:
    """Through points of the picture, both coordinates in [0, 1) from its upper left corner, shape (n, 3)."""
    left, right, bottom, top = camera.window
    across, up = left + x * (right - left), top + y * (bottom - top)
    return np.asarray(camera.forward + across[:, None] * camera.right_axis + up[:, None] * camera.up_axis)


def _projected(camera: Camera, ahead: Array) -> Array:
    """Where a vector from the camera meets its picture, shape (n, 2), from the lower left corner, which is (0, 0), to
    the upper right one, (1, 1); not a number behind the camera."""
    left, right, bottom, top = camera.window
    depth = np.ones(len(ahead)) if camera.orthographic else ahead @ camera.forward
    with np.errstate(divide="ignore", invalid="ignore"):
        across = np.where(depth > 0.0, ahead @ camera.right_axis / depth, np.nan)
        up = np.where(depth > 0.0, ahead @ camera.up_axis / depth, np.nan)
    return np.stack([(across - left) / (right - left), (up - bottom) / (top - bottom)], axis=1)
