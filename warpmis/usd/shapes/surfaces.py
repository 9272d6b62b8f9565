"""Surfaces in their own space, and the Geometry that they make where matrices put them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from warpmis.scene.geometry import Geometry, joined
from warpmis.usd.reading import MAX_COORDINATE

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# Instances are placed in batches of about this many triangles, which bounds the float64 scratch memory.
BATCH_TRIANGLES = 1 << 20


class PrimvarCarrier(Protocol):
    """The way of a gprim's primvars from its elements to places on the surface."""

    @property
    def elements(self) -> Mapping[str, int]:
        """How many values each interpolation needs."""

    def primvar(self, values: FloatArray, indices: IntArray, interpolation: str) -> tuple[FloatArray, IntArray]:
        """A primvar at the places: values, shape (v, k), and the row of each place, shape (c,).

        Args:
            values: as authored, shape (u, k), u being what the interpolation needs unless there are indices.
            indices: the primvar's, in range, or none, shape (i,) or (0,).
        """


@dataclass(frozen=True, eq=False)
class Surface:
    """The triangles of one gprim in its own space.

    Attributes:
        points: shape (n, 3).
        triangles: point indices, counter-clockwise seen from the front, shape (f, 3).
        faces: the polygon that each triangle came from, shape (f,).
        normals: shading normals, of any length, shape (m, 3); none for a flat surface.
        normal_indices: shape (f, 3), -1 for a flat triangle.
        corners: of each triangle corner its place among those of `carrier`, shape (f, 3), or (f, 1) for all three.
        carrier: brings primvars to these places; None where the whole surface is one.
    """

    points: FloatArray
    triangles: IntArray
    faces: IntArray
    normals: FloatArray
    normal_indices: IntArray
    corners: IntArray | None = None
    carrier: PrimvarCarrier | None = None


def flat_surface(
    points: FloatArray,
    triangles: IntArray,
    faces: IntArray,
    corners: IntArray | None = None,
    carrier: PrimvarCarrier | None = None,
) -> Surface:
    """A surface without shading normals."""
    return Surface(points, triangles, faces, np.empty((0, 3)), np.full(triangles.shape, -1, np.int64), corners, carrier)


def reversed_surface(surface: Surface) -> Surface:
    """The same surface with its front where its back was."""
    return Surface(
        surface.points,
        surface.triangles[:, ::-1],
        surface.faces,
        -surface.normals,
        surface.normal_indices[:, ::-1],
        None if surface.corners is None else surface.corners[:, ::-1],
        surface.carrier,
    )


NO_PLACES = np.zeros((0, 0), np.float32)


@dataclass(frozen=True, eq=False)
class Shading:
    """What a surface's triangles are made of.

    Attributes:
        materials: index into Scene.materials, shape (f,).
        primvars: what each triangle's material reads at its corners, shape (f, 3, p) float32; NaN where it reads what
            the place has.
        places: what the surface's places have of these columns, shape (k, p); NO_PLACES where no column is NaN.
    """

    materials: NDArray[np.int64]
    primvars: NDArray[np.float32]
    places: NDArray[np.float32] = field(default_factory=lambda: NO_PLACES)


def placed(
    surface: Surface, shading: Shading, matrices: FloatArray, prims: IntArray, copies: IntArray
) -> tuple[Geometry, NDArray[np.bool_]]:
    """A surface put where each matrix says.

    Args:
        matrices: local to world, USD's row-vector convention, shape (k, 4, 4), finite.
        prims, copies: of each matrix the index into Scene.prims, and which of that prim's places it is, shape (k,).

    Returns:
        the triangles, without those that have no area, and which of the places float32 can hold, shape (k,).
    """
    batch = max(1, BATCH_TRIANGLES // max(1, len(surface.triangles)))
    starts = range(0, len(matrices), batch)
    parts = []
    for rows in (slice(start, start + batch) for start in starts):
        own = replace(shading, places=shading.places[rows]) if shading.places.size else shading
        parts.append(_placed_batch(surface, own, matrices[rows], prims[rows], copies[rows]))
    return joined([part for part, _ in parts]), np.concatenate([inside for _, inside in parts])


def _placed_batch(
    surface: Surface, shading: Shading, matrices: FloatArray, prims: IntArray, copies: IntArray
) -> tuple[Geometry, NDArray[np.bool_]]:
    points, inside = placed_points(surface.points, matrices)
    matrices, count = matrices[inside], int(inside.sum())
    triangles, normals, normal_indices = _placed_topology(surface, matrices)
    points = points.reshape(-1, 3)
    cross = _double_vector_area(points, triangles)
    normals, normal_indices = _facing_front(normals, normal_indices, cross)
    has_area = (cross != 0.0).any(axis=-1)
    keep = slice(None) if has_area.all() else has_area  # a slice copies nothing
    return Geometry(
        points=points,
        triangles=triangles[keep].astype(np.int32),
        normals=normals,
        normal_indices=normal_indices[keep].astype(np.int32),
        materials=np.tile(shading.materials, count)[keep].astype(np.int32),
        prims=np.repeat(prims[inside], len(surface.triangles))[keep].astype(np.int32),
        primvars=_placed_primvars(shading, inside, is_mirrored(matrices))[keep],
        faces=np.tile(surface.faces, count)[keep].astype(np.int32),
        copies=np.repeat(copies[inside], len(surface.triangles))[keep].astype(np.int32),
    ), inside


def placed_points(points: FloatArray, matrices: FloatArray) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """World positions of the instances that float32 can hold, shape (k', n, 3), and which they are, shape (k,)."""
    world = points @ matrices[:, :3, :3] + matrices[:, None, 3, :3]
    inside = np.asarray((np.abs(world) < MAX_COORDINATE).all(axis=(1, 2)))
    return world[inside].astype(np.float32), inside


def cofactors(linear: FloatArray) -> FloatArray:
    """The matrices that carry normals, n' = n @ cofactors: det * inverse transpose, also of singular matrices."""
    a, b, c = linear[..., 0, :], linear[..., 1, :], linear[..., 2, :]
    return np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=-2)


def without_scale(matrices: FloatArray) -> FloatArray:
    """The linear parts, each over its largest entry, shape (k, 3, 3)."""
    linear = matrices[:, :3, :3]
    scale = np.abs(linear).max(axis=(1, 2), keepdims=True)
    return linear / np.where(scale > 0.0, scale, 1.0)


def is_mirrored(matrices: FloatArray) -> NDArray[np.bool_]:
    return np.linalg.det(without_scale(matrices)) < 0.0


def _wound(rows: NDArray[np.float32], mirrored: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Corner values of all instances, shape (k * f, 3, p): a mirrored one's corners stand the other way round."""
    if len(mirrored) == 1:
        return rows[:, ::-1] if mirrored[0] else rows
    wound = np.where(mirrored[:, None, None, None], rows[:, ::-1], rows)
    return wound.reshape(len(mirrored) * len(rows), *rows.shape[1:])


def _placed_primvars(shading: Shading, inside: NDArray[np.bool_], mirrored: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Corner values of all instances, with the places' own where these count."""
    primvars = _wound(shading.primvars, mirrored)
    if not shading.places.size:
        return primvars
    of_places = np.repeat(shading.places[inside], len(shading.primvars), axis=0)[:, None]
    return np.where(np.isnan(primvars), of_places, primvars)


def _placed_topology(surface: Surface, matrices: FloatArray) -> tuple[IntArray, NDArray[np.float32], IntArray]:
    """Triangles, unit normals and normal indices of all instances; a mirrored one is wound the other way."""
    linear = without_scale(matrices)
    mirrored = is_mirrored(matrices)
    instance = np.arange(len(matrices))[:, None, None]

    def repeated(rows: IntArray, stride: int) -> IntArray:
        wound = np.where(mirrored[:, None, None], rows[:, ::-1], rows)
        return np.where(wound >= 0, wound + instance * stride, -1).reshape(-1, 3)

    return (
        repeated(surface.triangles, len(surface.points)),
        _placed_normals(surface.normals, linear, mirrored),
        repeated(surface.normal_indices, len(surface.normals)),
    )


def _placed_normals(normals: FloatArray, linear: FloatArray, mirrored: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Unit normals of all instances as float32 holds them, shape (k * m, 3); NaN for one without a direction."""
    if not len(normals):
        return np.empty((0, 3), np.float32)
    carried = normals @ cofactors(linear) * np.where(mirrored, -1.0, 1.0)[:, None, None]
    length = np.linalg.norm(carried, axis=-1, keepdims=True)
    unit = np.where((length > 0.0) & np.isfinite(length), carried / length, np.nan)
    return unit.reshape(-1, 3).astype(np.float32)


def _double_vector_area(points: NDArray[np.float32], triangles: IntArray) -> FloatArray:
    """Cross product of two edges, towards the front, shape (f, 3), of the points as float32 holds them."""
    found = np.empty((len(triangles), 3))
    for rows in batches(len(triangles)):
        a, b, c = (points[triangles[rows, i]].astype(np.float64) for i in range(3))
        found[rows] = np.cross(b - a, c - a)
    return found


def batches(count: int) -> Iterator[slice]:
    """Rows of so many triangles, some at a time."""
    return (slice(start, start + BATCH_TRIANGLES) for start in range(0, count, BATCH_TRIANGLES))


def _facing_front(
    normals: NDArray[np.float32], indices: IntArray, front: FloatArray
) -> tuple[NDArray[np.float32], IntArray]:
    """Shading normals made to lie on the front side of every triangle that uses them.

    A triangle whose three normals all point to its back gets their opposites; one whose normals disagree, or are
    zero or NaN, becomes flat.
    """
    if not len(normals) or not len(indices):
        return np.empty((0, 3), np.float32), np.full(indices.shape, -1, np.int64)
    ahead, behind = np.empty(len(indices), bool), np.empty(len(indices), bool)
    for rows in batches(len(indices)):
        cosine = np.einsum("fcj,fj->fc", normals[indices[rows]].astype(np.float64), front[rows])
        flat = (indices[rows] < 0).any(axis=1)
        ahead[rows] = (cosine > 0.0).all(axis=1) & ~flat
        behind[rows] = (cosine < 0.0).all(axis=1) & ~flat
    if behind.any():
        indices = np.where(behind[:, None], indices + len(normals), indices)
        normals = np.concatenate([normals, -normals])
    indices = np.where((ahead | behind)[:, None], indices, -1)
    return np.where(np.isfinite(normals), normals, 0.0), indices
