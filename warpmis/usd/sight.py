"""How large things are in the picture, which says how finely a surface is worth being made of faces.

A level of refinement is made where its faces are no smaller than a pixel. The area of a face counts, seen face on,
wherever the camera looks to: what is behind it may be seen in a mirror.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from warpmis.scene import Camera

FloatArray = NDArray[np.float64]

# So many elements of a prim tell how large all are, at so many of its places, those where it looks largest.
SAMPLED = 1024
PLACES = 4
# A level is made where half of the prim, by its area in the picture, gets faces no smaller than a pixel; and where a
# part that can be seen gets faces of two pixels each way, for those before would be facets of four.
SHARE = 0.5
COARSE_SHARE, COARSE = 0.02, 4.0
# Sizes beyond this are those of what the camera stands in [pixel].
MAX_PIXELS = 1e9


@dataclass(frozen=True, eq=False)
class Sight:
    """The camera as far as it says how large things look.

    Attributes:
        position: shape (3,) [scene units].
        pixel: width of a pixel, at distance 1 from a perspective camera [scene units].
        orthographic: whether `pixel` holds at any distance.
    """

    position: FloatArray
    pixel: float
    orthographic: bool

    def moved(self, origin: FloatArray) -> Sight:
        """The same in coordinates that begin at `origin`."""
        return replace(self, position=self.position - origin)

    def pixels(self, points: FloatArray) -> FloatArray:
        """How many pixels a scene unit covers at each point, shape (n, 3), if it is seen face on; shape (n,)."""
        if self.orthographic:
            return np.full(len(points), 1.0 / self.pixel)
        distance = np.linalg.norm(points - self.position, axis=1)
        return np.minimum(1.0 / np.maximum(distance * self.pixel, 1e-300), MAX_PIXELS)


def sight_of(camera: Camera, resolution: tuple[int, int]) -> Sight:
    """The sight of a camera whose window the picture, (width, height) [pixel], fills."""
    left, right, bottom, top = camera.window
    pixel = min((right - left) / resolution[0], (top - bottom) / resolution[1])
    return Sight(camera.position, pixel, camera.orthographic)


def largest_places(matrices: FloatArray, center: FloatArray, radius: float, sight: Sight) -> FloatArray:
    """The few places at which a prim looks largest, of matrices local to world, shape (k, 4, 4).

    Args:
        center, radius: of a sphere that holds the prim, in its own space.
    """
    if len(matrices) <= PLACES:
        return matrices
    scale = np.linalg.norm(matrices[:, :3, :3], axis=(1, 2))
    centers = center @ matrices[:, :3, :3] + matrices[:, 3, :3]
    near = sight.pixels(centers) * scale
    if not sight.orthographic:
        distance = np.linalg.norm(centers - sight.position, axis=1)
        near = scale / np.maximum(distance - radius * scale, 1e-9 * np.maximum(distance, 1e-300))
    return matrices[np.argsort(-near, kind="stable")[:PLACES]]


def worthwhile_levels(areas: FloatArray, most: int) -> int:
    """How many levels give faces that are no smaller than a pixel.

    Args:
        areas: of the faces of the first level in the picture [square pixel], shape (n,); each level quarters them.
        most: how many levels are asked for.
    """
    areas = np.minimum(areas, MAX_PIXELS)
    whole = areas.sum()
    for level in range(most):
        fine, coarse = (areas[areas >= size * 4.0**level].sum() for size in (1.0, COARSE))
        if fine < SHARE * whole and coarse <= COARSE_SHARE * whole:
            return level
    return most


def sampled(count: int) -> NDArray[np.int64]:
    """The rows of some of `count` elements, evenly spread, all of them where they are few; shape (n,)."""
    return np.arange(0, count, max(1, count // SAMPLED))
