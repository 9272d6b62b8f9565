"""Mesh lights: the emissive triangles of one material on one prim, uniform over their whole area.

The light's record holds a mean of what the material emits, for the choice among lights; what a sample brings and what
a ray meets is the material's emission at that point.
"""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import LightView, SceneView
from warpmis.kernels.light.dome import upper_bound
from warpmis.kernels.light.place import Emitter, area_of, make_place
from warpmis.kernels.light.records import LightSample
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
def pdf_mesh(light: LightView, area: float, normal: wp.vec3, wi: wp.vec3, distance: float) -> float:
    """The density in solid angle of a point drawn uniformly from this area of a mesh light."""
    cos_light = cos_emitted(light, normal, wi)
    if cos_light <= 0.0:
        return 0.0
    return distance * distance / (cos_light * area)


@wp.func
def hit_emitter_triangle(emitter: Emitter, x: wp.vec3, wi: wp.vec3) -> float:
    """The distance at which the ray meets the triangle; negative: it does not.

    Reference: Moller and Trumbore (1997), "Fast, Minimum Storage Ray-Triangle Intersection".
    """
    p = wp.cross(wi, emitter.e2)
    determinant = wp.dot(emitter.e1, p)
    if determinant == 0.0:
        return -1.0
    o = x - emitter.p0
    b1 = wp.dot(o, p) / determinant
    q = wp.cross(o, emitter.e1)
    b2 = wp.dot(wi, q) / determinant
    t = wp.dot(emitter.e2, q) / determinant
    if b1 < 0.0 or b2 < 0.0 or b1 + b2 > 1.0:
        return -1.0
    return t


def make_mesh(features: Features) -> SimpleNamespace:
    """The mesh lights' sampler for the materials in `features`."""
    materials = make_material(features)
    places = make_place(features)

    @wp.func
    def sample(scene: SceneView, light: LightView, emitter: int, instance: int, x: wp.vec3, u: wp.vec4) -> LightSample:
        """A direction towards that row of emitter_triangles, or with -1 towards one that u[3] chooses by area."""
        s = LightSample()
        row = emitter
        if emitter < 0:
            row = light.first + upper_bound(scene.emitter_cdf, light.first, light.count, u[3])
        found = places.emitter_at(scene, row, instance)
        b = square_to_triangle(u[1], u[2])
        to_light = found.p0 + found.e1 * b[0] + found.e2 * b[1] - x
        s.distance = wp.length(to_light)
        if s.distance == 0.0:
            return s
        s.wi = to_light / s.distance
        area = light.area
        if emitter >= 0:
            area = area_of(found)
        s.pdf_solid_angle = pdf_mesh(light, area, found.n, s.wi, s.distance)
        s.radiance = light.radiance
        if wp.static(features.textures or features.vertex_colors):
            triangle = scene.emitter_triangles[row]
            s.radiance = materials.at(scene, triangle, instance, 1.0 - b[0] - b[1], b[0]).emission
        return s

    return SimpleNamespace(sample=sample)
