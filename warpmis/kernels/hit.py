"""The closest surface along a ray, among the triangles that stand in world space."""

import warp as wp

from warpmis.device.views import SceneView
from warpmis.kernels.frame import max_abs, normal_of_edges
from warpmis.kernels.light.distant import INFINITE_DISTANCE

wp.set_module_options({"enable_backward": False})

# A new ray starts this share of the triangle's largest coordinate off the surface: twice the smallest at which no ray
# met its own triangle again (tests/unit/test_intersect.py). Larger ones shift the light: a floor 100 units wide was
# 0.07 % too bright at 4e-6.
OFFSET = wp.constant(5.0e-7)

# Points where rays meet a triangle are kept this many such offsets away from its edges (where its sides are alike): one
# on the edge itself lies in the neighbour's plane, and the next ray would start on that plane, or behind it.
INSET = wp.constant(8.0)
MAX_INSET = wp.constant(0.125)


@wp.struct
class Hit:
    """The closest surface: distance INFINITE_DISTANCE where there is none.

    triangle: row of SceneView.triangles; instance: row of SceneView.instances, or -1 for a triangle in world space. ng
    is the unit geometric normal on the side of the ray's origin, `outside` (1 or 0) whether that is the front.
    """

    distance: float
    triangle: int
    instance: int
    outside: int
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
def facing(hit: Hit, ng: wp.vec3, wi: wp.vec3) -> Hit:
    """The hit with the normal of its triangle's front, turned to the side of the ray's origin."""
    hit.outside = 1
    if wp.dot(ng, wi) > 0.0:
        ng = -ng
        hit.outside = 0
    hit.ng = ng
    return hit


@wp.func
def closest_hit(scene: SceneView, origin: wp.vec3, wi: wp.vec3) -> Hit:
    hit = Hit()
    hit.distance = INFINITE_DISTANCE
    hit.instance = -1
    query = wp.mesh_query_ray(scene.mesh, origin, wi, INFINITE_DISTANCE)
    if not query.result:
        return hit
    corners = scene.indices[query.face]
    p0 = scene.points[corners[0]]
    p1 = scene.points[corners[1]]
    p2 = scene.points[corners[2]]
    hit.distance = query.t
    hit.triangle = query.face
    hit.u = query.u
    hit.v = query.v
    hit.offset = OFFSET * wp.max(max_abs(p0), wp.max(max_abs(p1), max_abs(p2)))
    # Warp's weights: u for the first corner, v for the second.
    hit.p = inner_point(p0, p1, p2, query.u, query.v, inset_of(p1 - p0, p2 - p0, hit.offset))
    return facing(hit, normal_of_edges(p1 - p0, p2 - p0), wi)
