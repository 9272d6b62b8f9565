"""The subdivision properties of a UsdGeomMesh: creases, corners, the border, and which faces are not shown."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpmis.usd.reading import Reading
from warpmis.usd.shapes.subdiv.topology import FloatArray, IntArray, Topology, edge_table

SHARPNESS_INFINITE = 10.0  # UsdGeomMesh's


def read_cage(
    mesh: Any, counts: IntArray, indices: IntArray, points: int, reading: Reading
) -> tuple[Topology, NDArray[np.bool_]]:
    """The cage with its sharpness, and the faces that interpolateBoundary makes holes, shape (m,).

    Args:
        counts, indices: sound faces, of three corners or more with indices below `points`.
    """
    bare = edge_table(counts, indices, points)
    creases = _creased_edges(mesh, bare, reading)
    corners = _corner_vertices(mesh, points, reading)
    hidden = np.zeros(len(counts), bool)
    if interpolate_boundary(mesh, reading) == "edgeAndCorner":
        corners[np.bincount(indices, minlength=points) == 1] = np.inf
    elif hides_border(mesh, reading):
        open_ends = np.zeros(points, bool)
        open_ends[bare.ends[(bare.edge_faces == 1) & np.isfinite(creases)]] = True
        hidden = np.logical_or.reduceat(open_ends[indices], bare.starts)
    sharpness = np.maximum(bare.edge_sharpness, creases)
    return replace(bare, edge_sharpness=sharpness, vertex_sharpness=corners), hidden


def interpolate_boundary(mesh: Any, reading: Reading) -> str:
    return str(reading.get(mesh.GetInterpolateBoundaryAttr(), "edgeAndCorner"))


def hides_border(mesh: Any, reading: Reading) -> bool:
    """Whether faces along open edges are holes."""
    return interpolate_boundary(mesh, reading) == "none"


def _creased_edges(mesh: Any, cage: Topology, reading: Reading) -> FloatArray:
    """Authored sharpness of every edge, shape (e,)."""
    sharpness = np.zeros(len(cage.ends))
    points = reading.indices(mesh.GetCreaseIndicesAttr())
    lengths = reading.indices(mesh.GetCreaseLengthsAttr())
    values = reading.numbers(mesh.GetCreaseSharpnessesAttr())
    if not len(points) and not len(lengths):
        return sharpness
    segments = lengths - 1
    if (segments < 1).any() or lengths.sum() != len(points) or len(values) not in (len(lengths), segments.sum()):
        reading.warn(mesh.GetPath(), "creases left out: creaseIndices, creaseLengths and creaseSharpnesses disagree")
        return sharpness
    if len(values) == len(lengths):
        values = np.repeat(values, segments)
    last = np.cumsum(lengths) - 1
    begin, end = np.delete(points, last), np.delete(points, last - lengths + 1)
    edge = find_edges(cage, begin, end)
    if (edge < 0).any():
        reading.warn(mesh.GetPath(), f"{int((edge < 0).sum())} creases left out: the mesh has no such edges")
    np.maximum.at(sharpness, edge[edge >= 0], _as_sharpness(values[edge >= 0]))
    return sharpness


def find_edges(cage: Topology, begin: IntArray, end: IntArray) -> IntArray:
    """The edge between each pair of vertices, -1 where there is none, shape (k,)."""
    n = len(cage.vertex_sharpness)
    keys = cage.ends[:, 0] * n + cage.ends[:, 1]  # ascending, as edge_table made them
    wanted = np.minimum(begin, end) * n + np.maximum(begin, end)
    inside = (np.minimum(begin, end) >= 0) & (np.maximum(begin, end) < n)
    place = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
    return np.where(inside & (keys[place] == wanted), place, -1)


def _corner_vertices(mesh: Any, points: int, reading: Reading) -> FloatArray:
    """Authored sharpness of every vertex, shape (n,)."""
    sharpness = np.zeros(points)
    vertices = reading.indices(mesh.GetCornerIndicesAttr())
    values = reading.numbers(mesh.GetCornerSharpnessesAttr())
    if len(vertices) != len(values):
        reading.warn(mesh.GetPath(), f"corners left out: {len(vertices)} indices, but {len(values)} sharpnesses")
        return sharpness
    inside = (vertices >= 0) & (vertices < points)
    if not inside.all():
        reading.warn(mesh.GetPath(), f"{int((~inside).sum())} corners left out: the mesh has {points} points")
    sharpness[vertices[inside]] = _as_sharpness(values[inside])
    return sharpness


def _as_sharpness(values: FloatArray) -> FloatArray:
    """Values as Topology has them: none below 0 and no NaN, and infinite from USD's bound on."""
    return np.where(values >= SHARPNESS_INFINITE, np.inf, np.where(values > 0.0, values, 0.0))
