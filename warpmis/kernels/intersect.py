"""Rays against the mesh: the closest surface with its frame, and the transmittance of a shadow ray."""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import MaterialView, SceneView
from warpmis.features import Features
from warpmis.kernels.bsdf.microfacet import schlick, schlick_scalar
from warpmis.kernels.frame import Frame, frame_from_normal, luminance, max_abs, normal_of_edges, to_local
from warpmis.kernels.light.distant import INFINITE_DISTANCE
from warpmis.kernels.material import make_material

wp.set_module_options({"enable_backward": False})

# A new ray starts this share of the triangle's largest coordinate off the surface: twice the smallest at which no ray
# met its own triangle again (tests/unit/test_intersect.py). Larger ones shift the light: a floor 100 units wide was
# 0.07 % too bright at 4e-6.
OFFSET = wp.constant(5.0e-7)

# Points where rays meet a triangle are kept this many such offsets away from its edges (where its sides are alike): one
# on the edge itself lies in the neighbour's plane, and the next ray would start on that plane, or behind it.
INSET = wp.constant(8.0)
MAX_INSET = wp.constant(0.125)

# A mapped normal that the ray's origin sees at a smaller cosine is turned towards it.
MIN_MAPPED_COSINE = wp.constant(0.01)

# No ray is followed through more transparent surfaces than this.
MAX_PASSED = wp.constant(64)


@wp.struct
class Hit:
    """The closest surface: distance INFINITE_DISTANCE where there is none.

    ng is the unit geometric normal on the side of the ray's origin, `outside` (1 or 0) whether that is the front.
    """

    distance: float
    triangle: int
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
def closest_hit(scene: SceneView, origin: wp.vec3, wi: wp.vec3) -> Hit:
    hit = Hit()
    hit.distance = INFINITE_DISTANCE
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
    longest = wp.max(max_abs(p1 - p0), max_abs(p2 - p0))
    # Warp's weights: u for the first corner, v for the second.
    hit.p = inner_point(p0, p1, p2, query.u, query.v, wp.min(INSET * hit.offset / longest, MAX_INSET))
    ng = normal_of_edges(p1 - p0, p2 - p0)
    hit.outside = 1
    if wp.dot(ng, wi) > 0.0:
        ng = -ng
        hit.outside = 0
    hit.ng = ng
    return hit


def make_intersect(features: Features) -> SimpleNamespace:
    """Intersection functions for the surfaces in `features`: shading_frame, passed, transmittance."""
    materials = make_material(features)

    @wp.func
    def mapped_normal(scene: SceneView, hit: Hit, wi: wp.vec3, n: wp.vec3) -> wp.vec3:
        """The normal `n`, on the ray's side, turned by a normal map, no further than the ray's origin can see it."""
        side = wp.where(hit.outside != 0, 1.0, -1.0)
        turned = materials.tilted(scene, hit.triangle, hit.u, hit.v, n * side) * side
        seen = -wp.dot(turned, wi)
        if seen < MIN_MAPPED_COSINE:
            turned = wp.normalize(turned - wi * (MIN_MAPPED_COSINE - seen))
        return wp.where(wp.dot(turned, hit.ng) > 0.0, turned, n)

    @wp.func
    def shading_frame(scene: SceneView, hit: Hit, wi: wp.vec3) -> Frame:
        """The frame of the shading normal on the ray's side; of the geometric one where the former faces away."""
        n = hit.ng
        if wp.static(features.shading_normals):
            rows = scene.triangles[hit.triangle].normals
            if rows[0] >= 0:
                shading = (
                    scene.normals[rows[0]] * hit.u
                    + scene.normals[rows[1]] * hit.v
                    + scene.normals[rows[2]] * (1.0 - hit.u - hit.v)
                )
                if hit.outside == 0:
                    shading = -shading
                shading = wp.normalize(shading)
                if wp.dot(shading, wi) < -1.0e-4 and wp.dot(shading, hit.ng) > 0.0:
                    n = shading
        if wp.static(features.normal_maps):
            n = mapped_normal(scene, hit, wi, n)
        return frame_from_normal(n)

    @wp.func
    def passed(material: MaterialView, cos_theta: float) -> wp.vec3:
        """Share of the light that goes straight through a surface.

        In UsdPreviewSurface's opacityMode "transparent" the specular lobes reflect first, "presence" cuts them too.
        """
        share = wp.vec3(1.0, 1.0, 1.0) * (1.0 - material.opacity)
        if wp.static(features.specular):
            if material.presence == 0:
                f = schlick(material.specular_f0, cos_theta)
                share = wp.cw_mul(share, wp.vec3(1.0, 1.0, 1.0) - f)
                share = share * (1.0 - material.coat * schlick_scalar(material.coat_f0, cos_theta))
        return share

    @wp.func
    def transmittance(scene: SceneView, origin: wp.vec3, wi: wp.vec3, distance: float) -> wp.vec3:
        """What a shadow ray leaves of the light: 0 or 1 per colour among opaque surfaces."""
        if wp.static(not features.opacity):
            if wp.mesh_query_ray_anyhit(scene.mesh, origin, wi, distance):
                return wp.vec3(0.0, 0.0, 0.0)
            return wp.vec3(1.0, 1.0, 1.0)
        share = wp.vec3(1.0, 1.0, 1.0)
        start = origin
        left = distance
        for _passed in range(MAX_PASSED):
            hit = closest_hit(scene, start, wi)
            if hit.distance >= left:
                return share
            material = scene.materials[scene.triangles[hit.triangle].material]
            if material.opacity >= 1.0:
                return wp.vec3(0.0, 0.0, 0.0)
            material = materials.at(scene, hit.triangle, hit.u, hit.v)
            cos_theta = to_local(shading_frame(scene, hit, wi), -wi)[2]
            share = wp.cw_mul(share, passed(material, cos_theta))
            if luminance(share) <= 0.0:
                return share
            left -= hit.distance
            start = hit.p - hit.ng * hit.offset
        return wp.vec3(0.0, 0.0, 0.0)

    return SimpleNamespace(shading_frame=shading_frame, passed=passed, transmittance=transmittance)
