"""Which cell of the cache a vertex lies in."""

import warp as wp

from warpmis.device.cache_views import GUIDE_BINS, CellNodeView, VertexRecord
from warpmis.device.kernel_factory import KernelFunction, kernel_factory
from warpmis.kernels.cache.guide import bin_of

wp.set_module_options({"enable_backward": False})


vec6 = wp.types.vector(length=6, dtype=float)


@wp.func
def cell_of(nodes: wp.array(dtype=CellNodeView), x: wp.vec3, n: wp.vec3) -> int:
    """The cell of a position and a shading normal."""
    place = vec6(x[0], x[1], x[2], n[0], n[1], n[2])
    node = nodes[0]
    while node.axis >= 0:
        # No branch but the loop's own: the walk is as long as a processor's guesses are right.
        node = nodes[node.child + int(place[node.axis] > node.split)]
    return node.child


@kernel_factory
def make_locate() -> KernelFunction:
    """The kernel that finds the cell and the bin of each record, -1 for those that hold no vertex."""

    def locate(
        first: int,
        records: wp.array(dtype=VertexRecord),
        nodes: wp.array(dtype=CellNodeView),
        cells: wp.array(dtype=int),
        bins: wp.array(dtype=int),
    ):
        index = first + wp.tid()
        record = records[index]
        cells[index] = -1
        if record.used != 0:
            cell = cell_of(nodes, record.x, record.n)
            cells[index] = cell
            bins[index] = cell * wp.static(GUIDE_BINS * GUIDE_BINS) + bin_of(record.u, record.v)

    return locate
