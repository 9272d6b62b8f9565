"""Polygons to triangles: fans for the convex ones, ear clipping for the few that need it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from warpmis.usd.shapes.ears import clip_ears

IntArray = NDArray[np.int64]
FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

# A corner turns inwards where its cross product points against the face normal by more than this share of the area.
REFLEX_TOLERANCE = 1e-7
# Faces are looked at in batches of this many, whose scratch memory fits a processor's cache.
BATCH_FACES = 1 << 14


@dataclass(frozen=True, eq=False)
class Polygons:
    """Faces of a mesh as USD stores them.

    Attributes:
        points: shape (n, 3).
        counts: corners per face, shape (m,), >= 0.
        indices: point of each corner, shape (sum of counts,), in range.
        usable: faces to be rendered (three corners or more), shape (m,).
    """

    points: FloatArray
    counts: IntArray
    indices: IntArray
    usable: BoolArray

    @cached_property
    def starts(self) -> IntArray:
        """First corner of each face, shape (m,)."""
        return np.cumsum(self.counts) - self.counts


def triangulate(polygons: Polygons) -> tuple[IntArray, IntArray]:
    """Triangles of the usable faces, in the faces' own winding: a face of n corners gives n - 2.

    A face with one reflex corner is star-shaped about that corner, so a fan from there is exact; a face of five corners
    or more with several is clipped ear by ear. (A quadrilateral with several crosses itself.)

    Returns:
        corners: index into `polygons.indices` of each triangle corner, shape (F, 3).
        faces: the face of each triangle, shape (F,).
    """
    faces = np.flatnonzero(polygons.usable)
    counts, starts = polygons.counts[faces], polygons.starts[faces]
    pivots, clipped = _fan_pivots(polygons, faces)
    triangles = counts - 2
    first = np.cumsum(triangles) - triangles
    step = np.arange(triangles.sum()) - np.repeat(first, triangles)
    size, pivot = np.repeat(counts, triangles), np.repeat(pivots, triangles)
    corners = np.stack([pivot, (pivot + step + 1) % size, (pivot + step + 2) % size], axis=-1)
    for count in np.unique(counts[clipped]):
        rows = np.flatnonzero(clipped & (counts == count))
        outlines = polygons.points[polygons.indices[starts[rows, None] + np.arange(count)]]
        corners[first[rows, None] + np.arange(count - 2)] = clip_ears(outlines)
    corners += np.repeat(starts, triangles)[:, None]
    return corners, np.repeat(faces, triangles)


def corner_neighbours(polygons: Polygons, faces: IntArray) -> tuple[IntArray, IntArray, IntArray, IntArray]:
    """For every corner of `faces`: the corner, the one before, the one after, and its row in `faces`; shape (c,)."""
    counts, starts = polygons.counts[faces], polygons.starts[faces]
    row: IntArray = np.repeat(np.arange(len(faces), dtype=np.int64), counts)
    local: IntArray = np.arange(int(counts.sum()), dtype=np.int64) - np.repeat(np.cumsum(counts) - counts, counts)
    size, start = counts[row], starts[row]
    return start + local, start + (local - 1) % size, start + (local + 1) % size, row


def corner_crosses(polygons: Polygons, faces: IntArray) -> tuple[IntArray, FloatArray, IntArray]:
    """Cross product (next - p) x (previous - p) at every corner of `faces`, as (corner, cross, row in faces)."""
    corner, before, after, row = corner_neighbours(polygons, faces)
    p, p_before, p_after = (polygons.points[polygons.indices[c]] for c in (corner, before, after))
    return corner, np.cross(p_after - p, p_before - p), row


def _fan_pivots(polygons: Polygons, faces: IntArray) -> tuple[IntArray, BoolArray]:
    """Per face the local corner to fan from, and whether it must be clipped instead; shape (len(faces),) each."""
    pivots = np.zeros(len(faces), np.int64)
    clipped = np.zeros(len(faces), bool)
    counts = polygons.counts[faces]
    for batch in _batches(np.flatnonzero(counts == 4)):
        pivots[batch] = _quad_pivots(polygons, faces[batch])
    for batch in _batches(np.flatnonzero(counts > 4)):
        pivots[batch], clipped[batch] = _large_fan_pivots(polygons, faces[batch])
    return pivots, clipped


def _batches(rows: IntArray) -> Iterator[IntArray]:
    return (rows[first : first + BATCH_FACES] for first in range(0, len(rows), BATCH_FACES))


def _quad_pivots(polygons: Polygons, faces: IntArray) -> IntArray:
    """The same of quadrilaterals, which most meshes are made of: a column for each corner, an axis at a time."""
    corners = polygons.indices[polygons.starts[faces, None] + np.arange(4)]
    p = np.ascontiguousarray(polygons.points[corners].transpose(1, 2, 0))  # (corner, axis, face)
    normal = _cross(p[2] - p[0], p[3] - p[1])  # twice the vector area
    edges = np.roll(p, -1, axis=0) - p
    turns = [np.einsum("af,af->f", _cross(edges[(i + 3) % 4], edges[i]), normal) for i in range(4)]
    reflex = np.stack(turns) < -REFLEX_TOLERANCE * np.einsum("af,af->f", normal, normal)
    return np.where(reflex.sum(axis=0) == 1, reflex.argmax(axis=0), 0)


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross products of vectors whose axes come first, shape (3, n)."""
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def _large_fan_pivots(polygons: Polygons, faces: IntArray) -> tuple[IntArray, BoolArray]:
    """The same of faces of more than four corners."""
    pivots = np.zeros(len(faces), np.int64)
    corner, before, after, row = corner_neighbours(polygons, faces)
    counts = polygons.counts[faces]
    begin = np.cumsum(counts) - counts
    p = polygons.points[polygons.indices[corner]]
    origin = p[begin][row]
    p_before, p_after = (polygons.points[polygons.indices[c]] for c in (before, after))
    normal = np.add.reduceat(np.cross(p - origin, p_after - origin), begin)  # Newell: twice the vector area
    turn = np.einsum("ij,ij->i", np.cross(p - p_before, p_after - p), normal[row])
    reflex = turn < -REFLEX_TOLERANCE * np.einsum("ij,ij->i", normal, normal)[row]
    number = np.add.reduceat(reflex.astype(np.int64), begin)
    single = reflex & (number == 1)[row]
    pivots[row[single]] = (corner - corner[begin][row])[single]
    return pivots, number > 1
