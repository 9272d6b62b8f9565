"""The cells of the cache: the leaves of a k-d tree over position and shading normal.

The two sides of a thin wall differ in their normal, so no light leaks through it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# A leaf that holds more records of a round is divided.
MOST_RECORDS = 2000
# Bound on memory: at 1.4 kB a cell this is 6 MB, whatever the scene and the resolution.
MOST_CELLS = 4096
# A normal turned by 60 degrees is as far away as half of the scene's extent.
NORMAL_WEIGHT = 0.5
LEAF = -1
# Records whose places differ by less, as a standard deviation in parts of the scene, see the same light.
SMALLEST = 1e-6


@dataclass(frozen=True, eq=False)
class Refinement:
    """What became of the cells.

    Attributes:
        parent: for each cell, the cell of before that it is a part of, shape (cells,).
        halvings: how many times that one was divided on the way to it, shape (cells,).
        cell_of: the cell of each record, shape (n,).
    """

    parent: IntArray
    halvings: IntArray
    cell_of: IntArray


@dataclass(frozen=True, eq=False)
class WideTree:
    """A tree as device.cache_views.CellTreeView has it."""

    axes: IntArray
    splits: NDArray[np.float32]
    children: IntArray


class CellTree:
    """A k-d tree that grows leaf by leaf; cells keep their index, and new ones come behind them.

    Attributes:
        axis: 0 to 2 for position, 3 to 5 for the normal, LEAF for a leaf, shape (nodes,).
        child: the first of two children in a row; of a leaf its cell, shape (nodes,).
        split: what lies above it belongs to the second child, float32 as on the device, shape (nodes,).
        cells: how many there are.
    """

    def __init__(self, extent: float) -> None:
        """extent: the longest side of the scene's box [scene units]."""
        self.axis: IntArray = np.array([LEAF])
        self.child: IntArray = np.array([0])
        self.split: NDArray[np.float32] = np.zeros(1, np.float32)
        self.leaf_of: IntArray = np.array([0])  # the node of each cell
        self.weight = np.array([1.0 / max(extent, 1e-30)] * 3 + [NORMAL_WEIGHT] * 3)

    @property
    def cells(self) -> int:
        return len(self.leaf_of)

    def find(self, places: FloatArray) -> IntArray:
        """The cell of each row (x, y, z, nx, ny, nz), shape (n,)."""
        node = np.zeros(len(places), np.int64)
        rows = np.arange(len(places))
        while True:
            axis = self.axis[node]
            inner = axis != LEAF
            if not inner.any():
                return self.child[node]
            above = places[rows, np.maximum(axis, 0)].astype(np.float32) > self.split[node]
            node = np.where(inner, self.child[node] + above, node)

    def wide(self) -> WideTree:
        """The tree with three of its levels in a node."""
        axes: list[IntArray] = []
        splits: list[NDArray[np.float32]] = []
        children: list[IntArray] = []
        count, level = 1, np.zeros(1, np.int64)
        while len(level):
            row: IntArray = level[:, np.newaxis]
            packed, node_splits, place = np.zeros(len(level), np.int64), [], 0
            for _ in range(3):
                inner = self.axis[row] != LEAF
                # A leaf above the last level is its own first child.
                for column in np.where(inner, self.axis[row], 0).T:
                    packed |= column << (3 * place)
                    place += 1
                node_splits.append(np.where(inner, self.split[row], np.float32(np.inf)))
                pairs = np.stack(
                    [np.where(inner, self.child[row], row), np.where(inner, self.child[row] + 1, row)], axis=2
                )
                row = pairs.reshape(len(level), -1)
            inner = self.axis[row] != LEAF
            row_children = -1 - self.child[row]
            row_children[inner] = count + np.arange(inner.sum())
            level = row[inner]
            count += len(level)
            axes.append(packed)
            splits.append(np.pad(np.concatenate(node_splits, axis=1), ((0, 0), (0, 1))))
            children.append(row_children)
        return WideTree(np.concatenate(axes), np.concatenate(splits).ravel(), np.concatenate(children).ravel())

    def refine(self, places: FloatArray, cell_of: IntArray, stands_for: float = 1.0) -> Refinement:
        """Divide every leaf of more than MOST_RECORDS records until there is none, or MOST_CELLS are reached.

        A leaf is divided at the mean along the axis of the largest variance, positions in units of the scene.

        Args:
            places: position and normal of a sample of the round's records, shape (n, 6).
            cell_of: the cell of each, shape (n,).
            stands_for: how many records each of them stands for.
        """
        parent, halvings = np.arange(self.cells), np.zeros(self.cells, np.int64)
        while True:
            counts = np.bincount(cell_of, minlength=self.cells)
            divided = np.flatnonzero(counts * stands_for > MOST_RECORDS)
            axis, at, varies = self._best_splits(places, cell_of, divided)
            divided, axis, at = (values[varies][: MOST_CELLS - self.cells] for values in (divided, axis, at))
            if len(divided) == 0:
                return Refinement(parent, halvings, cell_of)
            halvings[divided] += 1
            parent = np.append(parent, parent[divided])
            halvings = np.append(halvings, halvings[divided])
            cell_of = self._divide(places, cell_of, divided, axis, at)

    def _best_splits(self, places: FloatArray, cell_of: IntArray, cells: IntArray) -> tuple[IntArray, Any, Any]:
        """Axis and place at which each of these cells is divided best, and whether records are then on both sides."""
        place_of = np.full(self.cells, -1)
        place_of[cells] = np.arange(len(cells))
        chosen = place_of[cell_of] >= 0
        group, rows = place_of[cell_of[chosen]], places[chosen]
        count = np.maximum(np.bincount(group, minlength=len(cells)), 1)

        def mean_of(values: FloatArray) -> FloatArray:
            return np.stack([np.bincount(group, column, len(cells)) for column in values.T], axis=1) / count[:, None]

        mean = mean_of(rows)
        variance = mean_of((rows - mean[group]) ** 2) * self.weight**2
        axis = variance.argmax(axis=1)
        best = np.arange(len(cells)), axis
        at = mean[best].astype(np.float32)
        above = rows[np.arange(len(rows)), axis[group]].astype(np.float32) > at[group]
        on_one_side = np.bincount(group, above, len(cells)) == 0  # the mean may be rounded up to the largest
        return axis, at, (variance[best] > SMALLEST**2) & ~on_one_side

    def _divide(self, places: FloatArray, cell_of: IntArray, cells: IntArray, axis: IntArray, at: Any) -> IntArray:
        """Give each of the cells two leaves; the second is a new cell. Returns the cell of each record."""
        nodes, count = self.leaf_of[cells], len(cells)
        first_child = len(self.axis) + 2 * np.arange(count)
        new_cells = self.cells + np.arange(count)
        self.axis[nodes], self.child[nodes], self.split[nodes] = axis, first_child, at
        self.axis = np.append(self.axis, np.full(2 * count, LEAF))
        self.child = np.append(self.child, np.stack([cells, new_cells], axis=1).ravel())
        self.split = np.append(self.split, np.zeros(2 * count, np.float32))
        self.leaf_of[cells] = first_child
        self.leaf_of = np.append(self.leaf_of, first_child + 1)
        group = np.full(self.cells, -1)
        group[cells] = np.arange(count)
        of_record = group[cell_of]
        along = places[np.arange(len(places)), axis[of_record]].astype(np.float32)
        above = (of_record >= 0) & (along > at[of_record])
        return np.where(above, new_cells[of_record], cell_of)
