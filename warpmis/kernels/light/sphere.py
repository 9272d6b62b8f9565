"""Sphere lights: uniform over the cone of visible directions. They emit outwards: from inside there is no light."""

import warp as wp

from warpmis.device.views import LightView
from warpmis.kernels.light.records import LightHit, LightSample
from warpmis.kernels.shading_frame import frame_from_normal, to_world
from warpmis.kernels.warps import PI, square_to_uniform_cone

wp.set_module_options({"enable_backward": False})


@wp.func
def one_minus_cos_of_cone(sin2: float) -> float:
    """1 - cos(theta_max) from sin^2(theta_max), with no cancellation for a small or distant sphere."""
    return sin2 / (1.0 + wp.sqrt(wp.max(0.0, 1.0 - sin2)))


@wp.func
def near_crossing(d2: float, r2: float, along: float, half_chord2: float) -> float:
    """Distance to the near side: along - half chord, as the quotient of the two crossings' product and the far one.

    The difference would lose its digits before a sphere that is large against its distance.
    """
    d = wp.sqrt(d2)
    r = wp.sqrt(r2)
    return (d - r) * (d + r) / (along + wp.sqrt(wp.max(0.0, half_chord2)))


@wp.func
def sample_sphere(light: LightView, x: wp.vec3, u: float, v: float) -> LightSample:
    s = LightSample()
    to_center = light.center - x
    d2 = wp.dot(to_center, to_center)
    r2 = light.radius * light.radius
    if d2 <= r2:
        return s
    d = wp.sqrt(d2)
    one_minus_cos = one_minus_cos_of_cone(r2 / d2)
    local = square_to_uniform_cone(u, v, one_minus_cos)
    s.wi = to_world(frame_from_normal(to_center / d), local)
    # The half chord's square is r^2 - d^2 sin^2(theta).
    sin2 = local[0] * local[0] + local[1] * local[1]
    s.distance = near_crossing(d2, r2, d * local[2], r2 - d2 * sin2)
    s.pdf_solid_angle = 1.0 / (2.0 * PI * one_minus_cos)
    s.radiance = light.radiance
    return s


@wp.func
def hit_sphere(light: LightView, x: wp.vec3, wi: wp.vec3) -> LightHit:
    """Reference: Haines, Gunther, Akenine-Moller (2019), "Precision Improvements for Ray/Sphere Intersection"."""
    hit = LightHit()
    hit.distance = -1.0
    to_center = light.center - x
    d2 = wp.dot(to_center, to_center)
    r2 = light.radius * light.radius
    along = wp.dot(to_center, wi)
    if d2 <= r2 or along <= 0.0:
        return hit
    across = to_center - wi * along
    half_chord2 = r2 - wp.dot(across, across)
    if half_chord2 < 0.0:
        return hit
    hit.distance = near_crossing(d2, r2, along, half_chord2)
    hit.pdf_solid_angle = 1.0 / (2.0 * PI * one_minus_cos_of_cone(r2 / d2))
    return hit
