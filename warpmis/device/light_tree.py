"""Builds the tree by which lights are chosen (kernels/light/tree.py): level by level, all nodes of a level at once.

First a tree of two children a node. A node is divided where the lights' weighted variance of place, times how far
their axes differ, is least afterwards: what the surface area heuristic does for rays, for an estimate of irradiance
that goes by just these. Then nodes of eight children are made of that (light_nodes.py).

Reference: Conty Estevez, Kulla (2018), "Importance Sampling of Many Lights with Adaptive Tree Splitting", section 4.4,
with boxes and cones in place of variances.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from warpmis.device.light_leaves import FloatArray, LightLeaves

IntArray = NDArray[np.int64]

# Places along an axis at which a node may be divided.
BINS = 12
# From this level on nodes are halved: no path is longer than that and the logarithm of the lights' number together.
HALVING_LEVEL = 24
# Light that leaves in all directions spreads over four times the solid angle that a cosine lobe does.
SPREAD = 3.0


@dataclass(frozen=True, eq=False)
class BinaryTree:
    """A tree over n lights, a row for each of its 2 n - 1 nodes, the root first.

    Attributes:
        child: the row of the first child, whose sibling follows, or -1 - light for a leaf, shape (2 n - 1,).
        count, level: a node's lights, and its turns from the root, which ascend, shape (2 n - 1,) each.
        low, high: corners of a box that holds the node's lights; mean, variance: of their places, by weight.
        weight: the sum of theirs, as in LightLeaves; axis, cone: a cone that holds theirs; directed: the share of the
            weight that falls off with the cosine to the axis; two_sided: all of them are; links: the bits of all.
    """

    child: IntArray
    count: IntArray
    level: IntArray
    low: FloatArray
    high: FloatArray
    mean: FloatArray
    variance: FloatArray
    weight: FloatArray
    axis: FloatArray
    cone: FloatArray
    directed: FloatArray
    two_sided: NDArray[np.bool_]
    links: NDArray[np.uint32]


def blank_tree(rows: int) -> BinaryTree:
    """So many nodes of zeros."""
    return BinaryTree(
        child=np.zeros(rows, np.int64),
        count=np.zeros(rows, np.int64),
        level=np.zeros(rows, np.int64),
        **{name: np.zeros((rows, 3)) for name in ("low", "high", "mean", "axis")},
        **{name: np.zeros(rows) for name in ("variance", "weight", "cone", "directed")},
        two_sided=np.zeros(rows, bool),
        links=np.zeros(rows, np.uint32),
    )


def grouped(leaves: LightLeaves, starts: IntArray) -> LightLeaves:
    """What a tree sees of groups of lights, each of which goes from its start to the next one's."""
    tree = blank_tree(len(starts))
    summarise(tree, 0, leaves, np.arange(len(leaves)), starts)
    return LightLeaves(**{field.name: getattr(tree, field.name) for field in fields(LightLeaves)})


def binary_tree(leaves: LightLeaves) -> BinaryTree:
    """A tree over one light or more."""
    tree = blank_tree(2 * len(leaves) - 1)
    order = np.arange(len(leaves))
    starts = np.array([0])  # where in `order` the nodes of this level begin
    level, first, made = 0, 0, 1
    while len(starts):
        sizes = np.diff(starts, append=len(order))
        summarise(tree, first, leaves, order, starts)
        single = sizes == 1
        child = np.where(single, -1 - order[starts], made + 2 * (np.cumsum(~single) - 1))
        rows_here = slice(first, first + len(starts))
        tree.child[rows_here], tree.count[rows_here], tree.level[rows_here] = child, sizes, level
        kept = np.repeat(~single, sizes)
        order, sizes = order[kept], sizes[~single]
        starts = np.cumsum(sizes) - sizes
        order, starts = partitioned(order, starts, sizes, sides(leaves, order, starts, sizes, level))
        first, made = made, made + len(starts)
        level += 1
    return tree


def summarise(tree: BinaryTree, first: int, leaves: LightLeaves, order: IntArray, starts: IntArray) -> None:
    """Fills in a level of nodes, from row `first` on, each of which holds the lights of `order` from its start to the
    next one's."""
    if len(starts) == 0:
        return
    rows = slice(first, first + len(starts))
    sizes = np.diff(starts, append=len(order))
    weight = leaves.weight[order]
    total = np.add.reduceat(weight, starts)

    def averaged(values: FloatArray) -> FloatArray:
        weights = weight if values.ndim == 1 else weight[:, None]
        totals = total if values.ndim == 1 else total[:, None]
        found: FloatArray = np.add.reduceat(values * weights, starts, axis=0) / totals
        return found

    tree.weight[rows] = total
    tree.low[rows] = np.minimum.reduceat(leaves.low[order], starts, axis=0)
    tree.high[rows] = np.maximum.reduceat(leaves.high[order], starts, axis=0)
    mean = averaged(leaves.mean[order])
    apart = ((leaves.mean[order] - np.repeat(mean, sizes, axis=0)) ** 2).sum(axis=1)
    tree.mean[rows], tree.variance[rows] = mean, averaged(leaves.variance[order] + apart)
    two_sided = np.logical_and.reduceat(leaves.two_sided[order], starts)
    axis = facing_alike(leaves, order, starts, two_sided)
    resultant = averaged(axis * leaves.directed[order][:, None])
    about, cone = cones(axis, leaves.cone[order], averaged(axis), starts)
    tree.axis[rows], tree.cone[rows], tree.two_sided[rows] = about, cone, two_sided
    tree.directed[rows] = np.clip((resultant * about).sum(axis=1), 0.0, 1.0)
    tree.links[rows] = np.bitwise_or.reduceat(leaves.links[order], starts)


def facing_alike(leaves: LightLeaves, order: IntArray, starts: IntArray, two_sided: NDArray[np.bool_]) -> FloatArray:
    """The lights' axes; those of lights with two sides on the side of their node's first, if all of it are such."""
    sizes = np.diff(starts, append=len(order))
    axis = leaves.axis[order]
    alike = np.repeat(two_sided, sizes)
    against = (axis * np.repeat(axis[starts], sizes, axis=0)).sum(axis=1) < 0.0
    axis[alike & against] *= -1.0
    axis[~alike & leaves.two_sided[order]] = 0.0
    return axis


def cones(axis: FloatArray, cone: FloatArray, mean: FloatArray, starts: IntArray) -> tuple[FloatArray, FloatArray]:
    """Axes and half angles of cones that hold the lights' own, about the mean axis, which may be 0."""
    sizes = np.diff(starts, append=len(axis))
    length = np.linalg.norm(mean, axis=1, keepdims=True)
    about = np.where(length > 1e-6, mean / np.maximum(length, 1e-6), (0.0, 0.0, 1.0))
    cosine = (axis * np.repeat(about, sizes, axis=0)).sum(axis=1)
    angle = np.maximum.reduceat(np.arccos(np.clip(cosine, -1.0, 1.0)) + cone, starts)
    return about, np.minimum(angle, np.pi)


def sides(leaves: LightLeaves, order: IntArray, starts: IntArray, sizes: IntArray, level: int) -> NDArray[np.bool_]:
    """Whether each light goes to its node's second child."""
    second = halved(starts, sizes)
    chooses = sizes > 2 if level < HALVING_LEVEL else np.zeros(len(sizes), bool)
    if chooses.any():
        kept = np.repeat(chooses, sizes)
        some = sizes[chooses]
        second[kept] = divided(leaves, order[kept], np.cumsum(some) - some, some)
    return second


def halved(starts: IntArray, sizes: IntArray) -> NDArray[np.bool_]:
    """Whether each light goes to its node's second child where nodes are halved as they lie."""
    place = np.arange(sizes.sum()) - np.repeat(starts, sizes)
    found: NDArray[np.bool_] = place >= np.repeat((sizes + 1) // 2, sizes)
    return found


def divided(leaves: LightLeaves, order: IntArray, starts: IntArray, sizes: IntArray) -> NDArray[np.bool_]:
    """Whether each light goes to its node's second child, by the best of BINS - 1 planes along each of three axes."""
    count = len(sizes)
    node = np.repeat(np.arange(count), sizes)
    place = leaves.mean[order]
    low = np.minimum.reduceat(place, starts, axis=0)
    extent = np.maximum.reduceat(place, starts, axis=0) - low
    scale = np.divide(BINS, extent, out=np.zeros_like(extent), where=extent > 0.0)
    bins = np.minimum(((place - low[node]) * scale[node]).astype(np.int64), BINS - 1)
    # Places count from the node's own corner: the variance is a difference that would lose its digits far from there.
    moments = moments_of(leaves, order, place - low[node])
    costs = np.stack([split_costs(node * BINS + bins[:, axis], moments, count) for axis in range(3)], axis=1)
    best = costs.reshape(count, -1).argmin(axis=1)
    axis, plane = np.divmod(best, BINS - 1)
    second: NDArray[np.bool_] = bins[np.arange(len(order)), axis[node]] > plane[node]
    # Lights in one place cannot be told apart: they are halved.
    stuck = ~np.isfinite(costs.reshape(count, -1)[np.arange(count), best])
    return np.where(stuck[node], halved(starts, sizes), second)


def moments_of(leaves: LightLeaves, order: IntArray, place: FloatArray) -> list[FloatArray]:
    """What adds up over lights, and tells their variance: weight, and weighted place, square and axis."""
    weight = leaves.weight[order] / leaves.weight.max()
    square = (place**2).sum(axis=1) + leaves.variance[order]
    axis = leaves.axis[order] * (leaves.directed[order] * ~leaves.two_sided[order])[:, None]
    return [np.ones(len(order)), weight, *(place.T * weight), square * weight, *(axis.T * weight)]


def split_costs(keys: IntArray, moments: list[FloatArray], count: int) -> FloatArray:
    """The cost of dividing each node after each bin, infinite where a side is empty, shape (count, BINS - 1)."""
    sums: FloatArray = np.stack([np.bincount(keys, values, count * BINS).reshape(count, BINS) for values in moments])
    first: FloatArray = np.cumsum(sums, axis=2)[:, :, :-1]
    second: FloatArray = sums.sum(axis=2, keepdims=True) - first
    empty = (first[0] < 0.5) | (second[0] < 0.5)
    return np.where(empty, np.inf, cost(first) + cost(second))


def cost(sums: FloatArray) -> FloatArray:
    """Weighted variance of place times how far the axes differ, from sums of moments_of's columns."""
    weight = np.maximum(sums[1], 1e-300)
    variance = np.maximum(sums[5] - (sums[2:5] ** 2).sum(axis=0) / weight, 0.0)
    apart = 1.0 - np.minimum(np.sqrt((sums[6:9] ** 2).sum(axis=0)) / weight, 1.0)
    found: FloatArray = variance * (1.0 + SPREAD * apart)
    return found


def partitioned(
    order: IntArray, starts: IntArray, sizes: IntArray, second: NDArray[np.bool_]
) -> tuple[IntArray, IntArray]:
    """The lights with those of each node's first child before its second's, and where all children begin."""
    if len(order) == 0:
        return order, starts
    seconds = np.add.reduceat(second.astype(np.int64), starts)
    before: IntArray = np.cumsum(second) - second  # lights of second children before each light
    within: IntArray = before - np.repeat(before[starts], sizes)
    begin = np.repeat(starts, sizes)
    place = np.arange(len(order)) - begin
    to = begin + np.where(second, np.repeat(sizes - seconds, sizes) + within, place - within)
    moved = np.empty_like(order)
    moved[to] = order
    return moved, np.stack([starts, starts + sizes - seconds], axis=1).ravel()
