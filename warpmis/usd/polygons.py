"""Polygons to triangles: fans for the convex ones, ear clipping for the few that need it. NumPy alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

IntArray = NDArray[np.int64]
FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

# A corner turns inwards where its cross product points against the face normal by more than this share of the area.
REFLEX_TOLERANCE = 1e-7


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

    @property
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
    for i in np.flatnonzero(clipped):
        outline = polygons.points[polygons.indices[starts[i] : starts[i] + counts[i]]]
        corners[first[i] : first[i] + triangles[i]] = clip_ears(outline)
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
    large = np.flatnonzero(polygons.counts[faces] >= 4)
    if not len(large):
        return pivots, clipped
    corner, before, after, row = corner_neighbours(polygons, faces[large])
    counts = polygons.counts[faces[large]]
    begin = np.cumsum(counts) - counts
    p = polygons.points[polygons.indices[corner]]
    origin = p[begin][row]
    p_before, p_after = (polygons.points[polygons.indices[c]] for c in (before, after))
    normal = np.add.reduceat(np.cross(p - origin, p_after - origin), begin)  # Newell: twice the vector area
    turn = np.einsum("ij,ij->i", np.cross(p - p_before, p_after - p), normal[row])
    reflex = turn < -REFLEX_TOLERANCE * np.einsum("ij,ij->i", normal, normal)[row]
    number = np.add.reduceat(reflex.astype(np.int64), begin)
    single = reflex & (number == 1)[row]
    pivots[large[row[single]]] = (corner - corner[begin][row])[single]
    clipped[large] = (number > 1) & (counts > 4)
    return pivots, clipped


def clip_ears(outline: FloatArray) -> IntArray:
    """Ear clipping of one simple polygon.

    Args:
        outline: corners in order, about planar, shape (n, 3).

    Returns:
        Local corner indices, shape (n - 2, 3), wound as the outline. What is left of a polygon that crosses itself
        becomes a fan.
    """
    flat = _flattened(outline)
    remaining = list(range(len(outline)))
    triangles: list[tuple[int, int, int]] = []
    while len(remaining) > 3:
        ear = next((i for i in range(len(remaining)) if _is_ear(flat, remaining, i)), None)
        if ear is None:
            break
        triangles.append((remaining[ear - 1], remaining[ear], remaining[(ear + 1) % len(remaining)]))
        del remaining[ear]
    triangles += [(remaining[0], remaining[i], remaining[i + 1]) for i in range(1, len(remaining) - 1)]
    return np.array(triangles, np.int64)


def _flattened(outline: FloatArray) -> FloatArray:
    """The outline in its own plane, counter-clockwise, shape (n, 2): the normal's largest axis is left out."""
    local = outline - outline[0]
    normal = np.cross(local, np.roll(local, -1, axis=0)).sum(axis=0)
    axis = int(np.argmax(np.abs(normal)))
    flat = local[:, [(axis + 1) % 3, (axis + 2) % 3]]
    return np.asarray(flat if normal[axis] > 0 else flat * np.array([-1.0, 1.0]))


def _is_ear(flat: FloatArray, remaining: list[int], i: int) -> bool:
    """Whether corner i of the remaining polygon is convex with no other corner inside its triangle."""
    before, here, after = remaining[i - 1], remaining[i], remaining[(i + 1) % len(remaining)]
    a, b, c = flat[before], flat[here], flat[after]
    if _cross2(b - a, c - a) <= 0.0:
        return False
    others = flat[[j for j in remaining if j not in (before, here, after)]]
    others = others[(others != a).any(axis=1) & (others != b).any(axis=1) & (others != c).any(axis=1)]
    inside = (_cross2(b - a, others - a) >= 0) & (_cross2(c - b, others - b) >= 0) & (_cross2(a - c, others - c) >= 0)
    return not bool(inside.any())


def _cross2(u: FloatArray, v: FloatArray) -> Any:
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
