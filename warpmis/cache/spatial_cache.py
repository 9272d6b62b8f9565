"""The cache between two rounds: records in, cells with guides, shares and worths out."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpmis.cache.cell_moments import DECAY, CellMoments, worths
from warpmis.cache.cell_shares import CellShares, Launch
from warpmis.cache.cells import CellTree, IntArray
from warpmis.cache.directions import guide_densities, pyramid
from warpmis.cache.round_records import RoundRecords
from warpmis.device.cache_views import GUIDE_BINS, CacheView, CellTreeView, CellView, VertexRecord
from warpmis.device.struct_arrays import records
from warpmis.kernels.cache.lookup import make_locate

FloatArray = NDArray[np.float64]

BINS = GUIDE_BINS * GUIDE_BINS
# The tree is refined by about this many records; the sums are of all.
TREE_RECORDS = 16_000
# What is added up of each record.
COLUMNS = ("tail", "light", "cost", "radiance", "jacobian")

# What a state holds of the cache, beside its moments, and of its tree.
LEARNED = ("tail_worth", "light_worth", "histogram", "densities")
TREE = ("axis", "child", "split", "leaf_of")
SHARES = ("shares", "count", "sums")
# Strategies that draw more or less by the cosine, as the guide does where it knows nothing.
BY_COSINE = ("bsdf", "uniform", "cosine", "diffuse")


class SpatialCache:
    """What has been learned about the light in a scene, in cells of position and normal.

    All sums are made in a fixed order: the same records give the same bits, for any number of threads.
    """

    def __init__(self, extent: float, strategies: tuple[str, ...], device: str) -> None:
        """extent: the longest side of the scene's box [scene units]; strategies: what draws directions."""
        self.device = device
        self.tree = CellTree(extent)
        self.sharing = CellShares(strategies, device)
        self.tail_worth: FloatArray = np.ones(1)
        self.light_worth: FloatArray = np.ones(1)
        self.moments = CellMoments.zeros(1)
        self.histogram: FloatArray = np.zeros((1, BINS))  # sums of L^2 x jacobian
        self.densities: FloatArray = np.ones((1, BINS))

    @property
    def cells(self) -> int:
        return self.tree.cells

    def learn(self, vertices: RoundRecords, launch: Launch) -> IntArray:
        """Take in the vertices of one round: refine the cells, then sums, shares, guides and worths.

        Returns the cell of each record, -1 where there was no vertex.
        """
        table, drawn = vertices.table(), vertices.rows_of_ratios()
        # A record that left float32's range says nothing.
        finite = np.isfinite(table["tail"]) & np.isfinite(table["light"]) & np.isfinite(table["jacobian"])
        finite &= np.isfinite(drawn).all(axis=1)
        used = np.flatnonzero((table["used"] != 0) & finite)
        if len(used) == 0:
            return np.full(len(table), -1)
        self._refine(table, used)
        cell_of, bin_of = self._locate(vertices.records, launch)
        cells, bins = cell_of[used], bin_of[used]
        columns = {name: table[name][used].astype(np.float64) for name in COLUMNS}
        self.moments = self.moments.plus(self._sums(columns, cells))
        by_ratio = drawn[used].astype(np.float64)
        # What sampling of lights finds need not be looked for by the guide.
        radiance = columns["radiance"] * (1.0 - self.sharing.found_by_lights(cells, by_ratio))
        self.histogram += np.bincount(bins, radiance**2 * columns["jacobian"], self.cells * BINS).reshape(-1, BINS)
        self.sharing.learn(cells, columns["tail"], by_ratio, launch)
        self.densities = guide_densities(self.histogram, self.sharing.share_of(*BY_COSINE))
        self.tail_worth, self.light_worth = worths(self.moments)
        return cell_of

    def _refine(self, table: NDArray[Any], used: IntArray) -> None:
        step = max(1, len(used) // TREE_RECORDS)
        some = used[::step]
        places = np.concatenate([table["x"][some], table["n"][some]], axis=1).astype(np.float64)
        refined = self.tree.refine(places, self.tree.find(places), stands_for=step)
        # A part of a cell inherits its part of the sums.
        factor: FloatArray = DECAY * 0.5 ** refined.halvings.astype(np.float64)
        self.moments = self.moments.inherited(refined.parent, factor)
        self.histogram = self.histogram[refined.parent] * factor[:, np.newaxis]
        self.sharing.inherit(refined.parent, factor)

    def _locate(self, vertices: wp.array, launch: Launch) -> tuple[IntArray, IntArray]:
        cells, bins = (wp.zeros(len(vertices), dtype=int, device=self.device) for _ in range(2))
        launch(make_locate(), len(vertices), [vertices, self.tree_view(), cells, bins])
        return cells.numpy().astype(np.int64), bins.numpy().astype(np.int64)

    def _sums(self, columns: dict[str, FloatArray], cells: IntArray) -> CellMoments:
        def add(values: Any = None) -> FloatArray:
            return np.bincount(cells, values, self.cells).astype(np.float64)

        return CellMoments(
            count=add(),
            tail=add(columns["tail"]),
            light=add(columns["light"]),
            cost=add(columns["cost"]),
        )

    def state(self) -> dict[str, Any]:
        """All that has been learned, as plain arrays."""
        own = {name: getattr(self, name) for name in LEARNED}
        tree = {name: getattr(self.tree, name) for name in TREE}
        shares = {name: getattr(self.sharing, name) for name in SHARES}
        return {**own, "tree": tree, "shares": shares, "moments": dict(vars(self.moments))}

    def resume(self, state: dict[str, Any]) -> None:
        """Go on from a state."""
        for name in LEARNED:
            setattr(self, name, state[name])
        for name in TREE:
            setattr(self.tree, name, state["tree"][name])
        for name in SHARES:
            setattr(self.sharing, name, state["shares"][name])
        self.moments = CellMoments(**state["moments"])

    def tree_view(self) -> CellTreeView:
        """The tree over the cells, for kernels."""
        wide, view = self.tree.wide(), CellTreeView()
        view.axes, view.children = (wp.array(one, dtype=int, device=self.device) for one in (wide.axes, wide.children))
        view.splits = wp.array(wide.splits, dtype=wp.float32, device=self.device)
        return view

    def view(self, pixel_worth: NDArray[np.float32]) -> CacheView:
        """What kernels read; pixel_worth: what radiance is worth in each pixel [1 / radiance], shape (pixels,)."""
        columns = {
            "bsdf_share": self.sharing.share_of("bsdf"),
            "tail_worth": self.tail_worth,
            "shadow_ray_worth": self.light_worth,
        }
        view = CacheView()
        view.tree = self.tree_view()
        with wp.ScopedDevice(self.device):
            view.cells = records(CellView, columns, self.cells)
        view.shares = wp.array(self.sharing.shares.ravel(), dtype=wp.float32, device=self.device)
        view.densities = wp.array(pyramid(self.densities).ravel(), dtype=wp.float32, device=self.device)
        view.pixel_worth = wp.array(pixel_worth, dtype=wp.float32, device=self.device)
        view.records = wp.empty(0, dtype=VertexRecord, device=self.device)
        view.ratios = wp.empty(0, dtype=wp.float32, device=self.device)
        return view
