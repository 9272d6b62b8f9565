"""Faces, edges and their sharpness, and the topology one refinement further down.

A child's rows follow from its parent's: the parent's vertices keep their numbers, then come one vertex for each edge
and, where faces split into quadrilaterals, one for each face. An edge e becomes the edges 2e and 2e + 1, and every
corner adds one edge inside its face. So edges are looked for once, in the cage.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Topology:
    """A mesh without positions; a vertex may be a point of the mesh or a distinct value of a faceVarying primvar.

    Attributes:
        counts: corners per face, at least 3, shape (m,).
        indices: vertex of each corner, shape (c,).
        edges: the edge from each corner to the next of its face, shape (c,).
        ends: the two vertices of each edge, shape (e, 2).
        edge_sharpness: 0 smooth, inf sharp at every level, shape (e,).
        vertex_sharpness: of the same kind, shape (n,).
    """

    counts: IntArray
    indices: IntArray
    edges: IntArray
    ends: IntArray
    edge_sharpness: FloatArray
    vertex_sharpness: FloatArray

    @cached_property
    def starts(self) -> IntArray:
        """First corner of each face, shape (m,)."""
        return np.cumsum(self.counts) - self.counts

    @cached_property
    def faces(self) -> IntArray:
        """Face of each corner, shape (c,)."""
        return np.repeat(np.arange(len(self.counts)), self.counts)

    @cached_property
    def following(self) -> IntArray:
        """The next corner of the same face, shape (c,)."""
        corners = np.arange(1, len(self.indices) + 1)
        corners[self.starts + self.counts - 1] = self.starts
        return corners

    @cached_property
    def preceding(self) -> IntArray:
        """The corner before of the same face, shape (c,)."""
        corners = np.arange(-1, len(self.indices) - 1)
        corners[self.starts] = self.starts + self.counts - 1
        return corners

    @cached_property
    def edge_faces(self) -> IntArray:
        """Number of faces at each edge, shape (e,)."""
        return np.bincount(self.edges, minlength=len(self.ends))

    @cached_property
    def twins(self) -> IntArray:
        """The corner whose edge is the same, wound the other way, or -1 at edges of one face or of many, shape (c,)."""
        corners = np.arange(len(self.indices))
        both = np.bincount(self.edges, corners, minlength=len(self.ends)).astype(np.int64)  # exact below 2^53
        twins = both[self.edges] - corners
        paired = (self.edge_faces == 2)[self.edges]
        return np.where(paired & (self.indices[twins * paired] != self.indices), twins, -1)


def edge_table(counts: IntArray, indices: IntArray, vertices: int) -> Topology:
    """The topology of polygons, with those edges sharp that are the border of a surface.

    These are the edges of one face, of three or more, and of two that are wound against each other.
    """
    bare = Topology(counts, indices, indices, np.empty((0, 2), np.int64), np.empty(0), np.zeros(vertices))
    begin, end = indices, indices[bare.following]
    keys, edges = np.unique(np.minimum(begin, end) * vertices + np.maximum(begin, end), return_inverse=True)
    ends = np.stack([keys // max(vertices, 1), keys % max(vertices, 1)], axis=-1)
    forward = np.bincount(edges[begin < end], minlength=len(keys))
    interior = (np.bincount(edges, minlength=len(keys)) == 2) & (forward == 1)
    return Topology(counts, indices, edges, ends, np.where(interior, 0.0, np.inf), np.zeros(vertices))


def split_into_quads(parent: Topology) -> Topology:
    """One quadrilateral a corner: the corner, its edge's vertex, its face's vertex, the vertex of the edge before."""
    n, e = len(parent.vertex_sharpness), len(parent.ends)
    edge_vertex, before = n + parent.edges, parent.preceding
    face_vertex = n + e + parent.faces
    inner = 2 * e + np.arange(len(parent.indices))
    return Topology(
        counts=np.full(len(parent.indices), 4),
        indices=np.stack([parent.indices, edge_vertex, face_vertex, edge_vertex[before]], axis=-1).reshape(-1),
        edges=np.stack(
            [_half(parent, parent.edges), inner, inner[before], _half(parent, parent.edges[before])], axis=-1
        ).reshape(-1),
        ends=np.concatenate([_half_ends(parent), np.stack([edge_vertex, face_vertex], axis=-1)]),
        edge_sharpness=_child_edge_sharpness(parent),
        vertex_sharpness=np.concatenate([decayed(parent.vertex_sharpness), np.zeros(e + len(parent.counts))]),
    )


def split_into_triangles(parent: Topology) -> Topology:
    """Four triangles a triangle: one at each corner, in the corners' order, and the one between them."""
    n, e = len(parent.vertex_sharpness), len(parent.ends)
    edge_vertex, before = n + parent.edges, parent.preceding
    inner = 2 * e + np.arange(len(parent.indices))
    cut_off = np.stack([parent.indices, edge_vertex, edge_vertex[before]], axis=-1)
    cut_off_edges = np.stack([_half(parent, parent.edges), inner, _half(parent, parent.edges[before])], axis=-1)
    middle, middle_edges = edge_vertex.reshape(-1, 1, 3), np.roll(inner.reshape(-1, 1, 3), -1, axis=2)
    return Topology(
        counts=np.full(4 * len(parent.counts), 3),
        indices=np.concatenate([cut_off.reshape(-1, 3, 3), middle], axis=1).reshape(-1),
        edges=np.concatenate([cut_off_edges.reshape(-1, 3, 3), middle_edges], axis=1).reshape(-1),
        ends=np.concatenate([_half_ends(parent), np.stack([edge_vertex, edge_vertex[before]], axis=-1)]),
        edge_sharpness=_child_edge_sharpness(parent),
        vertex_sharpness=np.concatenate([decayed(parent.vertex_sharpness), np.zeros(e)]),
    )


def decayed(sharpness: FloatArray) -> FloatArray:
    """Sharpness one level down: less by one, where it is not infinite."""
    return np.maximum(sharpness - 1.0, 0.0)


def _half(parent: Topology, edges: IntArray) -> IntArray:
    """For every corner, the half of its edge (one at its vertex) that touches the corner's vertex."""
    return 2 * edges + (parent.ends[edges, 0] != parent.indices)


def _half_ends(parent: Topology) -> IntArray:
    middles = len(parent.vertex_sharpness) + np.arange(len(parent.ends))
    return np.stack([parent.ends, np.broadcast_to(middles[:, None], parent.ends.shape)], axis=-1).reshape(-1, 2)


def _child_edge_sharpness(parent: Topology) -> FloatArray:
    return np.concatenate([np.repeat(decayed(parent.edge_sharpness), 2), np.zeros(len(parent.indices))])
