"""Builds the trees of kernels/wide_tree.py: level by level, all nodes of a level in one launch."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpmis.device.mesh import padded_boxes
from warpmis.device.open_nodes import WIDTH, open_nodes
from warpmis.device.views import WideTreeView, vec8f, vec8i

# From this level on ranges are halved as they lie, along the Morton curve: a tree of n triangles has then at most so
# many levels and log8 n, 17 in all, and a visit has at most 7 children a level waiting (kernels/wide_tree.py:
# STACK_SIZE).
HALVING_LEVEL = 6


def wide_trees(
    points: NDArray[np.float32], triangles: NDArray[np.int32], first: Sequence[int], reaches: Sequence[float]
) -> tuple[WideTreeView, list[int]]:
    """Trees on the CPU, with the arguments of mesh.watertight_meshes.

    Returns:
        the trees' arrays, and the node of each one's root.
    """
    levels: list[tuple[NDArray[np.float32], NDArray[np.int32]]] = []
    leaves: list[tuple[NDArray[np.float32], NDArray[np.int32]]] = []
    roots, nodes, leaf_count = [], 0, 0
    for (start, end), reach in zip(pairwise(first), reaches, strict=True):
        roots.append(nodes)
        corners = points[triangles[start:end]]
        order = wp.array(np.arange(end - start, dtype=np.int32), device="cpu")
        boxes = [wp.array(e, dtype=wp.vec3, device="cpu") for e in padded_boxes(points, triangles[start:end], reach)]
        ranges = np.array([[0, end - start]], np.int32)
        level = 0
        while len(ranges):
            bounds, starts, ends = opened(ranges, level >= HALVING_LEVEL, order, *boxes)
            nodes += len(ranges)
            counts = ends - starts
            is_node, is_leaf = counts > WIDTH, (counts > 0) & (counts <= WIDTH)
            children = np.zeros(counts.shape, np.int32)
            children[is_node] = nodes + np.arange(is_node.sum())
            children[is_leaf] = -1 - (leaf_count + np.arange(is_leaf.sum()))
            levels.append((bounds, children))
            leaf_count += int(is_leaf.sum())
            # Slots behind a leaf's last triangle repeat its first one.
            slot = starts[is_leaf][:, None] + np.where(np.arange(WIDTH) < counts[is_leaf][:, None], np.arange(WIDTH), 0)
            faces = order.numpy()[slot]
            leaves.append((corners[faces].transpose(0, 2, 3, 1).reshape(-1, WIDTH), faces))
            ranges = np.stack([starts[is_node], ends[is_node]], axis=1)
            level += 1
    view = WideTreeView()
    bounds, children = (np.concatenate(part) for part in zip(*levels, strict=True))
    corners, faces = (np.concatenate(part) for part in zip(*leaves, strict=True))
    view.bounds = wp.array(bounds, dtype=vec8f, device="cpu")
    view.children = wp.array(children.ravel(), dtype=int, device="cpu")
    view.corners = wp.array(corners, dtype=vec8f, device="cpu")
    view.faces = wp.array(faces.ravel(), dtype=int, device="cpu")
    return view, roots


def opened(
    ranges: NDArray[np.int32], halve: bool, order: wp.array, low: wp.array, high: wp.array
) -> tuple[NDArray[np.float32], NDArray[np.int32], NDArray[np.int32]]:
    """The nodes of a level: rows of bounds, and where each child's triangles begin and end in `order`, (n, 8) each."""
    count = len(ranges)
    starts, ends = (wp.empty(count, dtype=vec8i, device="cpu") for _ in range(2))
    bounds = wp.empty(6 * count, dtype=vec8f, device="cpu")
    inputs = [wp.array(ranges, dtype=wp.vec2i, device="cpu"), int(halve), order, low, high, starts, ends, bounds]
    wp.launch(open_nodes, dim=count, inputs=inputs, device="cpu")
    return bounds.numpy(), starts.numpy(), ends.numpy()
