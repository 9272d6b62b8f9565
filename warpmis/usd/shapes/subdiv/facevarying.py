"""faceVarying primvars: a topology of their own, whose borders are the seams where values differ.

Reference: OpenSubdiv's face-varying interpolation rules, which faceVaryingLinearInterpolation names.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpmis.usd.shapes.subdiv.topology import IntArray, Topology, edge_table


def value_topology(cage: Topology, rows: IntArray, linear: str) -> tuple[Topology, IntArray]:
    """The topology of a primvar's values over the faces of `cage`.

    Args:
        rows: the value of each corner, shape (c,); corners of one vertex with the same value are joined there.
        linear: faceVaryingLinearInterpolation, one of all its values but "all".

    Returns:
        The topology, whose vertices are the distinct values at each of the cage's, and the row of each, shape (n,).
    """
    stride = int(rows.max(initial=0)) + 1
    keys, indices = np.unique(cage.indices * stride + rows, return_inverse=True)
    at_vertex = keys // stride
    bare = edge_table(cage.counts, indices, len(keys))
    edge_sharpness = bare.edge_sharpness.copy()
    np.maximum.at(edge_sharpness, bare.edges, cage.edge_sharpness[cage.edges])
    vertex_sharpness = cage.vertex_sharpness[at_vertex]
    vertex_sharpness[_linear_vertices(cage, bare, at_vertex, linear)] = np.inf
    return replace(bare, edge_sharpness=edge_sharpness, vertex_sharpness=vertex_sharpness), keys % stride


def _linear_vertices(cage: Topology, values: Topology, at_vertex: IntArray, linear: str) -> IntArray:
    """The values that stay in place under faceVaryingLinearInterpolation."""
    if linear == "none":
        return np.empty(0, np.int64)
    number = np.bincount(at_vertex, minlength=len(cage.vertex_sharpness))[at_vertex]
    if linear == "boundaries":
        return np.unique(values.ends[values.edge_faces == 1])
    corner = (np.bincount(values.indices, minlength=len(at_vertex)) == 1) & (number > 1)
    linear_here = corner.copy()
    if linear in ("cornersPlus1", "cornersPlus2"):
        linear_here |= number > 2
    if linear == "cornersPlus2":
        beside_corner = np.bincount(at_vertex, corner, minlength=len(cage.vertex_sharpness))[at_vertex] > 0
        linear_here |= beside_corner | _is_dart(cage, values, number)
    return np.flatnonzero(linear_here)


def _is_dart(cage: Topology, values: Topology, number: IntArray) -> IntArray:
    """Whether a seam ends in a value, the only one at its vertex, shape (n,)."""
    seam = np.zeros(len(values.ends), bool)
    seam[values.edges] = cage.edge_faces[cage.edges] > 1
    ends = values.ends[seam & (values.edge_faces == 1)]
    on_seam = np.bincount(ends.reshape(-1), minlength=len(number)) > 0
    return on_seam & (number == 1)
