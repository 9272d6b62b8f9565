"""The cache between two rounds: records in, cells with guides, shares and worths out."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpmis.cache.cell_moments import DECAY, FIRST_SHARE, CellMoments, updated_shares, worths
from warpmis.cache.cells import CellTree, IntArray
from warpmis.cache.directions import guide_densities, pyramid
from warpmis.device.cache_views import GUIDE_BINS, CacheView, CellTreeView, CellView, VertexRecord
from warpmis.device.struct_arrays import records
from warpmis.kernels.cache.lookup import make_locate

FloatArray = NDArray[np.float64]
Launch = Callable[[wp.Kernel, int, list[Any]], None]

BINS = GUIDE_BINS * GUIDE_BINS
# The tree is refined by about this many records; the sums are of all.
TREE_RECORDS = 16_000
# What is added up of each record.
COLUMNS = ("tail", "light", "cost", "bsdf_ratio", "radiance", "jacobian")

# What a state holds of the cache, beside its moments, and of its tree.
LEARNED = ("rounds", "shares", "tail_worth", "light_worth", "histogram", "densities")
TREE = ("axis", "child", "split", "leaf_of")


class SpatialCache:
    """What has been learned about the light in a scene, in cells of position and normal.

    All sums are made in a fixed order: the same records give the same bits, for any number of threads.
    """

    def __init__(self, extent: float, device: str) -> None:
        """extent: the longest side of the scene's box [scene units]."""
        self.device = device
        self.tree = CellTree(extent)
        self.rounds = 0
        self.shares: FloatArray = np.ones(1)
        self.tail_worth: FloatArray = np.ones(1)
        self.light_worth: FloatArray = np.ones(1)
        self.moments = CellMoments.zeros(1)
        self.histogram: FloatArray = np.zeros((1, BINS))  # sums of L^2 x jacobian
        self.densities: FloatArray = np.ones((1, BINS))

    @property
    def cells(self) -> int:
        return self.tree.cells

    def learn(self, vertices: wp.array, launch: Launch) -> IntArray:
        """Take in the vertex records of one round: refine the cells, then sums, shares, guides and worths.

        Returns the cell of each record, -1 where there was no vertex.
        """
        table = vertices.numpy()
        # A record that left float32's range says nothing.
        finite = np.isfinite(table["tail"]) & np.isfinite(table["light"]) & np.isfinite(table["jacobian"])
        used = np.flatnonzero((table["used"] != 0) & finite)
        if len(used) == 0:
            return np.full(len(vertices), -1)
        self._refine(table, used)
        cell_of, bin_of = self._locate(vertices, launch)
        cells, bins = cell_of[used], bin_of[used]
        columns = {name: table[name][used].astype(np.float64) for name in COLUMNS}
        latest = self._sums(columns, cells)
        self.moments = self.moments.plus(latest)
        squares = columns["radiance"] ** 2 * columns["jacobian"]
        self.histogram += np.bincount(bins, squares, self.cells * BINS).reshape(-1, BINS)
        self.rounds += 1
        if self.rounds == 1:
            self.shares = np.full(self.cells, FIRST_SHARE)  # the round had no guide to compare with
        else:
            self.shares = updated_shares(self.shares, latest, self.moments)
        self.densities = guide_densities(self.histogram, self.shares)
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
        self.shares = self.shares[refined.parent]

    def _locate(self, vertices: wp.array, launch: Launch) -> tuple[IntArray, IntArray]:
        cells, bins = (wp.zeros(len(vertices), dtype=int, device=self.device) for _ in range(2))
        launch(make_locate(), len(vertices), [vertices, self.tree_view(), cells, bins])
        return cells.numpy().astype(np.int64), bins.numpy().astype(np.int64)

    def _sums(self, columns: dict[str, FloatArray], cells: IntArray) -> CellMoments:
        shares, tail, ratio = self.shares[cells], columns["tail"], columns["bsdf_ratio"]
        # The densities of the mixture add up to it: a q_B + (1 - a) q_G = 1.
        guide_ratio = np.maximum((1.0 - shares * ratio) / np.maximum(1.0 - shares, 1e-9), 0.0) * (shares < 1.0)

        def add(values: Any = None) -> FloatArray:
            return np.bincount(cells, values, self.cells).astype(np.float64)

        return CellMoments(
            count=add(),
            by_bsdf=add(tail * ratio),
            by_guide=add(tail * guide_ratio),
            tail=add(tail),
            light=add(columns["light"]),
            cost=add(columns["cost"]),
        )

    def state(self) -> dict[str, Any]:
        """All that has been learned, as plain arrays."""
        own = {name: getattr(self, name) for name in LEARNED}
        tree = {name: getattr(self.tree, name) for name in TREE}
        return {**own, "tree": tree, "moments": dict(vars(self.moments))}

    def resume(self, state: dict[str, Any]) -> None:
        """Go on from a state."""
        for name in LEARNED:
            setattr(self, name, state[name])
        for name in TREE:
            setattr(self.tree, name, state["tree"][name])
        self.moments = CellMoments(**state["moments"])

    def tree_view(self) -> CellTreeView:
        """The tree over the cells, for kernels."""
        wide, view = self.tree.wide(), CellTreeView()
        view.axes, view.children = (wp.array(one, dtype=int, device=self.device) for one in (wide.axes, wide.children))
        view.splits = wp.array(wide.splits, dtype=wp.float32, device=self.device)
        return view

    def view(self, pixel_worth: NDArray[np.float32]) -> CacheView:
        """What kernels read; pixel_worth: what radiance is worth in each pixel [1 / radiance], shape (pixels,)."""
        columns = {"bsdf_share": self.shares, "tail_worth": self.tail_worth, "shadow_ray_worth": self.light_worth}
        view = CacheView()
        view.tree = self.tree_view()
        with wp.ScopedDevice(self.device):
            view.cells = records(CellView, columns, self.cells)
        view.densities = wp.array(pyramid(self.densities).ravel(), dtype=wp.float32, device=self.device)
        view.pixel_worth = wp.array(pixel_worth, dtype=wp.float32, device=self.device)
        view.records = wp.empty(0, dtype=VertexRecord, device=self.device)
        return view
