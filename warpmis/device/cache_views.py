"""The structs through which kernels see the spatial cache, and what they record for it."""

import warp as wp

# The guide of a cell has 2^GUIDE_LEVELS bins along each side of the square, and nodes of all levels above them.
GUIDE_LEVELS = 4
GUIDE_BINS = 1 << GUIDE_LEVELS
GUIDE_NODES = sum(4**level for level in range(1, GUIDE_LEVELS + 1))


@wp.struct
class CellTreeView:
    """The tree over the cache's cells, three levels of a k-d tree in each node: seven splits and eight children.

    axes: of the node's splits, three bits each, the lowest of the first: 0 to 2 for position, 3 to 5 for the normal.
    splits: eight places a node, the last one unused: of the root, of its two children, of their four; what lies above
    a split belongs to the second child. children: eight a node; a cell c is -1 - c.
    """

    axes: wp.array(dtype=int)
    splits: wp.array(dtype=wp.float32)
    children: wp.array(dtype=int)


@wp.struct
class CellView:
    """What a cell has learned.

    bsdf_share: share of BSDF sampling in the mixture with the guide; tail_worth, shadow_ray_worth: what these are
    expected to bring, per root of their cost.
    """

    bsdf_share: float
    tail_worth: float
    shadow_ray_worth: float


@wp.struct
class VertexRecord:
    """What learning keeps of a vertex.

    x, n: position and shading normal; u, v: its direction in the guide's square; used: 0 where there was no vertex.

    jacobian: 1 / the direction's density over the square.

    radiance: that which arrives along the direction; while the path lasts, the luminance gathered before it.
    throughput: what the path carries behind the vertex; tail: f cos / p_a, and F^2 once the path has ended.

    light: the squared luminance of the light sample's contribution; cost: of the tail's rays, while the path lasts of
    those before it.
    """

    x: wp.vec3
    n: wp.vec3
    u: float
    v: float
    used: int
    jacobian: float
    radiance: float
    throughput: float
    tail: float
    light: float
    cost: float


@wp.struct
class CacheView:
    """The spatial cache, as far as it has been learned, and where the vertices of a round that learns are recorded.

    shares: of the strategies, where a mixture draws directions at every vertex: S a cell.
    densities: of the guide, GUIDE_NODES a cell, the coarsest level first, nodes in Morton order.
    pixel_worth: what radiance is worth in each pixel: the strength of all rates over the pixel's expected luminance.
    records: `vertices` a path, of `samples` paths from `first_sample` on, in the first pixel of each cell of
    record_stride x record_stride pixels of a picture of this width; ratios: p_s / p_a of each strategy that draws
    directions, as many a record.
    """

    tree: CellTreeView
    cells: wp.array(dtype=CellView)
    shares: wp.array(dtype=wp.float32)
    densities: wp.array(dtype=wp.float32)
    pixel_worth: wp.array(dtype=wp.float32)
    records: wp.array(dtype=VertexRecord)
    ratios: wp.array(dtype=wp.float32)
    width: int
    record_stride: int
    vertices: int
    first_sample: int
    samples: int
