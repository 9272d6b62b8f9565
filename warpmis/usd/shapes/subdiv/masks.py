"""The weights of one refinement, applied to whole arrays: Catmull-Clark, Loop and bilinear.

Reference: Catmull and Clark (1978); Loop (1987); DeRose, Kass and Truong (1998) for creases and corners, with the
rules of OpenSubdiv for what these leave open: a vertex with two sharp edges lies on a crease, one with more is a
corner, and where a rule changes from one level to the next, the two are mixed by the sharpness that is lost.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpmis.usd.shapes.subdiv.topology import (
    FloatArray,
    IntArray,
    Topology,
    decayed,
    split_into_quads,
    split_into_triangles,
)

SMOOTH, CREASE, CORNER = range(3)

# Weight of a triangle's middle at its edges under triangleSubdivisionRule "smooth"; a quadrilateral's is 1/4.
SMOOTH_TRIANGLE_WEIGHT = 0.47


@dataclass(frozen=True)
class Scheme:
    """A subdivision scheme.

    Attributes:
        split: the child's topology.
        parents: the parent's face of each of the child's faces, shape (m',).
        refine: values of the child's vertices from the parent's, shapes (n, k) and (n', k).
    """

    split: Callable[[Topology], Topology]
    parents: Callable[[Topology], IntArray]
    refine: Callable[[Topology, FloatArray], FloatArray]


def gathered(rows: IntArray, values: FloatArray, size: int) -> FloatArray:
    """Sum of the values that share a row, shape (size, k)."""
    sums = np.empty((size, values.shape[1]))
    for column in range(values.shape[1]):
        sums[:, column] = np.bincount(rows, values[:, column], minlength=size)
    return sums


def neighbour_sum(topology: Topology, values: FloatArray, edges: IntArray | slice = slice(None)) -> FloatArray:
    """Sum over a vertex's `edges` of the value at the other end, shape (n, k)."""
    begin, end = topology.ends[edges].T
    n = len(topology.vertex_sharpness)
    return gathered(begin, values[end], n) + gathered(end, values[begin], n)


def valences(topology: Topology) -> FloatArray:
    """Number of edges at each vertex, at least 1, shape (n, 1)."""
    number = np.bincount(topology.ends.reshape(-1), minlength=len(topology.vertex_sharpness))
    return np.maximum(number, 1.0)[:, None]


def vertex_rules(topology: Topology, edges: NDArray[np.bool_], vertices: NDArray[np.bool_]) -> IntArray:
    """SMOOTH, CREASE or CORNER by which edges and vertices are sharp, shape (n,)."""
    number = np.bincount(topology.ends[edges].reshape(-1), minlength=len(topology.vertex_sharpness))
    corner = vertices | (number > 2)
    return np.where(corner, CORNER, np.where(number == 2, CREASE, SMOOTH))


def face_means(topology: Topology, values: FloatArray) -> FloatArray:
    """Mean over each face's corners, shape (m, k)."""
    return np.add.reduceat(values[topology.indices], topology.starts) / topology.counts[:, None]


def _refine_bilinear(topology: Topology, values: FloatArray) -> FloatArray:
    return np.concatenate([values, values[topology.ends].mean(axis=1), face_means(topology, values)])


def _refine_linear_triangles(topology: Topology, values: FloatArray) -> FloatArray:
    return np.concatenate([values, values[topology.ends].mean(axis=1)])


def _refine_catmull_clark(topology: Topology, values: FloatArray, triangle_weight: float = 0.25) -> FloatArray:
    face_values = face_means(topology, values)
    at_corners = face_values[topology.faces]
    middles = values[topology.ends].mean(axis=1)
    e, n = len(topology.ends), len(values)
    weight = np.full((e, 1), 0.25)
    if triangle_weight != 0.25 and (topology.counts == 3).any():
        by_face = np.where(topology.counts == 3, triangle_weight, 0.25)[topology.faces, None]
        weight = gathered(topology.edges, by_face, e) / 2
    smooth = (1.0 - 2.0 * weight) * middles + weight * gathered(topology.edges, at_corners, e)
    valence = valences(topology)
    around = neighbour_sum(topology, values) + gathered(topology.indices, at_corners, n)
    inside = (valence - 2.0) / valence * values + around / valence**2
    return np.concatenate(
        [_sharpened_vertices(topology, values, inside), _sharpened_edges(topology, middles, smooth), face_values]
    )


def _refine_loop(topology: Topology, values: FloatArray) -> FloatArray:
    middles = values[topology.ends].mean(axis=1)
    opposite = gathered(topology.edges, values[topology.indices[topology.preceding]], len(topology.ends))
    smooth = 0.75 * middles + 0.125 * opposite
    valence = valences(topology)
    beta = loop_beta(valence)
    inside = (1.0 - valence * beta) * values + beta * neighbour_sum(topology, values)
    return np.concatenate([_sharpened_vertices(topology, values, inside), _sharpened_edges(topology, middles, smooth)])


def loop_beta(valence: FloatArray) -> FloatArray:
    """Weight of each neighbour of a smooth vertex in Loop's scheme."""
    return (0.625 - (0.375 + 0.25 * np.cos(2.0 * np.pi / valence)) ** 2) / valence


def _sharpened_edges(topology: Topology, middles: FloatArray, smooth: FloatArray) -> FloatArray:
    share = np.minimum(topology.edge_sharpness, 1.0)[:, None]
    return np.where(share > 0.0, share * middles + (1.0 - share) * smooth, smooth)


def _sharpened_vertices(topology: Topology, values: FloatArray, smooth: FloatArray) -> FloatArray:
    """The smooth values with those replaced that are on creases or corners before or after this refinement."""
    edge_after, vertex_after = decayed(topology.edge_sharpness), decayed(topology.vertex_sharpness)
    states = [
        (topology.edge_sharpness > 0.0, topology.vertex_sharpness > 0.0),
        (edge_after > 0.0, vertex_after > 0.0),
    ]
    before, after = (vertex_rules(topology, *state) for state in states)
    special = np.flatnonzero(before != SMOOTH)  # sharpness only falls
    if not len(special):
        return smooth
    sharp, sharp_after = (
        ruled(topology, state[0], rules, values, smooth, (0.75, 0.125), special)
        for state, rules in zip(states, (before, after), strict=True)
    )
    share = np.where(before == after, 1.0, _lost_sharpness(topology, edge_after, vertex_after))[special, None]
    result = smooth.copy()
    result[special] = share * sharp + (1.0 - share) * sharp_after
    return result


def ruled(
    topology: Topology,
    sharp_edges: NDArray[np.bool_],
    rules: IntArray,
    values: FloatArray,
    smooth: FloatArray,
    crease: tuple[float, float],
    vertices: IntArray,
) -> FloatArray:
    """Values at `vertices` by their rules, shape (len(vertices), k); `crease` weighs the vertex and each neighbour."""
    along = neighbour_sum(topology, values, np.flatnonzero(sharp_edges))
    curve = crease[0] * values[vertices] + crease[1] * along[vertices]
    rule = rules[vertices, None]
    return np.where(rule == CORNER, values[vertices], np.where(rule == CREASE, curve, smooth[vertices]))


def _lost_sharpness(topology: Topology, edge_after: FloatArray, vertex_after: FloatArray) -> FloatArray:
    """Mean sharpness, at most 1, of what stops to be sharp at or next to each vertex, shape (n,)."""
    n = len(topology.vertex_sharpness)
    edges = np.flatnonzero((topology.edge_sharpness > 0.0) & (edge_after == 0.0))
    ends = topology.ends[edges].reshape(-1)
    own = (topology.vertex_sharpness > 0.0) & (vertex_after == 0.0)
    total = np.bincount(ends, np.repeat(topology.edge_sharpness[edges], 2), minlength=n)
    total = total + np.where(own, topology.vertex_sharpness, 0.0)
    number = np.bincount(ends, minlength=n) + own
    return np.minimum(total / np.maximum(number, 1), 1.0)


def _quad_parents(topology: Topology) -> IntArray:
    return topology.faces


def _triangle_parents(topology: Topology) -> IntArray:
    return np.repeat(np.arange(len(topology.counts)), 4)


def _refine_smooth_triangles(topology: Topology, values: FloatArray) -> FloatArray:
    return _refine_catmull_clark(topology, values, SMOOTH_TRIANGLE_WEIGHT)


CATMULL_CLARK = Scheme(split_into_quads, _quad_parents, _refine_catmull_clark)
CATMULL_CLARK_SMOOTH_TRIANGLES = Scheme(split_into_quads, _quad_parents, _refine_smooth_triangles)
LOOP = Scheme(split_into_triangles, _triangle_parents, _refine_loop)
BILINEAR = Scheme(split_into_quads, _quad_parents, _refine_bilinear)
LINEAR_TRIANGLES = Scheme(split_into_triangles, _triangle_parents, _refine_linear_triangles)
