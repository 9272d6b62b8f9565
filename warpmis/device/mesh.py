"""The tree over the triangles, built so that no ray slips through the seam between two of them."""

from __future__ import annotations

import numpy as np
import warp as wp
from numpy.typing import NDArray

# Triangles a leaf of the mesh's BVH; measured by scripts/bench/bvh.py.
LEAF_SIZE = 4

# Boxes reach this share of the geometry's extent beyond their triangles: a slab's two distances come from three
# roundings each, so they are off by at most 2 gamma_3 = 3.6e-7 of what lies between ray and slab.
PAD = 2.0**-20
# Of a triangle that is small against that, its box grows no more than by this share of its longest side.
MAX_SHARE = 0.25


def padded_boxes(
    points: NDArray[np.float32], triangles: NDArray[np.int32]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Lower and upper corners of boxes that a ray meets wherever it meets the triangle, shape (F, 3) each.

    Reference: Ize (2013), "Robust BVH Ray Traversal", JCGT 2(2), which grows the slab's far distance by 2 gamma_3;
    the tree's own test cannot be changed, so the boxes grow instead.
    """
    corners = points[triangles]
    low, high = corners.min(axis=1), corners.max(axis=1)
    extent = (high.max(axis=0) - low.min(axis=0)).max()
    side = (high - low).max(axis=1, keepdims=True)
    pad = np.minimum(np.float32(PAD) * extent, np.float32(MAX_SHARE) * side)
    return np.nextafter(low - pad, np.float32(-np.inf)), np.nextafter(high + pad, np.float32(np.inf))


def watertight_mesh(points: NDArray[np.float32], triangles: NDArray[np.int32]) -> wp.Mesh:
    """A mesh on the present device: Warp's watertight triangle test, in boxes that lose no ray at their edges.

    A tree keeps the boxes that it was built from, and its queries take the points as they are then: it is built from
    the boxes' corners, and given the triangles afterwards. The mesh's points are therefore 3 F rows, of which the
    first V are the vertices.

    Args:
        points: vertices, each used by some triangle, shape (V, 3).
        triangles: shape (F, 3), F > 0.

    Reference: Woop, Benthin, Wald (2013), "Watertight Ray/Triangle Intersection", JCGT 2(1): the triangle test.
    """
    low, high = padded_boxes(points, triangles)
    rows = wp.array(np.stack([low, high, high], axis=1).reshape(-1, 3), dtype=wp.vec3)
    indices = wp.array(np.arange(triangles.size, dtype=np.int32), dtype=wp.int32)
    mesh = wp.Mesh(rows, indices, bvh_leaf_size=LEAF_SIZE)
    rows[: len(points)].assign(points)
    indices.assign(triangles.ravel())
    return mesh
