"""Trees over triangles, built so that no ray slips through the seam between two of them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import warp as wp
from numpy.typing import NDArray

# Triangles a leaf of the mesh's BVH; measured by scripts/bench/bvh.py.
LEAF_SIZE = 4

# Boxes reach this share of the scene's extent beyond their triangles: a slab's two distances come from three
# roundings each, so they are off by at most 2 gamma_3 = 3.6e-7 of what lies between ray and slab.
PAD = 2.0**-20
# Of a triangle that is small against that, its box grows no more than by this share of its longest side.
MAX_SHARE = 0.25


def triangle_boxes(
    points: NDArray[np.float32], triangles: NDArray[np.int32]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Lower and upper corners of the triangles' own boxes, shape (F, 3) each."""
    # Three arrays at a time: along an axis of three NumPy goes number by number, and takes several times as long.
    a, b, c = (points[triangles[:, corner]] for corner in range(3))
    return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)


def padding(low: NDArray[np.float32], high: NDArray[np.float32], reach: float) -> NDArray[np.float32]:
    """How far boxes go beyond triangles with these, shape (F, 1); `reach` as in padded_boxes."""
    x, y, z = (high - low).T
    side = np.maximum(np.maximum(x, y), z)[:, None]
    return np.minimum(np.float32(PAD) * np.float32(reach), np.float32(MAX_SHARE) * side)


def padded_boxes(
    points: NDArray[np.float32], triangles: NDArray[np.int32], reach: float | None = None
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Lower and upper corners of boxes that a ray meets wherever it meets the triangle, shape (F, 3) each.

    Args:
        reach: extent of the scene that rays cross, in the space of the triangles; None is their own.

    Reference: Ize (2013), "Robust BVH Ray Traversal", JCGT 2(2), which grows the slab's far distance by 2 gamma_3;
    the tree's own test cannot be changed, so the boxes grow instead.
    """
    low, high = triangle_boxes(points, triangles)
    pad = padding(low, high, (high.max(axis=0) - low.min(axis=0)).max() if reach is None else reach)
    return np.nextafter(low - pad, np.float32(-np.inf)), np.nextafter(high + pad, np.float32(np.inf))


def grown_boxes(low: NDArray[np.float64], high: NDArray[np.float64]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Boxes that a ray meets wherever it meets what is in the given ones, shape (n, 3) each: the same for things other
    than triangles, which may be small against their distance, so that nothing bounds the growth."""
    if len(low) == 0:
        return low.astype(np.float32), high.astype(np.float32)
    largest = np.maximum(np.abs(low).max(), np.abs(high).max())
    pad = PAD * largest
    return (low - pad).astype(np.float32), (high + pad).astype(np.float32)


def watertight_meshes(
    points: NDArray[np.float32], triangles: NDArray[np.int32], first: Sequence[int], reaches: Sequence[float]
) -> tuple[list[wp.Mesh], wp.array]:
    """Meshes on the present device: Warp's watertight triangle test, in boxes that lose no ray at their edges.

    A tree keeps the boxes that it was built from, and its queries take the points as they are then: it is built from
    the boxes' corners, and given the triangles afterwards. The meshes' points are therefore 3 F rows, shared by all, of
    which the first V are the vertices.

    Args:
        points: vertices, each used by some triangle, shape (V, 3).
        triangles: shape (F, 3), F > 0.
        first: the rows of `triangles` where the stretches begin, a mesh each, and where the last one ends.
        reaches: of each stretch, as in padded_boxes.

    Returns:
        the meshes, and their points.

    Reference: Woop, Benthin, Wald (2013), "Watertight Ray/Triangle Intersection", JCGT 2(1): the triangle test.
    """
    stretches = list(pairwise(first))
    corners = np.empty((len(triangles), 3, 3), np.float32)
    for (start, end), reach in zip(stretches, reaches, strict=True):
        low, high = padded_boxes(points, triangles[start:end], reach)
        corners[start:end] = np.stack([low, high, high], axis=1)
    rows = wp.array(corners.reshape(-1, 3), dtype=wp.vec3)
    indices = wp.array(np.arange(triangles.size, dtype=np.int32), dtype=wp.int32)
    meshes = [wp.Mesh(rows, indices[3 * start : 3 * end], bvh_leaf_size=LEAF_SIZE) for start, end in stretches]
    rows[: len(points)].assign(points)
    indices.assign(triangles.ravel())
    return meshes, rows


def front_normals(points: NDArray[np.float32], triangles: NDArray[np.int32]) -> NDArray[np.float32]:
    """Unit normal of each triangle's front, of any size, shape (n, 3); 0 where it has none."""
    corners = points.astype(np.float64)[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0.0).astype(np.float32)
