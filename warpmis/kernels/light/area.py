"""What lights sampled by area share: the sample towards a chosen point, and the plane of a flat light."""

import warp as wp

from warpmis.device.views import LightView
from warpmis.kernels.light.records import LightSample

wp.set_module_options({"enable_backward": False})


@wp.struct
class PlaneHit:
    """Where a ray meets a flat light's plane from its front: distance (negative: it does not), the cosine at the light,
    and the place as center + a u + b v."""

    distance: float
    cos_light: float
    a: float
    b: float


@wp.func
def pdf_of_area(light: LightView, distance: float, cos_light: float) -> float:
    """The density 1 / area as one in solid angle; 0 behind the light."""
    if cos_light <= 0.0:
        return 0.0
    return distance * distance / (cos_light * light.area)


@wp.func
def sample_towards(light: LightView, x: wp.vec3, point: wp.vec3, normal: wp.vec3) -> LightSample:
    """The direction from x to a point drawn uniformly over the area, which emits about `normal`."""
    s = LightSample()
    to_light = point - x
    s.distance = wp.length(to_light)
    if s.distance == 0.0:
        return s
    s.wi = to_light / s.distance
    s.pdf_solid_angle = pdf_of_area(light, s.distance, -wp.dot(s.wi, normal))
    s.radiance = light.radiance
    return s


@wp.func
def plane_hit(light: LightView, x: wp.vec3, wi: wp.vec3) -> PlaneHit:
    """light.dual_u and dual_v give the place also where u and v are not at right angles."""
    hit = PlaneHit()
    hit.distance = -1.0
    hit.cos_light = -wp.dot(wi, light.n)
    if hit.cos_light <= 0.0:
        return hit
    hit.distance = -wp.dot(light.center - x, light.n) / hit.cos_light
    d = x + wi * hit.distance - light.center
    hit.a = wp.dot(d, light.dual_u)
    hit.b = wp.dot(d, light.dual_v)
    return hit
