"""What the cache has learned, as pictures: for each pixel that of the cell in which its paths first scatter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpmis.cache.spatial_cache import SpatialCache
from warpmis.kernels.path.guided import MIN_RATE

FloatArray = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class CacheMaps:
    """Pictures of shape (H, W), of the first vertex that is no mirror. Where no path scatters all are 0, cells -1.

    Attributes:
        cells: index of the cell, int32.
        bsdf_share: share of the directions that the BSDF draws, the guide drawing the rest, from 0 to 1.
        survival: probability that a path goes on, from 0.1 to 1.
        shadow_rays: probability that a light sample is taken, from 0.1 to 1.
    """

    cells: NDArray[np.int32]
    bsdf_share: FloatArray
    survival: FloatArray
    shadow_rays: FloatArray

    def channels(self) -> dict[str, FloatArray]:
        """Under the names of EXR channels."""
        named = {"cell": self.cells.astype(np.float32), "bsdfShare": self.bsdf_share}
        named |= {"survival": self.survival, "shadowRays": self.shadow_rays}
        return {f"cache.{name}": picture for name, picture in named.items()}


def first_cells(cell_of: NDArray[np.integer], paths: tuple[int, int, int], vertices: int) -> NDArray[np.int32]:
    """The cell of the first vertex of one path in each row and column, -1 where there is none, shape (rows, columns).

    Args:
        cell_of: of each record, -1 where there was no vertex; `vertices` for each path.
        paths: rows, columns, and samples in each.
    """
    first = cell_of.reshape(*paths, vertices)[..., 0]
    chosen = (first >= 0).argmax(axis=-1)[..., np.newaxis]
    return np.take_along_axis(first, chosen, axis=-1)[..., 0].astype(np.int32)


def maps_of(cache: SpatialCache, cells: NDArray[np.int32], size: tuple[int, int], worth: FloatArray) -> CacheMaps:
    """The pictures.

    Args:
        cells: of the pixels that were recorded, those of every so many rows and columns.
        size: height and width of the picture.
        worth: what radiance is worth in each pixel, shape (H * W,).
    """
    whole = _spread_out(cells, size)
    is_known, index = whole >= 0, np.maximum(whole, 0)

    def rate(worths: NDArray[np.float64]) -> FloatArray:
        rates = np.clip(worths[index] * worth.reshape(size), float(MIN_RATE), 1.0)
        return np.where(is_known, rates, 0.0).astype(np.float32)

    share = np.where(is_known, cache.sharing.share_of("bsdf")[index], 0.0).astype(np.float32)
    return CacheMaps(np.ascontiguousarray(whole), share, rate(cache.tail_worth), rate(cache.light_worth))


def shares_of(cache: SpatialCache, cells: NDArray[np.int32], size: tuple[int, int]) -> NDArray[np.float32]:
    """The shares of the strategies at the first vertex, shape (H, W, S); equal ones where the cell is not known."""
    whole = _spread_out(cells, size)[..., np.newaxis]
    shares = cache.sharing.shares
    return np.where(whole >= 0, shares[np.maximum(whole[..., 0], 0)], 1.0 / shares.shape[1]).astype(np.float32)


def _spread_out(cells: NDArray[np.int32], size: tuple[int, int]) -> NDArray[np.int32]:
    """The cells of all pixels, those between the recorded ones like the one before them."""
    step = max(1, -(-size[0] // cells.shape[0]), -(-size[1] // cells.shape[1]))
    return cells.repeat(step, axis=0).repeat(step, axis=1)[: size[0], : size[1]]
