"""The closest surface along a ray, among the triangles in world space."""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import SceneView
from warpmis.kernels.light.distant import INFINITE_DISTANCE
from warpmis.kernels.shading_frame import max_abs
from warpmis.kernels.wide_tree import NO_FACE, TriangleHit, closest_in_tree, corner_in_tree
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})

# A new ray starts this share of the triangle's largest coordinate off the surface: twice the smallest at which no ray
# met its own triangle again (tests/unit/test_intersect.py). Larger ones shift the light: a floor 100 units wide was
# 0.07 % too bright at 4e-6.
OFFSET = wp.constant(5.0e-7)

# Points where rays meet a triangle are kept this many such offsets away from its edges (where its sides are alike): one
# on the edge itself lies in the neighbour's plane, and the next ray would start on that plane, or behind it.
INSET = wp.constant(8.0)
MAX_INSET = wp.constant(0.125)

# In place of a row of SceneView.instances.
NO_INSTANCE = wp.constant(-1)


@wp.struct
class Hit:
    """The closest surface: distance INFINITE_DISTANCE where there is none.

    triangle: row of SceneView.triangles; instance: row of SceneView.instances, or NO_INSTANCE for a triangle in world
    space. ng: unit geometric normal on the side of the ray's origin; is_front: whether that is the triangle's front.
    offset: how far off the surface a ray starts. u, v: weights of the first two corners.
    """

    distance: float
    triangle: int
    instance: int
    is_front: bool
    p: wp.vec3
    ng: wp.vec3
    offset: float
    u: float
    v: float


@wp.func
def inner_point(p0: wp.vec3, p1: wp.vec3, p2: wp.vec3, u: float, v: float, inset: float) -> wp.vec3:
    """The point of a triangle with the weights u, v, 1 - u - v, none of which may be less than `inset`.

    Interpolating keeps the point on the triangle, which origin + distance * wi would not.
    """
    u_in = wp.max(u, inset)
    v_in = wp.max(v, inset)
    w_in = wp.max(1.0 - u - v, inset)
    return (p0 * u_in + p1 * v_in + p2 * w_in) / (u_in + v_in + w_in)


@wp.func
def inset_of(e1: wp.vec3, e2: wp.vec3, offset: float) -> float:
    """The least weight of a corner, of a triangle with these edges off which rays start by `offset`."""
    return wp.min(INSET * offset / wp.max(max_abs(e1), max_abs(e2)), MAX_INSET)


@wp.func
def face_forward(hit: Hit, ng: wp.vec3, wi: wp.vec3) -> Hit:
    """The hit with the normal of its triangle's front, turned to the side of the ray's origin."""
    hit.is_front = True
    if wp.dot(ng, wi) > 0.0:
        ng = -ng
        hit.is_front = False
    hit.ng = ng
    return hit


@wp.func
def closest_in_mesh(
    scene: SceneView, mesh: wp.uint64, root: int, origin: wp.vec3, wi: wp.vec3, reach: float
) -> TriangleHit:
    found = TriangleHit()
    found.face = NO_FACE
    found.distance = reach
    query = wp.mesh_query_ray(mesh, origin, wi, reach)
    if query.result:
        found.distance = query.t
        found.face = query.face
        found.u = query.u
        found.v = query.v
    return found


@wp.func
def closest_in_wide_tree(
    scene: SceneView, mesh: wp.uint64, root: int, origin: wp.vec3, wi: wp.vec3, reach: float
) -> TriangleHit:
    return closest_in_tree(scene.tree, root, origin, wi, reach)


@wp.func
def corner_in_mesh(scene: SceneView, triangle: int, slot: int, corner: int) -> wp.vec3:
    return scene.points[scene.indices[triangle][corner]]


@wp.func
def corner_in_wide_tree(scene: SceneView, triangle: int, slot: int, corner: int) -> wp.vec3:
    """From the leaf, which the ray has just read: the triangle's row and its points are rarely in a CPU's cache."""
    return corner_in_tree(scene.tree, slot, corner)


def make_hit(features: Features) -> SimpleNamespace:
    """Functions for the kind of tree in `features`: closest, of one mesh; corner, of a triangle that was found, in the
    space of its mesh; and closest_hit, of the world."""
    wide = features.tree == "wide"
    closest = closest_in_wide_tree if wide else closest_in_mesh
    corner = corner_in_wide_tree if wide else corner_in_mesh

    @wp.func
    def closest_hit(scene: SceneView, origin: wp.vec3, wi: wp.vec3) -> Hit:
        hit = Hit()
        hit.distance = INFINITE_DISTANCE
        hit.instance = NO_INSTANCE
        found = closest(scene, scene.mesh, scene.root, origin, wi, INFINITE_DISTANCE)
        if found.face == NO_FACE:
            return hit
        p0 = corner(scene, found.face, found.slot, 0)
        p1 = corner(scene, found.face, found.slot, 1)
        p2 = corner(scene, found.face, found.slot, 2)
        hit.distance = found.distance
        hit.triangle = found.face
        hit.u = found.u
        hit.v = found.v
        hit.offset = OFFSET * wp.max(max_abs(p0), wp.max(max_abs(p1), max_abs(p2)))
        hit.p = inner_point(p0, p1, p2, found.u, found.v, inset_of(p1 - p0, p2 - p0, hit.offset))
        return face_forward(hit, scene.triangles[found.face].n, wi)

    return SimpleNamespace(closest=closest, corner=corner, closest_hit=closest_hit)
