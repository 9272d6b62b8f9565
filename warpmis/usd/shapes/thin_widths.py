"""Widths of curves and points where none are authored. UsdGeom gives no fallback; viewers draw them a pixel thin."""

from __future__ import annotations

from typing import Any

import numpy as np

from warpmis.usd.authored import Authored
from warpmis.usd.reading import Reading
from warpmis.usd.shapes.surfaces import FloatArray

# Such a share of the scene's size, and no more than such a share of the prim's own: hair on a figure that stands on a
# large ground is as thin as the figure asks for.
OF_SCENE = 1.0 / 200.0
OF_PRIM = 1.0 / 100.0


def thin_widths(prim: Any, points: FloatArray, matrices: FloatArray, reading: Reading) -> Authored:
    """One width for the whole prim, in its own space, with a note.

    Args:
        points: the prim's, shape (n, 3).
        matrices: local to world, shape (k, 4, 4).
    """
    finite = points[np.isfinite(points).all(axis=1)]
    own = float(np.linalg.norm(np.ptp(finite, axis=0))) if len(finite) else 0.0
    scene = 0.0 if reading.extent is None else reading.extent.size / (_scale(matrices) or np.inf)
    sizes = [size for size in (OF_SCENE * scene, OF_PRIM * own) if size > 0.0]
    width = min(sizes, default=1.0)
    reading.note(f"it has no widths: {width:.3g} is used, a small share of the scene's size", prim.GetPath())
    return Authored(np.full((1, 1), width), np.empty(0, np.int64), "constant")


def _scale(matrices: FloatArray) -> float:
    """How much the first place enlarges lengths, on average over the directions."""
    return float(np.linalg.norm(matrices[0, :3, :3])) / np.sqrt(3.0)
