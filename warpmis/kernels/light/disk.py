"""Disk lights (ellipses once scaled): uniform over the area."""

import warp as wp

from warpmis.device.views import LightView
from warpmis.kernels.light.area import pdf_of_area, plane_hit, sample_towards
from warpmis.kernels.light.records import LightHit, LightSample
from warpmis.kernels.warps import square_to_disk

wp.set_module_options({"enable_backward": False})


@wp.func
def sample_disk(light: LightView, x: wp.vec3, u: float, v: float) -> LightSample:
    p = square_to_disk(u, v)
    return sample_towards(light, x, light.center + light.u * p[0] + light.v * p[1], light.n)


@wp.func
def hit_disk(light: LightView, x: wp.vec3, wi: wp.vec3) -> LightHit:
    hit = LightHit()
    hit.distance = -1.0
    plane = plane_hit(light, x, wi)
    if plane.distance <= 0.0 or plane.a * plane.a + plane.b * plane.b > 1.0:
        return hit
    hit.distance = plane.distance
    hit.pdf_solid_angle = pdf_of_area(light, plane.distance, plane.cos_light)
    return hit
