"""Where the scene's coordinates begin: the world's origin, or the scene's own middle where that lies far away.

float32 keeps 24 binary digits of a coordinate, the first ones of which say, far from the origin, where the scene is
rather than what it looks like. So everything is moved, in float64, before it is rounded.

Reference: Pharr, Jakob, Humphreys (2023), "Physically Based Rendering", 4th edition, section 5.1.1: rendering space.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpmis.usd.shapes.surfaces import Surface

FloatArray = NDArray[np.float64]
Bounds = tuple[FloatArray, FloatArray]

# A scene is far away whose middle is this many times its size from the origin: six of the 24 digits are lost then.
FAR = 64.0


def scene_origin(boxes: list[Bounds]) -> FloatArray:
    """The middle of boxes where it is far from the world's origin, else 0, shape (3,).

    Args:
        boxes: smallest and largest corner, of one box or of several, shape (3,) or (k, 3) each.
    """
    finite = [box for box in boxes if np.isfinite(box).all()]
    if not finite:
        return np.zeros(3)
    low = np.vstack([low for low, _ in finite]).min(axis=0)
    high = np.vstack([high for _, high in finite]).max(axis=0)
    middle = 0.5 * low + 0.5 * high
    return middle if np.abs(middle).max() > FAR * (high - low).max() else np.zeros(3)


def placed_box(surface: Surface, matrices: FloatArray) -> Bounds:
    """Smallest and largest corner of all the instances' boxes; matrices shape (k, 4, 4)."""
    used = np.zeros(len(surface.points), bool)
    used[surface.triangles] = True
    points = surface.points[used]
    return placed_corners(np.stack([points.min(axis=0), points.max(axis=0)]), matrices)


def placed_corners(box: FloatArray, matrices: FloatArray) -> Bounds:
    """Smallest and largest corner of a box, shape (2, 3), at all its places; matrices shape (k, 4, 4)."""
    corners = np.stack(np.meshgrid(*box.T, indexing="ij"), axis=-1).reshape(8, 3)
    placed = corners @ matrices[:, :3, :3] + matrices[:, None, 3, :3]
    return placed.min(axis=(0, 1)), placed.max(axis=(0, 1))


def moved(matrices: FloatArray, origin: FloatArray) -> FloatArray:
    """Local to world as local to the scene's coordinates, shape (k, 4, 4)."""
    matrices = matrices.copy()
    matrices[:, 3, :3] -= origin
    return matrices
