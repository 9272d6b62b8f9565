"""Rect lights: uniform over the solid angle where it pays and float32 bears it, over the area elsewhere.

Reference: Urena, Fajardo, King (2013), "An Area-Preserving Parametrization for Spherical Rectangles".
"""

import warp as wp

from warpmis.device.views import LightView
from warpmis.kernels.light.area import pdf_of_area, plane_hit, sample_towards
from warpmis.kernels.light.records import LightHit, LightSample
from warpmis.kernels.warps import PI

wp.set_module_options({"enable_backward": False})

# The sampling takes differences that lose digits for a small rectangle, and in a grazing view: below this solid angle,
# or with the rectangle's plane closer than this share of its farthest corner's distance, the area is sampled instead.
MIN_SOLID_ANGLE = wp.constant(0.01)
MIN_HEIGHT_SHARE = wp.constant(0.1)
# So it is where half the diagonal's square is a smaller share of the distance's, too: the light falls off little across
# the rectangle, and sampling its area takes a small part of the time.
FAR = wp.constant(0.1)


@wp.struct
class SphericalRect:
    """The rectangle in a frame at the shading point, x and y along its edges, z its normal, in units of its plane's
    distance `height`: it lies at z = -1. Without a unit of length the products below stay in float32's range.

    strip0: the strip from 0 to x0, as of strip_angle; solid_angle is 0 where the area is to be sampled instead.
    """

    ex: wp.vec3
    ey: wp.vec3
    x0: float
    x1: float
    y0: float
    y1: float
    height: float
    strip0: wp.vec2
    solid_angle: float


@wp.func
def strip_angle(x: float, y0: float, y1: float) -> wp.vec2:
    """The rectangle from (0, y0) to (x, y1) at height 1 as a complex number, whose angle is its signed solid angle.

    The corner (x, y) subtends atan(x y / |(x, y, 1)|) with the axes; this is the difference of two such angles, each
    below pi / 2, as a product of complex numbers. Its absolute value is (x^2 + 1) sqrt((y0^2 + 1) (y1^2 + 1)).
    """
    xx = x * x + 1.0
    r0 = wp.sqrt(xx + y0 * y0)
    r1 = wp.sqrt(xx + y1 * y1)
    return wp.vec2(r0 * r1 + x * x * y0 * y1, x * (y1 * r0 - y0 * r1))


@wp.func
def spherical_rect(light: LightView, x: wp.vec3) -> SphericalRect:
    """x: before the light's front."""
    r = SphericalRect()
    d = light.center - x
    if wp.dot(light.lengths, light.lengths) < FAR * wp.dot(d, d):
        return r
    half_x = light.lengths[0]
    half_y = light.lengths[1]
    r.ex = light.dual_u * half_x
    r.ey = light.dual_v * half_y
    r.height = -wp.dot(d, light.n)
    cx = wp.dot(d, r.ex)
    cy = wp.dot(d, r.ey)
    far_x = wp.abs(cx) + half_x
    far_y = wp.abs(cy) + half_y
    if r.height * r.height < MIN_HEIGHT_SHARE * MIN_HEIGHT_SHARE * (far_x * far_x + far_y * far_y):
        return r
    scale = 1.0 / r.height
    r.x0 = (cx - half_x) * scale
    r.x1 = (cx + half_x) * scale
    r.y0 = (cy - half_y) * scale
    r.y1 = (cy + half_y) * scale
    r.strip0 = strip_angle(r.x0, r.y0, r.y1)
    strip1 = strip_angle(r.x1, r.y0, r.y1)
    sine = strip1[1] * r.strip0[0] - strip1[0] * r.strip0[1]
    cosine = strip1[0] * r.strip0[0] + strip1[1] * r.strip0[1]
    r.solid_angle = wp.atan2(sine, cosine)
    if r.solid_angle < -0.1:  # not by rounding: beyond a half turn, whose angles are counted from below
        r.solid_angle += 2.0 * PI
    if r.solid_angle < MIN_SOLID_ANGLE:
        r.solid_angle = 0.0
    return r


@wp.func
def sample_spherical_rect(light: LightView, r: SphericalRect, u: float, v: float) -> LightSample:
    """Uniform in solid angle."""
    # The strip from 0 to xu has the solid angle a: the paper's fu^2 + b0^2 - 1 = 1 / xu^2, with a = au - pi.
    inverse0 = 1.0 / (r.y0 * r.y0 + 1.0)
    inverse1 = 1.0 / (r.y1 * r.y1 + 1.0)
    inverse = wp.sqrt(inverse0 * inverse1)
    sine = wp.sin(u * r.solid_angle)
    cosine = wp.cos(u * r.solid_angle)
    unit = r.strip0 * (inverse / (r.x0 * r.x0 + 1.0))
    sin_a = unit[1] * cosine + unit[0] * sine
    cos_a = unit[0] * cosine - unit[1] * sine
    slope2 = r.y0 * r.y0 * inverse0 + r.y1 * r.y1 * inverse1 - 2.0 * r.y0 * r.y1 * inverse * cos_a - sin_a * sin_a
    xu = wp.clamp(sin_a / wp.sqrt(wp.max(slope2, 1.0e-30)), r.x0, r.x1)
    d2 = xu * xu + 1.0
    h0 = r.y0 / wp.sqrt(d2 + r.y0 * r.y0)
    h1 = r.y1 / wp.sqrt(d2 + r.y1 * r.y1)
    hv = h0 + v * (h1 - h0)
    away = wp.sqrt(d2 / wp.max(1.0 - hv * hv, 1.0e-12))
    yv = wp.clamp(hv * away, r.y0, r.y1)
    s = LightSample()
    s.distance = away * r.height
    s.wi = (r.ex * xu + r.ey * yv - light.n) / away
    s.pdf_solid_angle = 1.0 / r.solid_angle
    s.radiance = light.radiance
    return s


@wp.func
def sample_rect(light: LightView, x: wp.vec3, u: float, v: float) -> LightSample:
    if wp.dot(x - light.center, light.n) <= 0.0:
        return LightSample()
    if light.samples_solid_angle:
        r = spherical_rect(light, x)
        if r.solid_angle > 0.0:
            return sample_spherical_rect(light, r, u, v)
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
    if light.samples_solid_angle:
        r = spherical_rect(light, x)
        if r.solid_angle > 0.0:
            hit.pdf_solid_angle = 1.0 / r.solid_angle
    return hit
