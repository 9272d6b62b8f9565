"""Rect lights: uniform over the solid angle where float32 bears it, over the area elsewhere.

Reference: Urena, Fajardo, King (2013), "An Area-Preserving Parametrization for Spherical Rectangles".
"""

import warp as wp

from warpmis.device.views import LightView
from warpmis.kernels.light.area import pdf_of_area, plane_hit, sample_towards
from warpmis.kernels.light.records import LightHit, LightSample

wp.set_module_options({"enable_backward": False})

# The sampling takes differences that lose digits for a small rectangle, and in a grazing view: below this solid angle,
# or with the rectangle's plane closer than this share of its farthest corner's distance, the area is sampled instead.
MIN_SOLID_ANGLE = wp.constant(0.01)
MIN_HEIGHT_SHARE = wp.constant(0.1)


@wp.struct
class SphericalRect:
    """The rectangle in a frame at the shading point, x and y along its edges, z away from it, in units of its plane's
    distance `height`: z0 = -1. Without a unit of length the products below stay in float32's range.

    strip0: solid angle, signed, of the strip from 0 to x0; solid_angle is 0 where float32 does not bear sampling it.
    """

    ex: wp.vec3
    ey: wp.vec3
    ez: wp.vec3
    x0: float
    x1: float
    y0: float
    y1: float
    height: float
    strip0: float
    solid_angle: float


@wp.func
def strip_angle(x: float, y0: float, y1: float) -> float:
    """Solid angle, signed, of the rectangle from (0, y0) to (x, y1) at height 1.

    The corner (x, y) subtends atan(x y / |(x, y, 1)|) with the axes; this is the difference of two such angles, each
    below pi / 2, as the argument of a quotient of complex numbers.
    """
    xx = x * x + 1.0
    r0 = wp.sqrt(xx + y0 * y0)
    r1 = wp.sqrt(xx + y1 * y1)
    return wp.atan2(x * (y1 * r0 - y0 * r1), r0 * r1 + x * x * y0 * y1)


@wp.func
def spherical_rect(light: LightView, x: wp.vec3) -> SphericalRect:
    r = SphericalRect()
    half_x = wp.length(light.u)
    half_y = wp.length(light.v)
    r.ex = light.u / half_x
    r.ey = light.v / half_y
    r.ez = wp.cross(r.ex, r.ey)
    d = light.center - x
    z0 = wp.dot(d, r.ez)
    if z0 > 0.0:
        r.ez = -r.ez
    r.height = wp.abs(z0)
    cx = wp.dot(d, r.ex)
    cy = wp.dot(d, r.ey)
    far_x = wp.abs(cx) + half_x
    far_y = wp.abs(cy) + half_y
    if z0 * z0 < MIN_HEIGHT_SHARE * MIN_HEIGHT_SHARE * (far_x * far_x + far_y * far_y):
        return r
    r.x0 = (cx - half_x) / r.height
    r.x1 = (cx + half_x) / r.height
    r.y0 = (cy - half_y) / r.height
    r.y1 = (cy + half_y) / r.height
    r.strip0 = strip_angle(r.x0, r.y0, r.y1)
    r.solid_angle = strip_angle(r.x1, r.y0, r.y1) - r.strip0
    if r.solid_angle < MIN_SOLID_ANGLE:
        r.solid_angle = 0.0
    return r


@wp.func
def sample_spherical_rect(r: SphericalRect, u: float, v: float) -> wp.vec3:
    """Direction (not normalised) from the shading point to a point uniform in solid angle."""
    # The strip from 0 to xu has the solid angle a: the paper's fu^2 + b0^2 - 1 = 1 / xu^2, with a = au - pi.
    a = u * r.solid_angle + r.strip0
    sin_a = wp.sin(a)
    b0 = -r.y0 / wp.sqrt(1.0 + r.y0 * r.y0)
    b1 = r.y1 / wp.sqrt(1.0 + r.y1 * r.y1)
    slope2 = b0 * b0 + b1 * b1 + 2.0 * b0 * b1 * wp.cos(a) - sin_a * sin_a
    xu = wp.clamp(sin_a / wp.sqrt(wp.max(slope2, 1.0e-30)), r.x0, r.x1)
    d2 = xu * xu + 1.0
    h0 = r.y0 / wp.sqrt(d2 + r.y0 * r.y0)
    h1 = r.y1 / wp.sqrt(d2 + r.y1 * r.y1)
    hv = h0 + v * (h1 - h0)
    yv = wp.clamp(hv * wp.sqrt(d2 / wp.max(1.0 - hv * hv, 1.0e-12)), r.y0, r.y1)
    return (r.ex * xu + r.ey * yv - r.ez) * r.height


@wp.func
def sample_rect(light: LightView, x: wp.vec3, u: float, v: float) -> LightSample:
    if wp.dot(x - light.center, light.n) <= 0.0:
        return LightSample()
    if light.solid_angle_sampling != 0:
        r = spherical_rect(light, x)
        if r.solid_angle > 0.0:
            s = LightSample()
            to_light = sample_spherical_rect(r, u, v)
            s.distance = wp.length(to_light)
            s.wi = to_light / s.distance
            s.pdf_solid_angle = 1.0 / r.solid_angle
            s.radiance = light.radiance
            return s
    point = light.center + light.u * (2.0 * u - 1.0) + light.v * (2.0 * v - 1.0)
    return sample_towards(light, x, point, light.n)


@wp.func
def hit_rect(light: LightView, x: wp.vec3, wi: wp.vec3) -> LightHit:
    hit = LightHit()
    hit.distance = -1.0
    plane = plane_hit(light, x, wi)
    if plane.distance <= 0.0 or wp.abs(plane.a) > 1.0 or wp.abs(plane.b) > 1.0:
        return hit
    hit.distance = plane.distance
    hit.pdf_solid_angle = pdf_of_area(light, plane.distance, plane.cos_light)
    if light.solid_angle_sampling != 0:
        r = spherical_rect(light, x)
        if r.solid_angle > 0.0:
            hit.pdf_solid_angle = 1.0 / r.solid_angle
    return hit
