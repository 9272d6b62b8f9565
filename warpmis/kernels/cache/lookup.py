"""Which cell of the cache a vertex lies in."""

import warp as wp

from warpmis.device.cache_views import GUIDE_BINS, CellTreeView, VertexRecord
from warpmis.device.kernel_factory import KernelFunction, kernel_factory
from warpmis.kernels.cache.guide import bin_of

wp.set_module_options({"enable_backward": False})


vec6 = wp.types.vector(length=6, dtype=float)


@wp.func
def cell_of(tree: CellTreeView, x: wp.vec3, n: wp.vec3) -> int:
    """The cell of a position and a shading normal.

    All seven splits of a node are compared at once: the walk waits for memory once in three levels of the k-d tree.
    """
    place = vec6(x[0], x[1], x[2], n[0], n[1], n[2])
    node = int(0)
    while node >= 0:
        axes = tree.axes[node]
        first = 8 * node
        # In whole numbers, since a branch would be guessed wrong half of the time.
        above = int(place[axes & 7] > tree.splits[first])
        low = int(place[(axes >> 3) & 7] > tree.splits[first + 1])
        high = int(place[(axes >> 6) & 7] > tree.splits[first + 2])
        low_low = int(place[(axes >> 9) & 7] > tree.splits[first + 3])
        low_high = int(place[(axes >> 12) & 7] > tree.splits[first + 4])
        high_low = int(place[(axes >> 15) & 7] > tree.splits[first + 5])
        high_high = int(place[(axes >> 18) & 7] > tree.splits[first + 6])
        second = low + above * (high - low)
        of_low = low_low + low * (low_high - low_low)
        of_high = high_low + high * (high_high - high_low)
        third = of_low + above * (of_high - of_low)
        node = tree.children[first + 4 * above + 2 * second + third]
    return -1 - node


@kernel_factory
def make_locate() -> KernelFunction:
    """The kernel that finds the cell and the bin of each record, -1 for those that hold no vertex."""

    def locate(
        first: int,
        records: wp.array(dtype=VertexRecord),
        tree: CellTreeView,
        cells: wp.array(dtype=int),
        bins: wp.array(dtype=int),
    ):
        index = first + wp.tid()
        record = records[index]
        cells[index] = -1
        if record.used != 0:
            cell = cell_of(tree, record.x, record.n)
            cells[index] = cell
            bins[index] = cell * wp.static(GUIDE_BINS * GUIDE_BINS) + bin_of(record.u, record.v)

    return locate
