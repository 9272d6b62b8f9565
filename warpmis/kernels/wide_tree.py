"""Rays through a tree of eight boxes a node and eight triangles a leaf, all eight tested at once.

A vector of eight floats is what a CPU's SIMD registers hold, and the compiler keeps it there as long as all eight go
the same way (kernels/lanes.py). For incoherent rays a wide node is the way to use them (Dammertz, Hanika, Keller 2008,
"Shallow Bounding Volume Hierarchies for Fast SIMD Ray Tracing of Incoherent Rays"). On a GPU, whose threads are its
SIMD lanes, Warp's own tree of two boxes a node serves.

No ray slips through the seam between two triangles: the signs of the edge functions decide, two triangles compute
exactly opposite ones for their common edge, and where one is 0 a second look in double precision decides (Woop,
Benthin, Wald 2013, "Watertight Ray/Triangle Intersection", JCGT 2(1)).
"""

import warp as wp

from warpmis.device.views import WideTreeView
from warpmis.kernels.lanes import first_set_bit, mask_less_equal, max8, min8, splat8

wp.set_module_options({"enable_backward": False})

# Nodes and leaves still to be visited, and levels; device/wide_tree.py builds no tree that needs more.
STACK_SIZE = 128
LEVELS = 20
stack_of_nodes = wp.types.vector(length=STACK_SIZE, dtype=wp.int32)
stack_of_distances = wp.types.vector(length=STACK_SIZE, dtype=wp.float32)
stack_of_levels = wp.types.vector(length=LEVELS, dtype=wp.int32)

# Components of a direction count as no smaller, so that their inverses are finite.
MIN_COMPONENT = wp.constant(1.0e-20)

# Triangles whose area across the ray is a smaller share of their size squared are looked at in double precision.
THIN_TRIANGLE = wp.constant(0.01)

# In place of a triangle's row.
NO_FACE = wp.constant(-1)


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
class TriangleHit:
    """The closest triangle: NO_FACE where there is none; u and v weigh its first two corners."""

    distance: float
    face: int
    u: float
    v: float


@wp.func
def slab_ray(origin: wp.vec3, direction: wp.vec3) -> SlabRay:
    ray = SlabRay()
    ray.origin = origin
    for axis in range(3):
        d = direction[axis]
        if wp.abs(d) < MIN_COMPONENT:
            d = MIN_COMPONENT
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
def intersect_boxes(tree: WideTreeView, node: int, ray: SlabRay, reach: float):
    """A mask of the node's boxes that the ray enters nearer than `reach`, and the distances at which it does."""
    x = splat8(ray.origin[0])
    y = splat8(ray.origin[1])
    z = splat8(ray.origin[2])
    row = 6 * node
    near_x = (tree.bounds[row + ray.far[0]] - x) * ray.inverse[0]
    far_x = (tree.bounds[row + 1 - ray.far[0]] - x) * ray.inverse[0]
    near_y = (tree.bounds[row + 2 + ray.far[1]] - y) * ray.inverse[1]
    far_y = (tree.bounds[row + 3 - ray.far[1]] - y) * ray.inverse[1]
    near_z = (tree.bounds[row + 4 + ray.far[2]] - z) * ray.inverse[2]
    far_z = (tree.bounds[row + 5 - ray.far[2]] - z) * ray.inverse[2]
    near = max8(max8(near_x, near_y), max8(near_z, splat8(0.0)))
    far = min8(min8(far_x, far_y), min8(far_z, splat8(reach)))
    return mask_less_equal(near, far), near


@wp.func
def intersect_triangles(tree: WideTreeView, leaf: int, ray: SlabRay, reach: float):
    """Two masks of the leaf's triangles, and the distances and the weights of the first two corners of all eight.

    The first mask has those that the ray hits nearer than `reach`. The second has those that need double precision. In
    these an edge function is 0, so that its sign decides nothing; or the triangle is thin as seen along the ray, so
    that rounding decides the edge functions.
    """
    x = splat8(ray.origin[ray.kx])
    y = splat8(ray.origin[ray.ky])
    z = splat8(ray.origin[ray.kz])
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
    zero = splat8(0.0)
    lowest = min8(min8(u, v), w)
    highest = max8(max8(u, v), w)
    is_inside = mask_less_equal(min8(-lowest, highest), zero)
    total = u + v + w
    least = min8(min8(wp.abs(u), wp.abs(v)), wp.abs(w))
    across = max8(max8(wp.abs(ax), wp.abs(bx)), wp.abs(cx))
    up = max8(max8(wp.abs(ay), wp.abs(by)), wp.abs(cy))
    size = max8(across, up)
    is_thin = mask_less_equal(wp.abs(total), wp.cw_mul(size, size) * THIN_TRIANGLE)
    needs_exact = is_inside & (mask_less_equal(least, zero) | is_thin)
    scale = wp.cw_div(splat8(1.0), total)
    distance = wp.cw_mul((wp.cw_mul(u, az) + wp.cw_mul(v, bz) + wp.cw_mul(w, cz)) * ray.sz, scale)
    is_in_reach = mask_less_equal(zero, distance) & ~mask_less_equal(splat8(reach), distance)
    is_hit = is_inside & is_in_reach & ~needs_exact
    return is_hit, needs_exact, distance, wp.cw_mul(u, scale), wp.cw_mul(v, scale)


@wp.func
def sheared(tree: WideTreeView, row: int, i: int, ray: SlabRay) -> wp.vec2d:
    """A corner of a triangle in the plane in which the ray is a point."""
    z = tree.corners[row + ray.kz][i] - ray.origin[ray.kz]
    x = tree.corners[row + ray.kx][i] - ray.origin[ray.kx] - z * ray.sx
    y = tree.corners[row + ray.ky][i] - ray.origin[ray.ky] - z * ray.sy
    return wp.vec2d(wp.float64(x), wp.float64(y))


@wp.func
def edge_functions_exactly(tree: WideTreeView, row: int, i: int, ray: SlabRay) -> wp.vec3:
    a = sheared(tree, row, i, ray)
    b = sheared(tree, row + 3, i, ray)
    c = sheared(tree, row + 6, i, ray)
    u = c[0] * b[1] - c[1] * b[0]
    v = a[0] * c[1] - a[1] * c[0]
    w = b[0] * a[1] - b[1] * a[0]
    return wp.vec3(float(u), float(v), float(w))


@wp.func
def intersect_exactly(tree: WideTreeView, leaf: int, i: int, ray: SlabRay) -> TriangleHit:
    """Where the ray crosses a triangle that it may meet; NO_FACE where double precision shows that it does not."""
    found = TriangleHit()
    found.face = NO_FACE
    row = 9 * leaf
    edges = edge_functions_exactly(tree, row, i, ray)
    total = edges[0] + edges[1] + edges[2]
    if total == 0.0 or (wp.min(edges) < 0.0 and wp.max(edges) > 0.0):
        return found
    depths = wp.vec3(
        tree.corners[row + ray.kz][i], tree.corners[row + 3 + ray.kz][i], tree.corners[row + 6 + ray.kz][i]
    )
    depths -= wp.vec3(1.0, 1.0, 1.0) * ray.origin[ray.kz]
    scale = 1.0 / total
    found.distance = wp.dot(edges, depths) * ray.sz * scale
    if found.distance >= 0.0:
        found.face = tree.faces[8 * leaf + i]
        found.u = edges[0] * scale
        found.v = edges[1] * scale
    return found


@wp.func
def closest_in_leaf(tree: WideTreeView, leaf: int, ray: SlabRay, found: TriangleHit) -> TriangleHit:
    """The closest triangle of the leaf, if it is nearer than what was found before; else that."""
    mask, needs_exact, distances, u, v = intersect_triangles(tree, leaf, ray, found.distance)
    while mask != 0:
        i = first_set_bit(mask)
        mask = mask & (mask - 1)
        if distances[i] < found.distance:
            found.distance = distances[i]
            found.face = tree.faces[8 * leaf + i]
            found.u = u[i]
            found.v = v[i]
    while needs_exact != 0:
        here = intersect_exactly(tree, leaf, first_set_bit(needs_exact), ray)
        needs_exact = needs_exact & (needs_exact - 1)
        if here.face != NO_FACE and here.distance < found.distance:
            found = here
    return found


@wp.func
def closest_in_tree(tree: WideTreeView, root: int, origin: wp.vec3, direction: wp.vec3, reach: float) -> TriangleHit:
    """The closest triangle nearer than `reach`, in units of the direction's length."""
    found = TriangleHit()
    found.face = NO_FACE
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
            mask, near = intersect_boxes(tree, node, ray, found.distance)
            first = size
            while mask != 0:
                i = first_set_bit(mask)
                mask = mask & (mask - 1)
                # The nearest last, since that is the next to be visited.
                place = size
                while place > first and distances[place - 1] < near[i]:
                    distances[place] = distances[place - 1]
                    nodes[place] = nodes[place - 1]
                    place -= 1
                distances[place] = near[i]
                nodes[place] = tree.children[8 * node + i]
                size += 1
        else:
            found = closest_in_leaf(tree, -1 - node, ray, found)
    return found


@wp.func
def any_in_tree(tree: WideTreeView, root: int, origin: wp.vec3, direction: wp.vec3, reach: float) -> bool:
    """Whether there is any triangle nearer than `reach`."""
    no_hit = TriangleHit()
    no_hit.face = NO_FACE
    no_hit.distance = reach
    ray = slab_ray(origin, direction)
    # Of each node on the way here, the boxes that are still to be visited.
    nodes = stack_of_levels()
    masks = stack_of_levels()
    level = int(0)
    node = int(root)
    mask, _near = intersect_boxes(tree, node, ray, reach)
    while True:
        if mask != 0:
            child = tree.children[8 * node + first_set_bit(mask)]
            mask = mask & (mask - 1)
            if child >= 0:
                nodes[level] = node
                masks[level] = mask
                level += 1
                node = child
                mask, _near = intersect_boxes(tree, node, ray, reach)
            elif closest_in_leaf(tree, -1 - child, ray, no_hit).face != NO_FACE:
                return True
        elif level > 0:
            level -= 1
            node = nodes[level]
            mask = masks[level]
        else:
            return False
