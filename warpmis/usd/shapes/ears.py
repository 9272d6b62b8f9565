"""Ear clipping of many polygons at once: an ear of each is cut off in every step."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

IntArray = NDArray[np.int64]
FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


def clip_ears(outlines: FloatArray) -> IntArray:
    """Triangles of simple polygons with the same number of corners.

    Args:
        outlines: corners in order, about planar, shape (p, n, 3).

    Returns:
        Local corner indices, shape (p, n - 2, 3), wound as the outlines. What is left of a polygon that crosses itself
        becomes a fan.
    """
    number, size = outlines.shape[:2]
    flat = _flattened(outlines)
    polygon, local = np.arange(number), np.arange(size)
    before, after = np.tile((local - 1) % size, (number, 1)), np.tile((local + 1) % size, (number, 1))
    remaining = np.ones((number, size), bool)
    ears = np.stack([_is_ear(flat, remaining, before, after, np.full(number, i)) for i in local], axis=1)
    triangles = np.empty((number, size - 2, 3), np.int64)
    for step in range(size - 2):
        first = np.argmax(remaining, axis=1)
        tip = np.where(ears.any(axis=1), np.argmax(ears, axis=1), after[polygon, first])
        left, right = before[polygon, tip], after[polygon, tip]
        triangles[:, step] = np.stack([left, tip, right], axis=-1)
        remaining[polygon, tip] = ears[polygon, tip] = False
        after[polygon, left], before[polygon, right] = right, left
        for i in (left, right):
            ears[polygon, i] = _is_ear(flat, remaining, before, after, i)
    return triangles


def _flattened(outlines: FloatArray) -> FloatArray:
    """The outlines in their own planes, counter-clockwise, shape (p, n, 2): the normal's largest axis is left out."""
    local = outlines - outlines[:, :1]
    normal = np.cross(local, np.roll(local, -1, axis=1)).sum(axis=1)
    axis = np.argmax(np.abs(normal), axis=1)[:, None]
    columns = np.concatenate([(axis + 1) % 3, (axis + 2) % 3], axis=1)
    flat = np.take_along_axis(local, columns[:, None], axis=2)
    flat[..., 0] *= np.where(np.take_along_axis(normal, axis, axis=1) > 0.0, 1.0, -1.0)
    return flat


def _is_ear(flat: FloatArray, remaining: BoolArray, before: IntArray, after: IntArray, i: IntArray) -> BoolArray:
    """Whether corner i of each polygon is convex with no other remaining corner inside its triangle, shape (p,)."""
    polygon = np.arange(len(flat))
    a, b, c = (flat[polygon, corner][:, None] for corner in (before[polygon, i], i, after[polygon, i]))
    inside = (_cross(b - a, flat - a) >= 0) & (_cross(c - b, flat - b) >= 0) & (_cross(a - c, flat - c) >= 0)
    apart = (flat != a).any(axis=2) & (flat != b).any(axis=2) & (flat != c).any(axis=2)
    return (_cross(b - a, c - a)[:, 0] > 0.0) & ~(inside & apart & remaining).any(axis=1)


def _cross(u: FloatArray, v: FloatArray) -> FloatArray:
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
