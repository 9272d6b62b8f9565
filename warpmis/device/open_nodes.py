"""Splits the triangles of a tree's nodes among their boxes: a kernel, one thread a node.

A node begins with all of its triangles in one box. The box of the largest area is split in two until there are eight,
or none holds more triangles than a leaf; each split takes the plane of the least expected cost among a few along each
axis.

Reference: Wald (2007), "On Fast Construction of SAH-based Bounding Volume Hierarchies".
"""

import warp as wp

from warpmis.device.kernel_factory import device_kernel
from warpmis.device.views import vec8f, vec8i

wp.set_module_options({"enable_backward": False})

WIDTH = 8  # boxes a node, and triangles a leaf
BINS = 16
bin_counts = wp.types.vector(length=BINS, dtype=wp.int32)
bin_costs = wp.types.vector(length=BINS, dtype=wp.float32)
bin_corners = wp.types.matrix(shape=(BINS, 3), dtype=wp.float32)
child_corners = wp.types.matrix(shape=(3, WIDTH), dtype=wp.float32)

# In place of a split's axis, and of a node's child.
NO_SPLIT = wp.constant(-1)
NO_CHILD = wp.constant(-1)

# No box: outside of every ray's reach.
NOWHERE = wp.constant(1.0e30)


@wp.struct
class Split:
    """A plane between bins: on one side the centres in bins up to `last` along `axis`, which is NO_SPLIT for none."""

    axis: int
    last: int
    cost: float


@wp.struct
class Box:
    low: wp.vec3
    high: wp.vec3


@wp.func
def half_area(box: Box) -> float:
    d = wp.max(box.high - box.low, wp.vec3(0.0, 0.0, 0.0))
    return d[0] * d[1] + d[1] * d[2] + d[2] * d[0]


@wp.func
def no_box() -> Box:
    box = Box()
    box.low = wp.vec3(NOWHERE, NOWHERE, NOWHERE)
    box.high = -box.low
    return box


@wp.func
def joined(a: Box, low: wp.vec3, high: wp.vec3) -> Box:
    a.low = wp.min(a.low, low)
    a.high = wp.max(a.high, high)
    return a


@wp.func
def bin_of(center: float, low: float, scale: float) -> int:
    return wp.clamp(int((center - low) * scale), 0, BINS - 1)


@wp.func
def leaves_of(count: int) -> float:
    """Full leaves are as quick to test as others."""
    return float((count + WIDTH - 1) // WIDTH)


@wp.func
def best_split_along(
    axis: int,
    centers: Box,
    start: int,
    end: int,
    order: wp.array(dtype=int),
    low: wp.array(dtype=wp.vec3),
    high: wp.array(dtype=wp.vec3),
) -> Split:
    split = Split()
    split.axis = NO_SPLIT
    split.cost = NOWHERE
    extent = centers.high[axis] - centers.low[axis]
    scale = float(BINS) / extent
    if extent <= 0.0 or not wp.isfinite(scale):
        return split
    counts = bin_counts()
    lows = bin_corners()
    highs = bin_corners()
    for b in range(BINS):
        for k in range(3):
            lows[b, k] = NOWHERE
            highs[b, k] = -NOWHERE
    for i in range(start, end):
        t = order[i]
        lo = low[t]
        hi = high[t]
        b = bin_of(0.5 * (lo[axis] + hi[axis]), centers.low[axis], scale)
        counts[b] += 1
        for k in range(3):
            lows[b, k] = wp.min(lows[b, k], lo[k])
            highs[b, k] = wp.max(highs[b, k], hi[k])
    behind = bin_costs()
    box = no_box()
    count = int(0)
    for j in range(BINS - 1):
        b = BINS - 1 - j
        box = joined(box, wp.vec3(lows[b, 0], lows[b, 1], lows[b, 2]), wp.vec3(highs[b, 0], highs[b, 1], highs[b, 2]))
        count += counts[b]
        behind[b] = half_area(box) * leaves_of(count)
    box = no_box()
    count = int(0)
    for b in range(BINS - 1):
        box = joined(box, wp.vec3(lows[b, 0], lows[b, 1], lows[b, 2]), wp.vec3(highs[b, 0], highs[b, 1], highs[b, 2]))
        count += counts[b]
        cost = half_area(box) * leaves_of(count) + behind[b + 1]
        if count > 0 and count < end - start and cost < split.cost:
            split.axis = axis
            split.last = b
            split.cost = cost
    return split


@wp.func
def partition(
    start: int,
    end: int,
    order: wp.array(dtype=int),
    low: wp.array(dtype=wp.vec3),
    high: wp.array(dtype=wp.vec3),
    halve: int,
) -> int:
    """Bring a range's triangles in order, and tell where the second part begins."""
    middle = (start + end) // 2
    if halve != 0:
        return middle
    centers = no_box()
    for i in range(start, end):
        center = (low[order[i]] + high[order[i]]) * 0.5
        centers = joined(centers, center, center)
    best = best_split_along(0, centers, start, end, order, low, high)
    for axis in range(1, 3):
        split = best_split_along(axis, centers, start, end, order, low, high)
        if split.cost < best.cost:
            best = split
    if best.axis == NO_SPLIT:  # all centres in one place
        return middle
    axis = best.axis
    scale = float(BINS) / (centers.high[axis] - centers.low[axis])
    first = start
    last = end - 1
    while first <= last:
        t = order[first]
        if bin_of(0.5 * (low[t][axis] + high[t][axis]), centers.low[axis], scale) <= best.last:
            first += 1
        else:
            order[first] = order[last]
            order[last] = t
            last -= 1
    return first


@wp.func
def box_of(
    start: int, end: int, order: wp.array(dtype=int), low: wp.array(dtype=wp.vec3), high: wp.array(dtype=wp.vec3)
) -> Box:
    box = no_box()
    for i in range(start, end):
        box = joined(box, low[order[i]], high[order[i]])
    return box


@device_kernel
def open_nodes(
    ranges: wp.array(dtype=wp.vec2i),
    halve: int,
    order: wp.array(dtype=int),
    low: wp.array(dtype=wp.vec3),
    high: wp.array(dtype=wp.vec3),
    starts: wp.array(dtype=vec8i),
    ends: wp.array(dtype=vec8i),
    bounds: wp.array(dtype=vec8f),
):
    """Split the range of triangles of each node into those of its up to eight boxes."""
    node = wp.tid()
    begins = vec8i()
    stops = vec8i()
    weights = vec8f()  # what is to be split next, 0 where nothing is
    lower = child_corners()
    upper = child_corners()
    for k in range(WIDTH):
        for axis in range(3):
            lower[axis, k] = NOWHERE
            upper[axis, k] = -NOWHERE
    begins[0] = ranges[node][0]
    stops[0] = ranges[node][1]
    children = int(1)
    chosen = int(0)
    while chosen != NO_CHILD:
        # The chosen child is new, and the last one too.
        for side in range(2):
            k = wp.where(side == 0, chosen, children - 1)
            box = box_of(begins[k], stops[k], order, low, high)
            for axis in range(3):
                lower[axis, k] = box.low[axis]
                upper[axis, k] = box.high[axis]
            weights[k] = wp.where(halve != 0, float(stops[k] - begins[k]), half_area(box))
        chosen = int(NO_CHILD)
        if children < WIDTH:
            heaviest = float(-1.0)
            for k in range(children):
                if stops[k] - begins[k] > WIDTH and weights[k] > heaviest:
                    heaviest = weights[k]
                    chosen = k
        if chosen != NO_CHILD:
            middle = partition(begins[chosen], stops[chosen], order, low, high, halve)
            begins[children] = middle
            stops[children] = stops[chosen]
            stops[chosen] = middle
            children += 1
    starts[node] = begins
    ends[node] = stops
    for axis in range(3):
        for side in range(2):
            row = vec8f()
            for k in range(WIDTH):
                row[k] = wp.where(side == 0, lower[axis, k], upper[axis, k])
            bounds[6 * node + 2 * axis + side] = row
