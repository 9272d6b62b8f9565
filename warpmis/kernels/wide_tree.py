"""Rays through a tree of eight boxes a node and eight triangles a leaf, all eight tested at once.

A vector of eight floats is what a CPU's SIMD registers hold, and the compiler keeps it there. For incoherent rays a
wide node is the way to use them (Dammertz, Hanika, Keller 2008, "Shallow Bounding Volume Hierarchies for Fast SIMD Ray
Tracing of Incoherent Rays"). On a GPU, whose threads are its SIMD lanes, Warp's own tree of two boxes a node serves.

No ray slips through the seam between two triangles: the signs of the edge functions decide, two triangles compute
exactly opposite ones for their common edge, and where one is 0 a second look in double precision decides (Woop,
Benthin, Wald 2013, "Watertight Ray/Triangle Intersection", JCGT 2(1)).
"""

import warp as wp

from warpmis.device.views import WideTreeView, vec8f

wp.set_module_options({"enable_backward": False})

# Nodes and leaves still to be visited; device/wide_tree.py builds no tree that needs more.
STACK_SIZE = 128
stack_of_nodes = wp.types.vector(length=STACK_SIZE, dtype=wp.int32)
stack_of_distances = wp.types.vector(length=STACK_SIZE, dtype=wp.float32)

# Components of a direction count as no smaller, so that their inverses are finite.
LEAST = wp.constant(1.0e-20)

# Triangles whose area across the ray is a smaller share of their size squared are looked at in double precision.
THIN = wp.constant(0.01)


@wp.struct
class SlabRay:
    """A ray, and what its tests need of it.

    inverse: of its direction; far: per axis 1 where the lower of two planes is the farther one; kx, ky, kz: the axes,
    the direction's largest component last; sx, sy, sz: the shear that turns the ray into +z.
    """

    origin: wp.vec3
    inverse: wp.vec3
    far: wp.vec3i
    kx: int
    ky: int
    kz: int
    sx: float
    sy: float
    sz: float


@wp.struct
class Nearest:
    """The closest triangle: face -1 where there is none; u and v weigh its first two corners."""

    distance: float
    face: int
    u: float
    v: float


@wp.func
def all_eight(x: float) -> vec8f:
    return vec8f(x, x, x, x, x, x, x, x)


@wp.func
def lowest_bit(mask: int) -> int:
    """The place of the lowest 1 in a mask that is not 0: the exponent of that bit as a float."""
    return (wp.cast(float(mask & -mask), wp.int32) >> 23) - 127


@wp.func
def slab_ray(origin: wp.vec3, direction: wp.vec3) -> SlabRay:
    ray = SlabRay()
    ray.origin = origin
    for axis in range(3):
        d = direction[axis]
        if wp.abs(d) < LEAST:
            d = LEAST
        ray.inverse[axis] = 1.0 / d
        ray.far[axis] = wp.where(d < 0.0, 1, 0)
    if wp.abs(direction[1]) > wp.abs(direction[0]):
        ray.kz = 1
    if wp.abs(direction[2]) > wp.abs(direction[ray.kz]):
        ray.kz = 2
    ray.kx = wp.where(ray.kz == 2, 0, ray.kz + 1)
    ray.ky = wp.where(ray.kx == 2, 0, ray.kx + 1)
    ray.sz = 1.0 / direction[ray.kz]
    ray.sx = direction[ray.kx] * ray.sz
    ray.sy = direction[ray.ky] * ray.sz
    return ray


@wp.func
def boxes_met(tree: WideTreeView, node: int, ray: SlabRay, reach: float):
    """A mask of the node's boxes that the ray meets nearer than `reach`, and at which distances."""
    x = all_eight(ray.origin[0])
    y = all_eight(ray.origin[1])
    z = all_eight(ray.origin[2])
    row = 6 * node
    near_x = (tree.bounds[row + ray.far[0]] - x) * ray.inverse[0]
    far_x = (tree.bounds[row + 1 - ray.far[0]] - x) * ray.inverse[0]
    near_y = (tree.bounds[row + 2 + ray.far[1]] - y) * ray.inverse[1]
    far_y = (tree.bounds[row + 3 - ray.far[1]] - y) * ray.inverse[1]
    near_z = (tree.bounds[row + 4 + ray.far[2]] - z) * ray.inverse[2]
    far_z = (tree.bounds[row + 5 - ray.far[2]] - z) * ray.inverse[2]
    near = wp.max(wp.max(near_x, near_y), wp.max(near_z, all_eight(0.0)))
    far = wp.min(wp.min(far_x, far_y), wp.min(far_z, all_eight(reach)))
    mask = int(0)
    for i in range(8):
        mask += wp.where(near[i] <= far[i], 1 << i, 0)
    return mask, near


@wp.func
def triangles_met(tree: WideTreeView, leaf: int, ray: SlabRay):
    """A mask of the leaf's triangles on which the ray's line is inside or on an edge, and for all of them the edge
    functions of the three corners, and how far from the line the corners are at most, along two axes."""
    x = all_eight(ray.origin[ray.kx])
    y = all_eight(ray.origin[ray.ky])
    z = all_eight(ray.origin[ray.kz])
    row = 9 * leaf
    az = tree.corners[row + ray.kz] - z
    bz = tree.corners[row + 3 + ray.kz] - z
    cz = tree.corners[row + 6 + ray.kz] - z
    ax = tree.corners[row + ray.kx] - x - az * ray.sx
    ay = tree.corners[row + ray.ky] - y - az * ray.sy
    bx = tree.corners[row + 3 + ray.kx] - x - bz * ray.sx
    by = tree.corners[row + 3 + ray.ky] - y - bz * ray.sy
    cx = tree.corners[row + 6 + ray.kx] - x - cz * ray.sx
    cy = tree.corners[row + 6 + ray.ky] - y - cz * ray.sy
    u = wp.cw_mul(cx, by) - wp.cw_mul(cy, bx)
    v = wp.cw_mul(ax, cy) - wp.cw_mul(ay, cx)
    w = wp.cw_mul(bx, ay) - wp.cw_mul(by, ax)
    lowest = wp.min(wp.min(u, v), w)
    highest = wp.max(wp.max(u, v), w)
    mask = int(0)
    for i in range(8):
        mask += wp.where(wp.min(-lowest[i], highest[i]) <= 0.0, 1 << i, 0)
    across = wp.max(wp.max(wp.abs(ax), wp.abs(bx)), wp.abs(cx))
    up = wp.max(wp.max(wp.abs(ay), wp.abs(by)), wp.abs(cy))
    return mask, u, v, w, wp.max(across, up)


@wp.func
def sheared(tree: WideTreeView, row: int, i: int, ray: SlabRay) -> wp.vec2d:
    """A corner of a triangle in the plane in which the ray is a point."""
    z = tree.corners[row + ray.kz][i] - ray.origin[ray.kz]
    x = tree.corners[row + ray.kx][i] - ray.origin[ray.kx] - z * ray.sx
    y = tree.corners[row + ray.ky][i] - ray.origin[ray.ky] - z * ray.sy
    return wp.vec2d(wp.float64(x), wp.float64(y))


@wp.func
def edges_exactly(tree: WideTreeView, row: int, i: int, ray: SlabRay) -> wp.vec3:
    a = sheared(tree, row, i, ray)
    b = sheared(tree, row + 3, i, ray)
    c = sheared(tree, row + 6, i, ray)
    u = c[0] * b[1] - c[1] * b[0]
    v = a[0] * c[1] - a[1] * c[0]
    w = b[0] * a[1] - b[1] * a[0]
    return wp.vec3(float(u), float(v), float(w))


@wp.func
def crossing(tree: WideTreeView, leaf: int, i: int, ray: SlabRay, edges: wp.vec3, size: float) -> Nearest:
    """Where the ray's line crosses a triangle of the mask; face -1 where a second look finds that it does not.

    The signs of `edges` have decided, unless one of them is 0. But of needles, or in a grazing view, they are what
    rounding has left of products near `size` squared, and no weights to interpolate by.
    """
    found = Nearest()
    found.face = -1
    row = 9 * leaf
    total = edges[0] + edges[1] + edges[2]
    is_in_doubt = edges[0] == 0.0 or edges[1] == 0.0 or edges[2] == 0.0
    if is_in_doubt or wp.abs(total) < THIN * size * size:
        edges = edges_exactly(tree, row, i, ray)
        total = edges[0] + edges[1] + edges[2]
        if total == 0.0 or (is_in_doubt and wp.min(edges) < 0.0 and wp.max(edges) > 0.0):
            return found
    depths = wp.vec3(
        tree.corners[row + ray.kz][i], tree.corners[row + 3 + ray.kz][i], tree.corners[row + 6 + ray.kz][i]
    )
    depths -= wp.vec3(1.0, 1.0, 1.0) * ray.origin[ray.kz]
    scale = 1.0 / total
    found.distance = wp.dot(edges, depths) * ray.sz * scale
    if found.distance >= 0.0:
        found.face = tree.faces[leaf][i]
        found.u = edges[0] * scale
        found.v = edges[1] * scale
    return found


@wp.func
def nearest_in_tree(tree: WideTreeView, root: int, origin: wp.vec3, direction: wp.vec3, reach: float) -> Nearest:
    """The closest triangle nearer than `reach`, in units of the direction's length."""
    found = Nearest()
    found.face = -1
    found.distance = reach
    ray = slab_ray(origin, direction)
    nodes = stack_of_nodes()
    distances = stack_of_distances()
    nodes[0] = root
    size = int(1)
    while size > 0:
        size -= 1
        if distances[size] >= found.distance:
            continue
        node = nodes[size]
        if node >= 0:
            mask, near = boxes_met(tree, node, ray, found.distance)
            children = tree.children[node]
            first = size
            while mask != 0:
                i = lowest_bit(mask)
                mask = mask & (mask - 1)
                # The nearest last, since that is the next to be visited.
                place = size
                while place > first and distances[place - 1] < near[i]:
                    distances[place] = distances[place - 1]
                    nodes[place] = nodes[place - 1]
                    place -= 1
                distances[place] = near[i]
                nodes[place] = children[i]
                size += 1
        else:
            leaf = -1 - node
            mask, u, v, w, spans = triangles_met(tree, leaf, ray)
            while mask != 0:
                i = lowest_bit(mask)
                mask = mask & (mask - 1)
                here = crossing(tree, leaf, i, ray, wp.vec3(u[i], v[i], w[i]), spans[i])
                if here.face >= 0 and here.distance < found.distance:
                    found = here
    return found


@wp.func
def is_met_in_tree(tree: WideTreeView, root: int, origin: wp.vec3, direction: wp.vec3, reach: float) -> bool:
    """Whether there is any triangle nearer than `reach`."""
    ray = slab_ray(origin, direction)
    nodes = stack_of_nodes()
    nodes[0] = root
    size = int(1)
    while size > 0:
        size -= 1
        node = nodes[size]
        if node >= 0:
            mask, _near = boxes_met(tree, node, ray, reach)
            children = tree.children[node]
            while mask != 0:
                nodes[size] = children[lowest_bit(mask)]
                mask = mask & (mask - 1)
                size += 1
        else:
            leaf = -1 - node
            mask, u, v, w, spans = triangles_met(tree, leaf, ray)
            while mask != 0:
                i = lowest_bit(mask)
                mask = mask & (mask - 1)
                here = crossing(tree, leaf, i, ray, wp.vec3(u[i], v[i], w[i]), spans[i])
                if here.face >= 0 and here.distance < reach:
                    return True
    return False
