"""Distant lights of finite angle: uniform over their cone."""

import warp as wp

from warpmis.device.views import LightView
from warpmis.kernels.light.records import LightHit, LightSample
from warpmis.kernels.shading_frame import frame_from_normal, to_world
from warpmis.kernels.warps import PI, square_to_uniform_cone

wp.set_module_options({"enable_backward": False})

INFINITE_DISTANCE = wp.constant(1.0e30)


@wp.func
def sample_distant(light: LightView, u: float, v: float) -> LightSample:
    """light.one_minus_cos, not the cosine: for the sun float32 would keep but two digits of it."""
    s = LightSample()
    s.wi = to_world(frame_from_normal(light.n), square_to_uniform_cone(u, v, light.one_minus_cos))
    s.distance = INFINITE_DISTANCE
    s.pdf_solid_angle = 1.0 / (2.0 * PI * light.one_minus_cos)
    s.radiance = light.radiance
    return s


@wp.func
def hit_distant(light: LightView, wi: wp.vec3) -> LightHit:
    """|wi - n|^2 = 2 (1 - cos) tells small angles apart where the cosine cannot."""
    hit = LightHit()
    hit.distance = -1.0
    apart = wi - light.n
    if wp.dot(apart, apart) > 2.0 * light.one_minus_cos:
        return hit
    hit.distance = INFINITE_DISTANCE
    hit.pdf_solid_angle = 1.0 / (2.0 * PI * light.one_minus_cos)
    return hit
