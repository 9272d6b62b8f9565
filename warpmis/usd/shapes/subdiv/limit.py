"""Where the vertices of a refined mesh end up when it is refined for ever.

Reference: Halstead, Kass and DeRose (1993), eq. 5, for Catmull-Clark; Loop (1987) for Loop. On a crease and a border
the limit is a uniform cubic B-spline.
"""

from __future__ import annotations

import numpy as np

from warpmis.usd.shapes.subdiv.masks import (
    CATMULL_CLARK,
    CATMULL_CLARK_SMOOTH_TRIANGLES,
    LOOP,
    SMOOTH,
    Scheme,
    gathered,
    loop_beta,
    neighbour_sum,
    ruled,
    valences,
    vertex_rules,
)
from warpmis.usd.shapes.subdiv.topology import FloatArray, Topology

# What is left of a sharpness at the last level is infinite from here on, and nothing below.
SHARP = 0.5


def limit_values(scheme: Scheme, topology: Topology, values: FloatArray) -> FloatArray:
    """Limits of the values at the vertices of a mesh that is refined at least once, shape (n, k)."""
    if scheme in (CATMULL_CLARK, CATMULL_CLARK_SMOOTH_TRIANGLES):
        smooth = _catmull_clark_limit(topology, values)
    elif scheme is LOOP:
        smooth = _loop_limit(topology, values)
    else:
        return values
    edges, vertices = topology.edge_sharpness >= SHARP, topology.vertex_sharpness >= SHARP
    rules = vertex_rules(topology, edges, vertices)
    special = np.flatnonzero(rules != SMOOTH)
    if len(special):
        smooth[special] = ruled(topology, edges, rules, values, smooth, (2 / 3, 1 / 6), special)
    return smooth


def _catmull_clark_limit(topology: Topology, values: FloatArray) -> FloatArray:
    valence = valences(topology)
    opposite = values[topology.indices.reshape(-1, 4)[:, [2, 3, 0, 1]].reshape(-1)]
    around = 4.0 * neighbour_sum(topology, values) + gathered(topology.indices, opposite, len(values))
    return (valence**2 * values + around) / (valence * (valence + 5.0))


def _loop_limit(topology: Topology, values: FloatArray) -> FloatArray:
    valence = valences(topology)
    share = 1.0 / (valence + 0.375 / loop_beta(valence))
    return (1.0 - valence * share) * values + share * neighbour_sum(topology, values)
