"""Mesh lights: the emissive triangles of one material on one prim, uniform over their whole area.

The light's record holds a mean of what the material emits, for the choice among lights; what a sample brings and what
a ray meets is the material's emission at that point.
"""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import LightView, SceneView
from warpmis.kernels.hit import NO_INSTANCE
from warpmis.kernels.light.area import pdf_of_area
from warpmis.kernels.light.dome import upper_bound
from warpmis.kernels.light.records import LightHit, LightSample
from warpmis.kernels.material import make_material
from warpmis.kernels.warps import square_to_triangle
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})


@wp.func
def cos_emitted(light: LightView, normal: wp.vec3, wi: wp.vec3) -> float:
    """Cosine at the emitter of light that leaves against wi; 0 behind a one-sided emitter."""
    cos_light = -wp.dot(normal, wi)
    if light.two_sided:
        cos_light = wp.abs(cos_light)
    return wp.max(cos_light, 0.0)


@wp.func
def pdf_mesh(light: LightView, normal: wp.vec3, wi: wp.vec3, distance: float) -> float:
    return pdf_of_area(light, distance, cos_emitted(light, normal, wi))


@wp.func
def hit_emitter_triangle(scene: SceneView, light: LightView, triangle: int, x: wp.vec3, wi: wp.vec3) -> LightHit:
    """Reference: Moller and Trumbore (1997), "Fast, Minimum Storage Ray-Triangle Intersection"."""
    hit = LightHit()
    hit.distance = -1.0
    corners = scene.indices[triangle]
    p0 = scene.points[corners[0]]
    e1 = scene.points[corners[1]] - p0
    e2 = scene.points[corners[2]] - p0
    p = wp.cross(wi, e2)
    determinant = wp.dot(e1, p)
    if determinant == 0.0:
        return hit
    o = x - p0
    b1 = wp.dot(o, p) / determinant
    q = wp.cross(o, e1)
    b2 = wp.dot(wi, q) / determinant
    t = wp.dot(e2, q) / determinant
    if b1 < 0.0 or b2 < 0.0 or b1 + b2 > 1.0 or t <= 0.0:
        return hit
    hit.distance = t
    hit.pdf_solid_angle = pdf_mesh(light, scene.triangles[triangle].n, wi, t)
    return hit


def make_mesh(features: Features) -> SimpleNamespace:
    """The mesh lights' sampler for the materials in `features`."""
    materials = make_material(features)

    @wp.func
    def sample(scene: SceneView, light: LightView, x: wp.vec3, pick: float, u: float, v: float) -> LightSample:
        s = LightSample()
        triangle = scene.emitter_triangles[light.first + upper_bound(scene.emitter_cdf, light.first, light.count, pick)]
        corners = scene.indices[triangle]
        p0 = scene.points[corners[0]]
        e1 = scene.points[corners[1]] - p0
        e2 = scene.points[corners[2]] - p0
        b = square_to_triangle(u, v)
        to_light = p0 + e1 * b[0] + e2 * b[1] - x
        s.distance = wp.length(to_light)
        if s.distance == 0.0:
            return s
        s.wi = to_light / s.distance
        s.pdf_solid_angle = pdf_mesh(light, scene.triangles[triangle].n, s.wi, s.distance)
        s.radiance = light.radiance
        if wp.static(features.textures or features.vertex_colors):
            s.radiance = materials.at(scene, triangle, NO_INSTANCE, 1.0 - b[0] - b[1], b[0]).emission
        return s

    return SimpleNamespace(sample=sample)
