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

from warpmis.device.views import SceneView, WideTreeView
from warpmis.kernels.lanes import first_set_bit, lane_of_row, mask_less_equal, max8, min8, row8, splat8

wp.set_module_options({"enable_backward": False})

# Nodes and leaves still to be visited; device/wide_tree.py builds no tree that needs more.
STACK_SIZE = 128
stack_of_nodes = wp.types.vector(length=STACK_SIZE, dtype=wp.int32)
stack_of_distances = wp.types.vector(length=STACK_SIZE, dtype=wp.float32)

# In place of a node or a leaf: all have been visited.
NO_NODE = wp.constant(0x7FFFFFFF)

# What a ray meets on its way: no surface; some that may let light through; one at least that lets none through.
OPEN = wp.constant(0)
VEILED = wp.constant(1)
BLOCKED = wp.constant(2)

# Components of a direction count as no smaller, so that their inverses are finite.
MIN_COMPONENT = wp.constant(1.0e-20)

# Triangles whose area across the ray is a smaller share of their size squared are looked at in double precision.
THIN_TRIANGLE = wp.constant(0.01)

# In place of a triangle's row, and of its place in a leaf.
NO_FACE = wp.constant(-1)
NO_SLOT = wp.constant(-1)


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
    """The closest triangle: NO_FACE where there is none; u and v weigh its first two corners.

    slot: of a triangle in a wide tree, its place in a leaf, eight places a leaf.
    """

    distance: float
    face: int
    slot: int
    u: float
    v: float


@wp.func_native("""
    const char* start = child >= 0 ? (const char*)(tree.bounds.data + 6 * (size_t)child)
                                   : (const char*)(tree.corners.data + 9 * (size_t)(-1 - child));
    const int lines = child >= 0 ? 3 : 5;
    for (int i = 0; i < lines; ++i)
        __builtin_prefetch(start + 64 * i);
""")
def prefetch_child(tree: WideTreeView, child: int):
    """Have the memory of a node's boxes or a leaf's triangles on its way before it is needed."""
    ...


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
def intersect_boxes(tree: WideTreeView, node: int, ray: wp.ref[SlabRay], reach: float):
    """A mask of the node's boxes that the ray enters nearer than `reach`, and the distances at which it does."""
    x = splat8(ray.origin[0])
    y = splat8(ray.origin[1])
    z = splat8(ray.origin[2])
    row = 6 * node
    near_x = (row8(tree.bounds, row + ray.far[0]) - x) * ray.inverse[0]
    far_x = (row8(tree.bounds, row + 1 - ray.far[0]) - x) * ray.inverse[0]
    near_y = (row8(tree.bounds, row + 2 + ray.far[1]) - y) * ray.inverse[1]
    far_y = (row8(tree.bounds, row + 3 - ray.far[1]) - y) * ray.inverse[1]
    near_z = (row8(tree.bounds, row + 4 + ray.far[2]) - z) * ray.inverse[2]
    far_z = (row8(tree.bounds, row + 5 - ray.far[2]) - z) * ray.inverse[2]
    near = max8(max8(near_x, near_y), max8(near_z, splat8(0.0)))
    far = min8(min8(far_x, far_y), min8(far_z, splat8(reach)))
    return mask_less_equal(near, far), near


@wp.func
def intersect_triangles(tree: WideTreeView, leaf: int, ray: wp.ref[SlabRay], reach: float):
    """Two masks of the leaf's triangles, and the distances and the weights of the first two corners of all eight.

    The first mask has those that the ray hits nearer than `reach`. The second has those that need double precision. In
    these an edge function is 0, so that its sign decides nothing; or the triangle is thin as seen along the ray, so
    that rounding decides the edge functions.
    """
    x = splat8(ray.origin[ray.kx])
    y = splat8(ray.origin[ray.ky])
    z = splat8(ray.origin[ray.kz])
    row = 9 * leaf
    az = row8(tree.corners, row + ray.kz) - z
    bz = row8(tree.corners, row + 3 + ray.kz) - z
    cz = row8(tree.corners, row + 6 + ray.kz) - z
    ax = row8(tree.corners, row + ray.kx) - x - az * ray.sx
    ay = row8(tree.corners, row + ray.ky) - y - az * ray.sy
    bx = row8(tree.corners, row + 3 + ray.kx) - x - bz * ray.sx
    by = row8(tree.corners, row + 3 + ray.ky) - y - bz * ray.sy
    cx = row8(tree.corners, row + 6 + ray.kx) - x - cz * ray.sx
    cy = row8(tree.corners, row + 6 + ray.ky) - y - cz * ray.sy
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
def corner_in_tree(tree: WideTreeView, slot: int, corner: int) -> wp.vec3:
    """A corner, from 0 to 2, of the triangle in the slot."""
    row = 9 * (slot >> 3) + 3 * corner
    lane = slot & 7
    return wp.vec3(
        lane_of_row(tree.corners, row, lane),
        lane_of_row(tree.corners, row + 1, lane),
        lane_of_row(tree.corners, row + 2, lane),
    )


@wp.func
def sheared(tree: WideTreeView, row: int, i: int, ray: wp.ref[SlabRay]) -> wp.vec2d:
    """A corner of a triangle in the plane in which the ray is a point."""
    z = lane_of_row(tree.corners, row + ray.kz, i) - ray.origin[ray.kz]
    x = lane_of_row(tree.corners, row + ray.kx, i) - ray.origin[ray.kx] - z * ray.sx
    y = lane_of_row(tree.corners, row + ray.ky, i) - ray.origin[ray.ky] - z * ray.sy
    return wp.vec2d(wp.float64(x), wp.float64(y))


@wp.func
def edge_functions_exactly(tree: WideTreeView, row: int, i: int, ray: wp.ref[SlabRay]) -> wp.vec3:
    a = sheared(tree, row, i, ray)
    b = sheared(tree, row + 3, i, ray)
    c = sheared(tree, row + 6, i, ray)
    u = c[0] * b[1] - c[1] * b[0]
    v = a[0] * c[1] - a[1] * c[0]
    w = b[0] * a[1] - b[1] * a[0]
    return wp.vec3(float(u), float(v), float(w))


@wp.func
def intersect_exactly(tree: WideTreeView, leaf: int, i: int, ray: wp.ref[SlabRay]) -> TriangleHit:
    """Where the ray crosses a triangle that it may meet; NO_SLOT where double precision shows that it does not."""
    found = TriangleHit()
    found.slot = NO_SLOT
    row = 9 * leaf
    edges = edge_functions_exactly(tree, row, i, ray)
    total = edges[0] + edges[1] + edges[2]
    if total == 0.0 or (wp.min(edges) < 0.0 and wp.max(edges) > 0.0):
        return found
    depths = wp.vec3(
        lane_of_row(tree.corners, row + ray.kz, i),
        lane_of_row(tree.corners, row + 3 + ray.kz, i),
        lane_of_row(tree.corners, row + 6 + ray.kz, i),
    )
    depths -= wp.vec3(1.0, 1.0, 1.0) * ray.origin[ray.kz]
    scale = 1.0 / total
    found.distance = wp.dot(edges, depths) * ray.sz * scale
    if found.distance >= 0.0:
        found.slot = 8 * leaf + i
        found.u = edges[0] * scale
        found.v = edges[1] * scale
    return found


@wp.func
def closest_in_leaf(tree: WideTreeView, leaf: int, ray: wp.ref[SlabRay], found: wp.ref[TriangleHit]):
    """Replaces `found` by the closest triangle of the leaf, if that is nearer."""
    mask, needs_exact, distances, u, v = intersect_triangles(tree, leaf, ray, found.distance)
    while mask != 0:
        i = first_set_bit(mask)
        mask = mask & (mask - 1)
        if distances[i] < found.distance:
            found.distance = distances[i]
            found.slot = 8 * leaf + i
            found.u = u[i]
            found.v = v[i]
    while needs_exact != 0:
        here = intersect_exactly(tree, leaf, first_set_bit(needs_exact), ray)
        needs_exact = needs_exact & (needs_exact - 1)
        if here.slot != NO_SLOT and here.distance < found.distance:
            found.distance = here.distance
            found.slot = here.slot
            found.u = here.u
            found.v = here.v


@wp.func
def closest_in_tree(tree: WideTreeView, root: int, origin: wp.vec3, direction: wp.vec3, reach: float) -> TriangleHit:
    """The closest triangle nearer than `reach`, in units of the direction's length."""
    found = TriangleHit()
    found.face = NO_FACE
    found.slot = NO_SLOT
    found.distance = reach
    ray = slab_ray(origin, direction)
    # Nodes and leaves that the ray enters and has not visited, the nearest of a node's on top, and where it enters.
    waiting = stack_of_nodes()
    distances = stack_of_distances()
    count = int(0)
    node = int(root)
    while node != NO_NODE:
        nearest = int(NO_NODE)
        if node >= 0:
            mask, near = intersect_boxes(tree, node, ray, found.distance)
            if mask != 0:
                # Most rays that enter a node enter one of its boxes, whose child goes past the stack.
                lane = first_set_bit(mask)
                mask = mask & (mask - 1)
                nearest = tree.children[8 * node + lane]
                distance = near[lane]
                prefetch_child(tree, nearest)
                first = count
                while mask != 0:
                    lane = first_set_bit(mask)
                    mask = mask & (mask - 1)
                    child = tree.children[8 * node + lane]
                    prefetch_child(tree, child)
                    is_nearer = near[lane] <= distance
                    farther = wp.where(is_nearer, nearest, child)
                    farther_distance = wp.where(is_nearer, distance, near[lane])
                    nearest = wp.where(is_nearer, child, nearest)
                    distance = wp.where(is_nearer, near[lane], distance)
                    place = count
                    while place > first and distances[place - 1] < farther_distance:
                        distances[place] = distances[place - 1]
                        waiting[place] = waiting[place - 1]
                        place -= 1
                    distances[place] = farther_distance
                    waiting[place] = farther
                    count += 1
        else:
            closest_in_leaf(tree, -1 - node, ray, found)
        while nearest == NO_NODE and count > 0:
            count -= 1
            if distances[count] < found.distance:
                nearest = waiting[count]
        node = nearest
    if found.slot != NO_SLOT:
        found.face = tree.faces[found.slot]
    return found


def make_occlusion_in_tree(blocks: wp.Function) -> wp.Function:
    """A function for what is between the ends of a segment: OPEN, VEILED or BLOCKED.

    blocks(scene, light, instance, face): whether a triangle lets no light through, wherever it is met.
    """

    @wp.func
    def occlusion_in_tree(
        scene: SceneView, light: int, instance: int, root: int, origin: wp.vec3, direction: wp.vec3, reach: float
    ) -> int:
        occlusion = int(OPEN)
        found = TriangleHit()
        found.slot = NO_SLOT
        found.distance = reach
        ray = slab_ray(origin, direction)
        waiting = stack_of_nodes()
        count = int(0)
        node = int(root)
        while node != NO_NODE:
            child = int(NO_NODE)
            if node >= 0:
                mask, _near = intersect_boxes(scene.tree, node, ray, reach)
                if mask != 0:
                    child = scene.tree.children[8 * node + first_set_bit(mask)]
                    mask = mask & (mask - 1)
                    prefetch_child(scene.tree, child)
                    while mask != 0:
                        other = scene.tree.children[8 * node + first_set_bit(mask)]
                        mask = mask & (mask - 1)
                        prefetch_child(scene.tree, other)
                        waiting[count] = other
                        count += 1
            else:
                closest_in_leaf(scene.tree, -1 - node, ray, found)
                if found.slot != NO_SLOT:
                    occlusion = VEILED
                    if blocks(scene, light, instance, scene.tree.faces[found.slot]):
                        occlusion = BLOCKED
                        count = 0
                    found.slot = NO_SLOT
                    found.distance = reach
            if child == NO_NODE and count > 0:
                count -= 1
                child = waiting[count]
            node = child
        return occlusion

    return occlusion_in_tree
