"""Dome pictures of other layouts than lat-long, turned into it.

In the dome's frame, where lat-long's centre looks along +Z and its top along +Y: a mirrored ball and an angular map are
seen by a camera that looks along -Z (their centre shows +Z, their right side +X); a vertical cross is folded about the
viewer, as lat-long is: +X, +Z, -X from left to right, +Y and -Y above and below, -Z at the bottom, upside down.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Directions = NDArray[np.float64]
Places = NDArray[np.float64]

# Rows of the lat-long picture: as many as the source has, within these.
ROWS = (64, 2048)


def as_latlong(pixels: NDArray[np.float32], layout: str) -> NDArray[np.float32]:
    """A picture of one of LAYOUTS, resampled bilinearly, shape (r, 2 r, 3)."""
    rows = int(np.clip(pixels.shape[0], *ROWS))
    v, u = np.meshgrid((np.arange(rows) + 0.5) / rows, (np.arange(2 * rows) + 0.5) / (2 * rows), indexing="ij")
    sine = np.sin(np.pi * v)
    d = np.stack([sine * np.sin(2 * np.pi * u), np.cos(np.pi * v), -sine * np.cos(2 * np.pi * u)], axis=-1)
    return LAYOUTS[layout](pixels, d)


def _mirrored_ball(pixels: NDArray[np.float32], d: Directions) -> NDArray[np.float32]:
    """The ball's normal is halfway between d and the camera: at the distance sin(t / 2), t from +Z, off the centre."""
    half = np.sqrt(np.maximum(0.5 * (1.0 - d[..., 2]), 0.0))
    return _disk(pixels, d, half)


def _angular(pixels: NDArray[np.float32], d: Directions) -> NDArray[np.float32]:
    """The distance from the centre grows as the angle from +Z."""
    return _disk(pixels, d, np.arccos(np.clip(d[..., 2], -1.0, 1.0)) / np.pi)


def _disk(pixels: NDArray[np.float32], d: Directions, radius: NDArray[np.float64]) -> NDArray[np.float32]:
    """The texel at a share `radius` of the way from the centre to the picture's edge, in the direction of (x, y)."""
    across = np.hypot(d[..., 0], d[..., 1])
    scale = np.divide(radius, across, out=np.zeros_like(across), where=across > 0.0)
    return _bilinear(pixels, 0.5 + 0.5 * scale * d[..., 0], 0.5 - 0.5 * scale * d[..., 1])


def _vertical_cross(pixels: NDArray[np.float32], d: Directions) -> NDArray[np.float32]:
    """Three faces wide, four high; within a face the direction is projected from the centre."""
    axis = np.abs(d).argmax(axis=-1)
    result = np.zeros((*d.shape[:2], 3), np.float32)
    height, width = pixels.shape[0] // 4, pixels.shape[1] // 3
    for column, row, face, sign, right, down in CROSS:
        here = (axis == face) & (d[..., face] * sign > 0.0)
        depth = np.abs(d[here][:, face])
        part = pixels[row * height : (row + 1) * height, column * width : (column + 1) * width]
        across, along = d[here] @ np.array(right) / depth, d[here] @ np.array(down) / depth
        result[here] = _bilinear(part, 0.5 + 0.5 * across, 0.5 + 0.5 * along)
    return result


# (column, row, axis, its sign, where the face's right side looks to, where its lower side does)
CROSS = (
    (1, 0, 1, 1, (-1, 0, 0), (0, 0, 1)),
    (0, 1, 0, 1, (0, 0, 1), (0, -1, 0)),
    (1, 1, 2, 1, (-1, 0, 0), (0, -1, 0)),
    (2, 1, 0, -1, (0, 0, -1), (0, -1, 0)),
    (1, 2, 1, -1, (-1, 0, 0), (0, 0, -1)),
    (1, 3, 2, -1, (-1, 0, 0), (0, 1, 0)),
)


def _bilinear(pixels: NDArray[np.float32], u: Places, v: Places) -> NDArray[np.float32]:
    """Interpolated between four texels, clamped at the edges; (0, 0) is the upper left corner."""
    rows, columns = pixels.shape[:2]
    x, y = np.clip(u * columns - 0.5, 0.0, columns - 1.0), np.clip(v * rows - 0.5, 0.0, rows - 1.0)
    x0, y0 = x.astype(int), y.astype(int)
    x1, y1 = np.minimum(x0 + 1, columns - 1), np.minimum(y0 + 1, rows - 1)
    fx, fy = (x - x0)[..., None], (y - y0)[..., None]
    upper = pixels[y0, x0] * (1.0 - fx) + pixels[y0, x1] * fx
    lower = pixels[y1, x0] * (1.0 - fx) + pixels[y1, x1] * fx
    return np.asarray(upper * (1.0 - fy) + lower * fy, np.float32)


LAYOUTS: dict[str, Callable[[NDArray[np.float32], Directions], NDArray[np.float32]]] = {
    "mirroredBall": _mirrored_ball,
    "angular": _angular,
    "cubeMapVerticalCross": _vertical_cross,
}
