"""The tree by which lights are chosen, as kernels read it: nodes of eight children, made of a binary tree."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpmis.device.light_leaves import LightLeaves
from warpmis.device.light_tree import BinaryTree, IntArray, binary_tree
from warpmis.device.mesh import PAD

WIDTH = 8
# Bits of a path for each level: the place of a child among eight.
PATH_BITS = 3
# Estimates count as no less where they are not 0: float32 could not hold some products.
LEAST = 1e-30


@dataclass(frozen=True, eq=False)
class LightNodes:
    """A tree over n lights, in nodes of eight children; the root is the first.

    Attributes:
        rows: ROWS rows a node, each of one quantity of its eight children, shape (ROWS k, 8) float32.
        children: of each child the node, or -1 - light for a leaf, or EMPTY, shape (k, 8).
        links: of each child its bits, shape (k, 8) int32.
        analytic: of each node a bit for each child with an analytic light, the first child's the lowest, shape (k,).
        paths: for each light the places of its ancestors and itself among their siblings, PATH_BITS each, the root's
            child in the lowest, shape (n,) uint64.
    """

    rows: NDArray[np.float32]
    children: NDArray[np.int32]
    links: NDArray[np.int32]
    analytic: NDArray[np.int32]
    paths: NDArray[np.uint64]


# What stands in `rows`, in this order (kernels/light/tree.py reads them so). center, half: middle and half extents of a
# box that holds the lights; mean, radius2: a ball of uniform density with their mean place and variance, its radius
# squared; least: the least estimate that is not 0.
COLUMNS = (
    *("center x", "center y", "center z", "half x", "half y", "half z", "mean x", "mean y", "mean z", "radius2"),
    *("weight", "least", "axis x", "axis y", "axis z", "cos cone", "sin cone", "directed", "two-sided"),
)
ROWS = len(COLUMNS)
EMPTY = -(2**31)


def light_nodes(leaves: LightLeaves, analytic: int, singles: int | None = None) -> LightNodes:
    """A tree over one light or more, of which so many come first that are analytic ones, and so many that are single
    lights (None: all): those behind them are groups."""
    tree = binary_tree(leaves)
    lanes, children, paths = collapsed(tree, len(leaves))
    columns = np.zeros((ROWS, len(tree.child) + 1), np.float32)
    # The last column is that of no child, which shines nowhere.
    columns[:, :-1] = columns_of(tree, len(leaves) if singles is None else singles)
    columns[COLUMNS.index("cos cone"), -1] = -1.0
    rows = columns[:, lanes].swapaxes(0, 1).reshape(-1, WIDTH)
    links = np.append(tree.links, np.uint32(0))[lanes].view(np.int32)
    return LightNodes(np.ascontiguousarray(rows), children, links, lanes_with(tree, lanes, analytic), paths)


def lanes_with(tree: BinaryTree, lanes: IntArray, analytic: int) -> NDArray[np.int32]:
    """LightNodes.analytic: of nodes with these children, rows of the binary tree."""
    has = (tree.child < 0) & (tree.child >= -analytic)
    of_children = np.flatnonzero(tree.child >= 0)
    for level in reversed(np.split(of_children, np.flatnonzero(np.diff(tree.level[of_children])) + 1)):
        has[level] = has[tree.child[level]] | has[tree.child[level] + 1]
    bits: NDArray[np.int32] = ((lanes >= 0) & has[lanes]) @ (1 << np.arange(WIDTH, dtype=np.int32))
    return bits


def columns_of(tree: BinaryTree, singles: int) -> NDArray[np.float32]:
    """COLUMNS of the binary tree's nodes, shape (ROWS, n)."""
    center = (0.5 * (tree.low + tree.high)).astype(np.float32)
    half = np.maximum(tree.high - center, center - tree.low)
    # Rays meet a box wherever they meet what is in it, rounding included (device/mesh.py).
    half = half + PAD * max(np.abs(tree.low).max(), np.abs(tree.high).max())
    wide = tree.cone >= np.pi
    weight = np.clip(tree.weight, 1e-37, 1e37)
    # Of a single flat light an estimate of 0 is exact.
    exact = (tree.child < 0) & (tree.child >= -singles) & (tree.directed > 0.0) & ~tree.two_sided
    return np.concatenate(
        [
            *(center.T, half.T, tree.mean.T),
            # A ball of uniform density has 3 / 5 of its radius squared as its variance.
            *(5.0 / 3.0 * tree.variance[None], weight[None], np.where(exact, 0.0, LEAST)[None], tree.axis.T),
            *(np.where(wide, -1.0, np.cos(tree.cone))[None], np.where(wide, 0.0, np.sin(tree.cone))[None]),
            *(tree.directed[None], tree.two_sided[None]),
        ]
    ).astype(np.float32)


def collapsed(tree: BinaryTree, count: int) -> tuple[IntArray, NDArray[np.int32], NDArray[np.uint64]]:
    """Nodes of eight children: of each child the row in the binary tree, -1 for none, shape (k, 8); and LightNodes'
    children and paths."""
    paths = np.zeros(count, np.uint64)
    frontier, prefix = np.array([0]), np.zeros(1, np.uint64)
    lanes_of, children_of = [], []
    level, made = 0, 1
    while len(frontier):
        lanes = opened(tree, frontier)
        child = np.where(lanes >= 0, tree.child[lanes], -1)
        is_leaf, is_node = (lanes >= 0) & (child < 0), (lanes >= 0) & (child >= 0)
        numbers = np.where(is_leaf, child, EMPTY).astype(np.int32)
        numbers[is_node] = made + np.arange(is_node.sum())
        turns = np.arange(WIDTH, dtype=np.uint64) << np.uint64(PATH_BITS * level)
        reached = prefix[:, None] | turns
        paths[-1 - child[is_leaf]] = reached[is_leaf]
        lanes_of.append(lanes)
        children_of.append(numbers)
        frontier, prefix = lanes[is_node], reached[is_node]
        made += len(frontier)
        level += 1
    return np.concatenate(lanes_of), np.concatenate(children_of), paths


def opened(tree: BinaryTree, nodes: IntArray) -> IntArray:
    """Up to eight nodes of the binary tree that together hold the lights of each node, -1 for none, shape (m, 8).

    A child with more lights is opened before one with fewer, and one whose lights fill no node of their own never.
    """
    lanes = np.full((len(nodes), WIDTH), -1)
    lanes[:, 0] = nodes
    every = np.arange(len(nodes))
    least = np.where(tree.count[nodes] > WIDTH, WIDTH, 1)
    for place in range(1, WIDTH):
        size = np.where(lanes >= 0, tree.count[lanes], 0)
        largest = size.argmax(axis=1)
        opens = every[size[every, largest] > least]
        first = tree.child[lanes[opens, largest[opens]]]
        lanes[opens, largest[opens]] = first
        lanes[opens, place] = first + 1
    return lanes
