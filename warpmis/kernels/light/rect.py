"""Rect lights: uniform over the solid angle where float32 bears it, over the area elsewhere.

Reference: Urena, Fajardo, King (2013), "An Area-Preserving Parametrization for Spherical Rectangles".
"""

import warp as wp

from warpmis.device.views import LightView
from warpmis.kernels.light.records import LightHit, LightSample
from warpmis.kernels.warps import PI

wp.set_module_options({"enable_backward": False})

# The solid angle is a difference of angles near 2 pi and so carries an error of about 1e-6: below the lower bound
# that would be over 0.01 %, above the upper one the sampling itself loses digits. Both sides use area sampling.
MIN_SOLID_ANGLE = wp.constant(0.01)
MAX_SOLID_ANGLE = wp.constant(6.1)


@wp.struct
class SphericalRect:
    """The rectangle in a frame at the shading point, x and y along its edges, z away from it (z0 < 0)."""

    ex: wp.vec3
    ey: wp.vec3
    ez: wp.vec3
    x0: float
    x1: float
    y0: float
    y1: float
    z0: float
    b0: float
    b1: float
    k: float
    solid_angle: float


@wp.func
def clamped_acos(x: float) -> float:
    return wp.acos(wp.clamp(x, -1.0, 1.0))


@wp.func
def spherical_rect(light: LightView, x: wp.vec3) -> SphericalRect:
    r = SphericalRect()
    half_x = wp.length(light.u)
    half_y = wp.length(light.v)
    r.ex = light.u / half_x
    r.ey = light.v / half_y
    r.ez = wp.cross(r.ex, r.ey)
    d = light.center - x
    r.z0 = wp.dot(d, r.ez)
    if r.z0 > 0.0:
        r.z0 = -r.z0
        r.ez = -r.ez
    cx = wp.dot(d, r.ex)
    cy = wp.dot(d, r.ey)
    r.x0 = cx - half_x
    r.x1 = cx + half_x
    r.y0 = cy - half_y
    r.y1 = cy + half_y
    # Unit normals of the four planes through x and an edge: (0, z0, -y0), (-z0, 0, x1), (0, -z0, y1), (z0, 0, -x0).
    zz = r.z0 * r.z0
    n0z = -r.y0 / wp.sqrt(zz + r.y0 * r.y0)
    n1z = r.x1 / wp.sqrt(zz + r.x1 * r.x1)
    n2z = r.y1 / wp.sqrt(zz + r.y1 * r.y1)
    n3z = -r.x0 / wp.sqrt(zz + r.x0 * r.x0)
    g0 = clamped_acos(-n0z * n1z)
    g1 = clamped_acos(-n1z * n2z)
    g2 = clamped_acos(-n2z * n3z)
    g3 = clamped_acos(-n3z * n0z)
    r.b0 = n0z
    r.b1 = n2z
    r.k = 2.0 * PI - g2 - g3
    r.solid_angle = g0 + g1 - r.k
    return r


@wp.func
def sample_spherical_rect(r: SphericalRect, u: float, v: float) -> wp.vec3:
    """Direction (not normalised) from the shading point to a point uniform in solid angle."""
    au = u * r.solid_angle + r.k
    fu = (wp.cos(au) * r.b0 - r.b1) / wp.sin(au)
    cu = wp.clamp(wp.where(fu > 0.0, 1.0, -1.0) / wp.sqrt(fu * fu + r.b0 * r.b0), -1.0, 1.0)
    xu = wp.clamp(-(cu * r.z0) / wp.sqrt(wp.max(1.0 - cu * cu, 1.0e-12)), r.x0, r.x1)
    d = wp.sqrt(xu * xu + r.z0 * r.z0)
    h0 = r.y0 / wp.sqrt(d * d + r.y0 * r.y0)
    h1 = r.y1 / wp.sqrt(d * d + r.y1 * r.y1)
    hv = h0 + v * (h1 - h0)
    yv = wp.clamp(hv * d / wp.sqrt(wp.max(1.0 - hv * hv, 1.0e-12)), r.y0, r.y1)
    return r.ex * xu + r.ey * yv + r.ez * r.z0


@wp.func
def solid_angle_is_safe(solid_angle: float) -> bool:
    return solid_angle > MIN_SOLID_ANGLE and solid_angle < MAX_SOLID_ANGLE


@wp.func
def sample_rect(light: LightView, x: wp.vec3, u: float, v: float) -> LightSample:
    s = LightSample()
    if wp.dot(x - light.center, light.n) <= 0.0:
        return s
    use_solid_angle = bool(False)
    to_light = wp.vec3(0.0, 0.0, 0.0)
    if light.solid_angle_sampling != 0:
        r = spherical_rect(light, x)
        if solid_angle_is_safe(r.solid_angle):
            use_solid_angle = True
            to_light = sample_spherical_rect(r, u, v)
            s.pdf_solid_angle = 1.0 / r.solid_angle
    if not use_solid_angle:
        to_light = light.center + light.u * (2.0 * u - 1.0) + light.v * (2.0 * v - 1.0) - x
    s.distance = wp.length(to_light)
    s.wi = to_light / s.distance
    cos_light = -wp.dot(s.wi, light.n)
    if not use_solid_angle:
        s.pdf_solid_angle = wp.where(cos_light > 0.0, s.distance * s.distance / (cos_light * light.area), 0.0)
    s.radiance = light.radiance
    return s


@wp.func
def hit_rect(light: LightView, x: wp.vec3, wi: wp.vec3) -> LightHit:
    hit = LightHit()
    hit.distance = -1.0
    cos_light = -wp.dot(wi, light.n)
    if cos_light <= 0.0:
        return hit
    t = -wp.dot(light.center - x, light.n) / cos_light
    if t <= 0.0:
        return hit
    d = x + wi * t - light.center
    # Coordinates along the two half edges, which need not be at right angles: Cramer's rule in the plane.
    uu = wp.dot(light.u, light.u)
    vv = wp.dot(light.v, light.v)
    uv = wp.dot(light.u, light.v)
    du = wp.dot(d, light.u)
    dv = wp.dot(d, light.v)
    determinant = uu * vv - uv * uv
    if wp.abs(du * vv - dv * uv) > determinant or wp.abs(dv * uu - du * uv) > determinant:
        return hit
    hit.distance = t
    hit.pdf_solid_angle = t * t / (cos_light * light.area)
    if light.solid_angle_sampling != 0:
        r = spherical_rect(light, x)
        if solid_angle_is_safe(r.solid_angle):
            hit.pdf_solid_angle = 1.0 / r.solid_angle
    return hit
