"""The order of triangles and vertices in memory: along a Morton curve, so that what is near in space is near in
memory while the BVH is walked."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def spread_bits(x: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """The lower 21 bits of x, two zero bits between neighbours."""
    x = x & np.uint64(0x1FFFFF)
    for shift, mask in (
        (32, 0x1F00000000FFFF),
        (16, 0x1F0000FF0000FF),
        (8, 0x100F00F00F00F00F),
        (4, 0x10C30C30C30C30C3),
        (2, 0x1249249249249249),
    ):
        x = (x | (x << np.uint64(shift))) & np.uint64(mask)
    return x


def morton_codes(positions: NDArray[np.float32]) -> NDArray[np.uint64]:
    """Morton code of each position within their common bounding box, shape (n,)."""
    low = positions.min(axis=0).astype(np.float64)
    extent = np.maximum(positions.max(axis=0).astype(np.float64) - low, 1e-300)
    cells = np.clip((positions - low) / extent.max() * 2097151.0, 0.0, 2097151.0).astype(np.uint64)
    x, y, z = (spread_bits(cells[:, axis]) for axis in range(3))
    return x | (y << np.uint64(1)) | (z << np.uint64(2))


def morton_order(points: NDArray[np.float32], triangles: NDArray[np.int32]) -> NDArray[np.int64]:
    """Permutation of the triangles along the Morton curve of their centres, shape (F,)."""
    if len(triangles) == 0:
        return np.zeros(0, dtype=np.int64)
    return np.argsort(morton_codes(points[triangles].mean(axis=1)), kind="stable")


def first_use_order(triangles: NDArray[np.int32], count: int) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Vertices in the order in which the triangles first name them.

    Returns:
        the old index of each kept vertex, shape (n,), and the triangles with new indices, shape (F, 3).
    """
    used, first = np.unique(triangles.ravel(), return_index=True)
    kept = used[np.argsort(first, kind="stable")]
    renamed = np.zeros(count, dtype=np.int32)
    renamed[kept] = np.arange(len(kept), dtype=np.int32)
    return kept.astype(np.int64), renamed[triangles]
