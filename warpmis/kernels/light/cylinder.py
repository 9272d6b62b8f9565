"""Cylinder lights, without caps: uniform over the area, emitting outwards."""

import warp as wp

from warpmis.device.views import LightView
from warpmis.kernels.frame import frame_from_normal
from warpmis.kernels.light.area import pdf_of_area, sample_towards
from warpmis.kernels.light.records import LightHit, LightSample
from warpmis.kernels.warps import PI

wp.set_module_options({"enable_backward": False})


@wp.func
def sample_cylinder(light: LightView, x: wp.vec3, u: float, v: float) -> LightSample:
    frame = frame_from_normal(wp.normalize(light.u))
    phi = 2.0 * PI * v
    outward = frame.s * wp.cos(phi) + frame.t * wp.sin(phi)
    point = light.center + light.u * (2.0 * u - 1.0) + outward * light.radius
    return sample_towards(light, x, point, outward)


@wp.func
def hit_cylinder(light: LightView, x: wp.vec3, wi: wp.vec3) -> LightHit:
    """The nearer crossing alone can face the ray, since the cylinder emits outwards."""
    hit = LightHit()
    hit.distance = -1.0
    half_length = wp.length(light.u)
    axis = light.u / half_length
    o = x - light.center
    o_across = o - axis * wp.dot(o, axis)
    d_across = wi - axis * wp.dot(wi, axis)
    a = wp.dot(d_across, d_across)
    if a < 1.0e-12:
        return hit
    # Measured from the point of closest approach to the axis, the two crossings are at -+ half_chord.
    closest = -wp.dot(o_across, d_across) / a
    miss = o_across + d_across * closest
    half_chord2 = (light.radius * light.radius - wp.dot(miss, miss)) / a
    if half_chord2 <= 0.0:
        return hit
    t = closest - wp.sqrt(half_chord2)
    if t <= 0.0 or wp.abs(wp.dot(o + wi * t, axis)) > half_length:
        return hit
    outward = (o_across + d_across * t) / light.radius
    cos_light = -wp.dot(wi, outward)
    if cos_light <= 0.0:
        return hit
    hit.distance = t
    hit.pdf_solid_angle = pdf_of_area(light, t, cos_light)
    return hit
