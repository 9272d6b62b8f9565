"""Disk lights (ellipses once scaled): uniform over the area."""

import warp as wp

from warpmis.device.views import LightView
from warpmis.kernels.light.records import LightHit, LightSample
from warpmis.kernels.warps import square_to_disk

wp.set_module_options({"enable_backward": False})


@wp.func
def sample_disk(light: LightView, x: wp.vec3, u: float, v: float) -> LightSample:
    s = LightSample()
    p = square_to_disk(u, v)
    to_light = light.center + light.u * p[0] + light.v * p[1] - x
    s.distance = wp.length(to_light)
    if s.distance == 0.0:
        return s
    s.wi = to_light / s.distance
    cos_light = -wp.dot(s.wi, light.n)
    s.pdf_solid_angle = wp.where(cos_light > 0.0, s.distance * s.distance / (cos_light * light.area), 0.0)
    s.radiance = light.radiance
    return s


@wp.func
def hit_disk(light: LightView, x: wp.vec3, wi: wp.vec3) -> LightHit:
    hit = LightHit()
    hit.distance = -1.0
    cos_light = -wp.dot(wi, light.n)
    if cos_light <= 0.0:
        return hit
    t = -wp.dot(light.center - x, light.n) / cos_light
    if t <= 0.0:
        return hit
    d = x + wi * t - light.center
    uu = wp.dot(light.u, light.u)
    vv = wp.dot(light.v, light.v)
    uv = wp.dot(light.u, light.v)
    du = wp.dot(d, light.u)
    dv = wp.dot(d, light.v)
    determinant = uu * vv - uv * uv
    a = (du * vv - dv * uv) / determinant
    b = (dv * uu - du * uv) / determinant
    if a * a + b * b > 1.0:
        return hit
    hit.distance = t
    hit.pdf_solid_angle = t * t / (cos_light * light.area)
    return hit
