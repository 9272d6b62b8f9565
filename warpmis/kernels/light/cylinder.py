"""Cylinder lights, without caps: uniform over the visible part's azimuth and, along it, over the sine of elevation.

Seen from a point at the distance d of the axis, the half that faces it fills the azimuths |beta| < asin(r / d) about
the axis' direction. Of one azimuth the crossing is at the distance rho(beta) from the point, across the axis; the ends
lie at the elevations with the sines z / |(rho, z)|. Since d(omega) = d(beta) d(sine), the density is bounded up to the
silhouette, where that of a uniform area is infinite.

Reference: Zimmerman (1995), "Direct Lighting Models for Ray Tracing with Cylindrical Lamps", Graphics Gems V, which
samples the visible part likewise, by area.
"""

import warp as wp

from warpmis.device.views import LightView
from warpmis.kernels.light.records import LightHit, LightSample
from warpmis.kernels.light.sphere import near_crossing

wp.set_module_options({"enable_backward": False})


@wp.func
def one_minus_sine(rho: float, z: float) -> float:
    """1 - z / |(rho, z)|, with no cancellation for a point high up."""
    length = wp.sqrt(rho * rho + z * z)
    if z <= 0.0:
        return 1.0 - z / length
    return rho / length * (rho / (length + z))


@wp.func
def sine_span(rho: float, middle: float, half_length: float) -> float:
    """Difference of the ends' sines of elevation, the ends at the heights middle -+ half_length.

    Where both are on one side it is taken from the difference of the squares, which has no cancellation:
    rho^2 (z1 - z0) (z1 + z0) / (R1^2 R0^2 (s1 + s0)).
    """
    z0 = middle - half_length
    z1 = middle + half_length
    r0 = wp.sqrt(rho * rho + z0 * z0)
    r1 = wp.sqrt(rho * rho + z1 * z1)
    s0 = z0 / r0
    s1 = z1 / r1
    if wp.abs(middle) <= half_length:
        return s1 - s0
    share = rho / r0 * (rho / r1)
    return share * (2.0 * half_length / r0) * (2.0 * middle / r1) / (s0 + s1)


@wp.func
def sample_cylinder(light: LightView, x: wp.vec3, u: float, v: float) -> LightSample:
    s = LightSample()
    half_length = wp.length(light.u)
    axis = light.u / half_length
    to_center = light.center - x
    middle = wp.dot(to_center, axis)
    across = to_center - axis * middle
    d2 = wp.dot(across, across)
    r2 = light.radius * light.radius
    if d2 <= r2:
        return s
    d = wp.sqrt(d2)
    towards = across / d
    beta_max = wp.asin(light.radius / d)
    beta = beta_max * (2.0 * u - 1.0)
    sin_beta = wp.sin(beta)
    cos_beta = wp.cos(beta)
    rho = near_crossing(d2, r2, d * cos_beta, r2 - d2 * sin_beta * sin_beta)
    span = sine_span(rho, middle, half_length)
    # From the end that is farther up (or down) on: there 1 - sine keeps its digits.
    side = wp.where(middle >= 0.0, 1.0, -1.0)
    height = wp.abs(middle)
    low = wp.min(one_minus_sine(rho, height + half_length) + v * span, 2.0)
    z = rho * (1.0 - low) / wp.sqrt(wp.max(low * (2.0 - low), 1.0e-30))
    z = side * wp.clamp(z, height - half_length, height + half_length)
    to_light = (towards * cos_beta + wp.cross(axis, towards) * sin_beta) * rho + axis * z
    s.distance = wp.length(to_light)
    s.wi = to_light / s.distance
    s.pdf_solid_angle = 0.5 / (beta_max * span)
    s.radiance = light.radiance
    return s


@wp.func
def hit_cylinder(light: LightView, x: wp.vec3, wi: wp.vec3) -> LightHit:
    """The nearer crossing alone can face the ray, since the cylinder emits outwards."""
    hit = LightHit()
    hit.distance = -1.0
    half_length = wp.length(light.u)
    axis = light.u / half_length
    to_center = light.center - x
    middle = wp.dot(to_center, axis)
    across = to_center - axis * middle
    slope = wp.dot(wi, axis)
    wi_across = wi - axis * slope
    cos_elevation = wp.length(wi_across)
    d2 = wp.dot(across, across)
    r2 = light.radius * light.radius
    if d2 <= r2 or cos_elevation < 1.0e-6:
        return hit
    wi_across = wi_across / cos_elevation
    along = wp.dot(across, wi_across)
    miss = across - wi_across * along
    half_chord2 = r2 - wp.dot(miss, miss)
    if along <= 0.0 or half_chord2 <= 0.0:
        return hit
    rho = near_crossing(d2, r2, along, half_chord2)
    t = rho / cos_elevation
    if wp.abs(slope * t - middle) > half_length:
        return hit
    hit.distance = t
    beta_max = wp.asin(light.radius / wp.sqrt(d2))
    hit.pdf_solid_angle = 0.5 / (beta_max * sine_span(rho, middle, half_length))
    return hit
