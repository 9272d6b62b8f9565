"""Triangles: those that stand in world space, and those of prototypes, which stand in many places, in memory once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Float32Array = NDArray[np.float32]
Int32Array = NDArray[np.int32]
Bounds = tuple[NDArray[np.float64], NDArray[np.float64]]

# Prototypes are bounded by the boxes of what lies in the cells of a grid with so many along each axis. These are
# carried to world space in batches of about so many, which bounds the scratch memory.
GRID = 8
BATCH_BOXES = 1 << 20


@dataclass(frozen=True, eq=False)
class Geometry:
    """Triangles in one space: the scene's, or a prototype's own.

    Attributes:
        points: vertex positions [scene units], shape (V, 3) float32, finite.
        triangles: vertex indices, counter-clockwise seen from the front, shape (F, 3) int32, in range, F >= 0.
        normals: unit shading normals, shape (K, 3) float32, on the front side.
        normal_indices: per triangle corner the row of `normals`, or -1 in all three for a flat triangle,
            shape (F, 3) int32.
        materials: per triangle the index into Scene.materials, shape (F,) int32.
        prims: per triangle the index into Scene.prims, shape (F,) int32.
        primvars: per triangle corner what the lookups of the triangle's material read, shape (F, 3, P) float32,
            finite, or NaN in a prototype whose places have a value; P is 0 where no material has any.
        faces: per triangle the face, curve or point of the prim that it came from, shape (F,) int32; or empty.
        copies: per triangle which of the prim's places it stands in, shape (F,) int32; or empty: all are 0.
    """

    points: Float32Array
    triangles: Int32Array
    normals: Float32Array
    normal_indices: Int32Array
    materials: Int32Array
    prims: Int32Array
    primvars: Float32Array = field(default_factory=lambda: np.zeros((0, 3, 0), np.float32))
    faces: Int32Array = field(default_factory=lambda: np.zeros(0, np.int32))
    copies: Int32Array = field(default_factory=lambda: np.zeros(0, np.int32))

    def ordered(self, rows: NDArray[np.int64]) -> Geometry:
        """The triangles of these rows, in this order, among the same points."""
        return replace(
            self,
            triangles=self.triangles[rows],
            normal_indices=self.normal_indices[rows],
            materials=self.materials[rows],
            prims=self.prims[rows],
            primvars=self.primvars[rows] if self.primvars.size else self.primvars,
            faces=self.faces[rows] if self.faces.size else self.faces,
            copies=self.copies[rows] if self.copies.size else self.copies,
        )

    @property
    def nbytes(self) -> int:
        return sum(column.nbytes for column in vars(self).values())


def joined(parts: Sequence[Geometry]) -> Geometry:
    """One Geometry of several, their triangles one after the other; without triangles where there are none."""
    if len(parts) == 1:
        return parts[0]
    points_before = np.cumsum([0, *(len(part.points) for part in parts)])
    normals_before = np.cumsum([0, *(len(part.normals) for part in parts)])
    triangles_before = np.cumsum([0, *(len(part.triangles) for part in parts)])
    result = Geometry(
        points=np.empty((points_before[-1], 3), np.float32),
        triangles=np.empty((triangles_before[-1], 3), np.int32),
        normals=np.empty((normals_before[-1], 3), np.float32),
        normal_indices=np.empty((triangles_before[-1], 3), np.int32),
        materials=np.empty(triangles_before[-1], np.int32),
        prims=np.empty(triangles_before[-1], np.int32),
        primvars=np.zeros((triangles_before[-1], 3, max((p.primvars.shape[-1] for p in parts), default=0)), np.float32),
        faces=np.zeros(triangles_before[-1], np.int32),
        copies=np.zeros(triangles_before[-1], np.int32),
    )
    for number, part in enumerate(parts):
        rows = slice(triangles_before[number], triangles_before[number + 1])
        result.points[points_before[number] : points_before[number + 1]] = part.points
        result.normals[normals_before[number] : normals_before[number + 1]] = part.normals
        result.triangles[rows] = part.triangles + points_before[number]
        result.normal_indices[rows] = np.where(
            part.normal_indices >= 0, part.normal_indices + normals_before[number], -1
        )
        result.materials[rows], result.prims[rows] = part.materials, part.prims
        if part.faces.size:
            result.faces[rows] = part.faces
        if part.copies.size:
            result.copies[rows] = part.copies
        if part.primvars.size:
            result.primvars[rows, :, : part.primvars.shape[-1]] = part.primvars
    return result


@dataclass(frozen=True, eq=False)
class Prototype:
    """Triangles that stand in several places and are traced through the places' transforms.

    Attributes:
        geometry: in the prototype's own space, one triangle at least.
        linear, translation: of each place, where a point p of the geometry is: linear @ p + translation
            [scene units], shapes (k, 3, 3) and (k, 3) float64. `linear` is invertible, and may mirror.
        prims: of each place the index into Scene.prims, shape (k,) int32; it stands for that of the triangles.
        copies: of each place which one of that prim's it is, shape (k,) int32; it stands for that of the triangles.
        primvars: of each place what it has in place of the geometry's primvars that are NaN, shape (k, P) float32; or
            empty: none is.
    """

    geometry: Geometry
    linear: NDArray[np.float64]
    translation: NDArray[np.float64]
    prims: Int32Array
    copies: Int32Array
    primvars: Float32Array = field(default_factory=lambda: np.zeros((0, 0), np.float32))

    @cached_property
    def boxes(self) -> Bounds:
        """Smallest and largest corner of boxes that hold each place's triangles [scene units], shape (k, 3) each.

        Of what lies in a cell of a grid over the prototype, its box is carried along: less than a cell too large.
        """
        center, reach = cells(used_points(self.geometry))
        low, high = np.empty_like(self.translation), np.empty_like(self.translation)
        batch = max(1, BATCH_BOXES // len(center))
        for start in range(0, len(low), batch):
            rows = self.linear[start : start + batch].reshape(-1, 3).T
            carried, around = center @ rows, reach @ np.abs(rows)
            low[start : start + batch] = (carried - around).min(axis=0).reshape(-1, 3)
            high[start : start + batch] = (carried + around).max(axis=0).reshape(-1, 3)
        return low + self.translation, high + self.translation


def used_points(geometry: Geometry) -> NDArray[np.float64]:
    """The points that triangles have, shape (n, 3)."""
    used = np.zeros(len(geometry.points), bool)
    used[geometry.triangles] = True
    return geometry.points[used].astype(np.float64)


def cells(points: NDArray[np.float64]) -> Bounds:
    """Centre and half size of the boxes of what lies in each cell of a grid, shape (n, 3) each; the points where there
    are no more of them than cells."""
    if len(points) <= GRID**3:
        return points, np.zeros_like(points)
    low, extent = points.min(axis=0), np.ptp(points, axis=0)
    place = np.minimum((points - low) / np.where(extent > 0.0, extent, 1.0) * GRID, GRID - 1).astype(np.int64)
    cell = place @ np.array([1, GRID, GRID**2])
    order = np.argsort(cell, kind="stable")
    starts = np.unique(cell[order], return_index=True)[1]
    smallest = np.minimum.reduceat(points[order], starts, axis=0)
    largest = np.maximum.reduceat(points[order], starts, axis=0)
    return (smallest + largest) / 2.0, (largest - smallest) / 2.0


def boxes(geometry: Geometry, prototypes: Sequence[Prototype]) -> Iterator[Bounds]:
    """Of what stands in world space, and of each prototype: the boxes that hold it, shape (k, 3) each."""
    if len(geometry.triangles):
        points = used_points(geometry)
        yield points.min(axis=0)[None], points.max(axis=0)[None]
    for prototype in prototypes:
        yield prototype.boxes


def bounds(geometry: Geometry, prototypes: Sequence[Prototype]) -> Bounds | None:
    """Smallest and largest corner of all triangles [scene units], shape (3,) each; None where there are none."""
    found = list(boxes(geometry, prototypes))
    if not found:
        return None
    low, high = (np.concatenate(ends) for ends in zip(*found, strict=True))
    return low.min(axis=0), high.max(axis=0)
