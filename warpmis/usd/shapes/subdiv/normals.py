"""Normals of the limit surface: from its tangents inside smooth parts, averaged along creases and borders.

Reference: Halstead, Kass and DeRose (1993), appendix A, for Catmull-Clark; Loop (1987) for Loop.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpmis.usd.shapes.subdiv.limit import SHARP
from warpmis.usd.shapes.subdiv.masks import LOOP, Scheme, gathered
from warpmis.usd.shapes.subdiv.topology import FloatArray, IntArray, Topology

# Tangents are summed for so many vertices at a time: their terms then fit a processor's cache.
BATCH_VERTICES = 1 << 15


def limit_normals(
    scheme: Scheme, topology: Topology, points: FloatArray, limits: FloatArray
) -> tuple[FloatArray, IntArray]:
    """Normals that break at sharp edges alone, of any length, shape (k, 3), and the row of each corner, shape (c,).

    Inside smooth parts they are the cross product of two tangents. Along creases and borders, and at vertices that do
    not have one closed ring of faces, they are averaged: the corners about a vertex that are joined by smooth edges
    share the sum of their cross products (next - p) x (previous - p).

    Args:
        points, limits: of the last refinement, and their limits, shape (n, 3) each.
    """
    rows, number = smooth_sectors(topology)
    inside, normals = _tangent_normals(scheme, topology, points)
    corners = np.flatnonzero(~inside[topology.indices])
    p, after, before = (
        limits[topology.indices[c]] for c in (corners, topology.following[corners], topology.preceding[corners])
    )
    averaged = gathered(rows[corners], np.cross(after - p, before - p), number)
    averaged[: len(inside)][inside] = normals[inside]
    return averaged, rows


def _tangent_normals(scheme: Scheme, topology: Topology, points: FloatArray) -> tuple[NDArray[np.bool_], FloatArray]:
    """Which vertices lie inside a smooth part, shape (n,), and their normals, shape (n, 3): products of two tangents.

    With w = 2 pi k / n and E_k the neighbours in order, the one tangent is for Loop the sum of cos(w) E_k, for
    Catmull-Clark, with Q_k the corner opposite in the face between E_k and E_k+1, the sum of
    A cos(w) E_k + (cos(w) + cos(w + 2 pi / n)) Q_k; the other has sines.
    """
    inside = _has_smooth_faces(topology)
    valence = np.bincount(topology.indices, minlength=len(points))
    start = np.zeros(len(points), np.int64)
    start[topology.indices] = np.arange(len(topology.indices))
    normals = np.zeros((len(points), 3))
    for first in range(0, len(points), BATCH_VERTICES):
        batch = first + np.flatnonzero(inside[first : first + BATCH_VERTICES])
        rows, vertices, corners, turn = np.arange(len(batch)), batch, start[batch], 0
        tangents = np.zeros((2, len(batch), 3))
        while len(rows):
            ahead = topology.following[corners]
            near, far = points[topology.indices[ahead]], points[topology.indices[topology.following[ahead]]]
            step = (2.0 * np.pi / valence[vertices])[:, None]
            for tangent, wave in zip(tangents, (np.cos, np.sin), strict=True):
                tangent[rows] += _tangent_terms(scheme, wave, turn, step, near, far)
            corners, turn = topology.twins[topology.preceding[corners]], turn + 1
            done, closes = valence[vertices] == turn, corners == start[vertices]
            inside[vertices[done != closes]] = False  # two rings of faces that touch in a vertex
            more = ~done & ~closes
            rows, vertices, corners = rows[more], vertices[more], corners[more]
        normals[batch] = np.cross(tangents[0], tangents[1])
    return inside, normals


def _tangent_terms(
    scheme: Scheme, wave: np.ufunc, turn: int, step: FloatArray, near: FloatArray, far: FloatArray
) -> FloatArray:
    here = wave(turn * step)
    if scheme is LOOP:
        return here * near
    weight = 1.0 + np.cos(step) + np.cos(step / 2.0) * np.sqrt(2.0 * (9.0 + np.cos(step)))
    return weight * here * near + (here + wave((turn + 1) * step)) * far


def _has_smooth_faces(topology: Topology) -> NDArray[np.bool_]:
    """Whether a vertex has three faces or more and smooth edges alone, shape (n,)."""
    smooth = topology.vertex_sharpness < SHARP
    smooth[topology.indices[topology.twins < 0]] = False
    smooth[topology.ends[(topology.edge_sharpness >= SHARP) | (topology.edge_faces != 2)]] = False
    return smooth & (np.bincount(topology.indices, minlength=len(smooth)) >= 3)


def smooth_sectors(topology: Topology) -> tuple[IntArray, int]:
    """A number for each corner that those about a vertex share which smooth edges join, and how many numbers there are.

    It is the vertex itself where no sharp edge parts its faces. Shape (c,).
    """
    n = len(topology.vertex_sharpness)
    parted = np.zeros(n, bool)
    parted[topology.ends[(topology.edge_sharpness >= SHARP) & (topology.edge_faces > 1)]] = True
    split = np.flatnonzero(parted[topology.indices])
    if not len(split):
        return topology.indices, n
    one, other = _joined_corners(topology, parted)
    lowest = np.arange(len(topology.indices))  # of the corners joined so far; each union hooks a root to a lower one
    while len(one):
        np.minimum.at(lowest, np.maximum(one, other), np.minimum(one, other))
        while (lowest[lowest] != lowest).any():
            lowest = lowest[lowest]
        one, other = lowest[one], lowest[other]
        apart = one != other
        one, other = one[apart], other[apart]
    labels, rows = np.unique(lowest[split], return_inverse=True)
    sectors = topology.indices.copy()
    sectors[split] = n + rows
    return sectors, n + len(labels)


def _joined_corners(topology: Topology, parted: NDArray[np.bool_]) -> tuple[IntArray, IntArray]:
    """Pairs of corners at one vertex with a smooth edge between them, shape (j,) each, about the parted vertices."""
    smooth = (topology.edge_sharpness < SHARP) & parted[topology.ends].any(axis=1)
    there = np.flatnonzero(smooth[topology.edges] & (topology.twins > np.arange(len(topology.indices))))
    back = topology.twins[there]
    one = np.concatenate([there, topology.following[there]])
    other = np.concatenate([topology.following[back], back])
    return one, other
