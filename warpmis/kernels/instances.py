"""Rays through the transforms of instances: a tree over their boxes, and the mesh of the prototype in each.

A ray is carried into a prototype's space without making its direction a unit vector again, so that distances along it
stay those of the world.
"""

from types import SimpleNamespace

import warp as wp

from warpmis.device.instance_views import InstanceView
from warpmis.device.views import SceneView
from warpmis.kernels.hit import NO_INSTANCE, OFFSET, Hit, face_forward, inner_point, inset_of
from warpmis.kernels.shading_frame import max_abs
from warpmis.kernels.wide_tree import NO_FACE, TriangleHit

wp.set_module_options({"enable_backward": False})


@wp.struct
class InstanceHit:
    """The closest triangle of all instances: NO_INSTANCE where there is none."""

    instance: int
    triangle: TriangleHit


@wp.func
def nonzero(direction: wp.vec3) -> wp.vec3:
    """The direction with no 0 in it: wp.bvh_query_ray divides by it, and would multiply 0 by infinity."""
    d = direction
    for axis in range(3):
        if d[axis] == 0.0:
            d[axis] = 1.0e-20
    return d


@wp.func
def normal_to_world(scene: SceneView, instance: int, n: wp.vec3) -> wp.vec3:
    """A normal by the inverse transpose, not of unit length: it stays on the front also where the place mirrors."""
    return wp.transpose(scene.instances[instance].inverse) * n


@wp.func
def abs_product(m: wp.mat33, v: wp.vec3) -> wp.vec3:
    """|m| |v|, entry by entry: what float32 rounds in m v is in proportion to it."""
    result = wp.vec3()
    for row in range(3):
        result[row] = wp.abs(m[row, 0] * v[0]) + wp.abs(m[row, 1] * v[1]) + wp.abs(m[row, 2] * v[2])
    return result


@wp.func
def offset_of(instance: InstanceView, p: wp.vec3, n: wp.vec3, n_world: wp.vec3, corner: float) -> float:
    """How far off a surface of an instance a ray starts: the error of its position by rounding.

    p and n: position and normal in the prototype's space; n_world: the normal in the world, not of unit length; corner:
    the triangle's largest coordinate. The error is that of the position in the world, as in closest_hit, and along the
    normal that of the transforms to the prototype's space and back.

    Reference: Pharr, Jakob, Humphreys (2016), "Physically Based Rendering", section 3.9.5.
    """
    world = abs_product(instance.linear, p)
    local = abs_product(instance.inverse, world) + wp.vec3(corner, corner, corner)
    along_n = wp.abs(n[0]) * local[0] + wp.abs(n[1]) * local[1] + wp.abs(n[2]) * local[2]
    # A triangle without area has no normal.
    along_n_world = along_n / wp.max(wp.length(n_world), 1.0e-30)
    return OFFSET * (max_abs(world) + max_abs(instance.translation) + along_n_world)


def make_instances(hits: SimpleNamespace) -> wp.Function:
    """With the functions of kernels/hit.py: the one for the closest surface, in world space or of an instance."""

    @wp.func
    def instance_surface(scene: SceneView, found: InstanceHit, wi: wp.vec3) -> Hit:
        """The surface that a ray has found, in world space."""
        instance = scene.instances[found.instance]
        hit = Hit()
        hit.distance = found.triangle.distance
        hit.instance = found.instance
        hit.triangle = instance.first_triangle + found.triangle.face
        hit.u = found.triangle.u
        hit.v = found.triangle.v
        p0 = hits.corner(scene, hit.triangle, found.triangle.slot, 0)
        p1 = hits.corner(scene, hit.triangle, found.triangle.slot, 1)
        p2 = hits.corner(scene, hit.triangle, found.triangle.slot, 2)
        n = scene.triangles[hit.triangle].n
        n_world = normal_to_world(scene, hit.instance, n)
        corner = wp.max(max_abs(p0), wp.max(max_abs(p1), max_abs(p2)))
        p = inner_point(p0, p1, p2, hit.u, hit.v, 0.0)
        hit.offset = offset_of(instance, p, n, n_world, corner)
        # The offset is in the world's units, so the edges are, too.
        inset = inset_of(instance.linear * (p1 - p0), instance.linear * (p2 - p0), hit.offset)
        hit.p = instance.linear * inner_point(p0, p1, p2, hit.u, hit.v, inset) + instance.translation
        return face_forward(hit, wp.normalize(n_world), wi)

    @wp.func
    def closest_instance(scene: SceneView, origin: wp.vec3, wi: wp.vec3, farthest: float) -> InstanceHit:
        """The closest triangle nearer than `farthest`."""
        found = InstanceHit()
        found.instance = NO_INSTANCE
        found.triangle.distance = farthest
        query = wp.bvh_query_ray(scene.instance_bvh, origin, nonzero(wi))
        index = int(0)
        while wp.bvh_query_next(query, index, found.triangle.distance):
            instance = scene.instances[index]
            start = instance.inverse * (origin - instance.translation)
            reach = found.triangle.distance
            inside = hits.closest(scene, instance.mesh, instance.root, start, instance.inverse * wi, reach)
            if inside.face != NO_FACE:
                found.instance = index
                found.triangle = inside
        return found

    @wp.func
    def closest_hit_of_all(scene: SceneView, origin: wp.vec3, wi: wp.vec3) -> Hit:
        hit = hits.closest_hit(scene, origin, wi)
        if scene.instance_count > 0:
            found = closest_instance(scene, origin, wi, hit.distance)
            if found.instance != NO_INSTANCE:
                return instance_surface(scene, found, wi)
        return hit

    return closest_hit_of_all
