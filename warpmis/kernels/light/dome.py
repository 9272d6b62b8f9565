"""The environment: constant over the sphere, or a lat-long picture sampled by its luminance."""

import warp as wp

from warpmis.device.views import DomeView
from warpmis.kernels.light.distant import INFINITE_DISTANCE
from warpmis.kernels.light.records import LightSample
from warpmis.kernels.rng import ONE_MINUS_EPSILON
from warpmis.kernels.shading_frame import frame_from_normal, to_world
from warpmis.kernels.warps import INV_PI, PI, square_to_uniform_hemisphere

wp.set_module_options({"enable_backward": False})


@wp.func
def dome_direction(u: float, v: float) -> wp.vec3:
    """Direction in the dome's frame: u = 0.25 looks along +X, u = 0.5 along +Z, v = 0 is the pole +Y."""
    sin_theta = wp.sin(PI * v)
    return wp.vec3(sin_theta * wp.sin(2.0 * PI * u), wp.cos(PI * v), -sin_theta * wp.cos(2.0 * PI * u))


@wp.func
def dome_uv(d: wp.vec3) -> wp.vec2:
    """Inverse of dome_direction, in [0, 1)."""
    u = wp.atan2(d[0], -d[2]) / (2.0 * PI)
    if u < 0.0:
        u = u + 1.0
    v = wp.atan2(wp.sqrt(d[0] * d[0] + d[2] * d[2]), d[1]) / PI
    return wp.vec2(wp.min(u, ONE_MINUS_EPSILON), wp.min(v, ONE_MINUS_EPSILON))


@wp.func
def dome_radiance(dome: DomeView, uv: wp.vec2) -> wp.vec3:
    """Bilinear, wrapping around in u and clamped at the poles."""
    x = uv[0] * float(dome.columns) - 0.5
    y = uv[1] * float(dome.rows) - 0.5
    x_floor = wp.floor(x)
    y_floor = wp.floor(y)
    fx = x - x_floor
    fy = y - y_floor
    column0 = (int(x_floor) + dome.columns) % dome.columns
    column1 = (column0 + 1) % dome.columns
    row0 = wp.clamp(int(y_floor), 0, dome.rows - 1)
    row1 = wp.clamp(int(y_floor) + 1, 0, dome.rows - 1)
    upper = dome.picture[row0, column0] * (1.0 - fx) + dome.picture[row0, column1] * fx
    lower = dome.picture[row1, column0] * (1.0 - fx) + dome.picture[row1, column1] * fx
    return wp.cw_mul(upper * (1.0 - fy) + lower * fy, dome.radiance)


@wp.func
def dome_pdf(dome: DomeView, uv: wp.vec2) -> float:
    """Solid angle density of sample_dome_picture: the density over (u, v) / (2 pi^2 sin theta)."""
    row = wp.min(int(uv[1] * float(dome.rows)), dome.rows - 1)
    column = wp.min(int(uv[0] * float(dome.columns)), dome.columns - 1)
    sin_theta = wp.sin(PI * uv[1])
    if sin_theta <= 0.0:
        return 0.0
    return dome.density[row, column] / (2.0 * PI * PI * sin_theta)


@wp.func
def upper_bound(cdf: wp.array(dtype=float), begin: int, count: int, value: float) -> int:
    """First entry of cdf[begin : begin + count] that exceeds value, counted from begin."""
    first = int(0)
    last = int(count - 1)
    while first < last:
        middle = (first + last) / 2
        if cdf[begin + middle] <= value:
            first = middle + 1
        else:
            last = middle
    return first


@wp.func
def upper_bound_by_index(cdf: wp.array2d(dtype=float), index: wp.array2d(dtype=int), row: int, value: float) -> int:
    """First column of the row whose cumulative share exceeds value, in [0, 1).

    index[row, k]: the same for k parts of 2^n: what is left to search is a column or two.

    Reference: Chen, Asau (1974), "On Generating Random Variates from an Empirical Distribution".
    """
    parts = index.shape[1] - 1
    part = wp.min(int(value * float(parts)), parts - 1)
    first = index[row, part]
    last = index[row, part + 1]
    return first + upper_bound(cdf[row], first, last - first + 1, value)


@wp.func
def sample_dome_picture(dome: DomeView, u: float, v: float) -> LightSample:
    """A row by the marginal distribution, a column within it, a place uniform in the texel."""
    s = LightSample()
    row = upper_bound_by_index(dome.marginal, dome.marginal_index, 0, v)
    row_begin = float(0.0)
    if row > 0:
        row_begin = dome.marginal[0, row - 1]
    y = (v - row_begin) / wp.max(dome.marginal[0, row] - row_begin, 1.0e-30)
    column = upper_bound_by_index(dome.conditional, dome.conditional_index, row, u)
    column_begin = float(0.0)
    if column > 0:
        column_begin = dome.conditional[row, column - 1]
    x = (u - column_begin) / wp.max(dome.conditional[row, column] - column_begin, 1.0e-30)
    uv = wp.vec2(
        (float(column) + wp.clamp(x, 0.0, 0.9999)) / float(dome.columns),
        (float(row) + wp.clamp(y, 0.0, 0.9999)) / float(dome.rows),
    )
    s.wi = dome.to_world * dome_direction(uv[0], uv[1])
    s.distance = INFINITE_DISTANCE
    s.pdf_solid_angle = dome_pdf(dome, uv)
    s.radiance = dome_radiance(dome, uv)
    return s


@wp.func
def sample_dome_constant(dome: DomeView, n: wp.vec3, u: float, v: float) -> LightSample:
    """Uniform over the hemisphere about n."""
    s = LightSample()
    s.wi = to_world(frame_from_normal(n), square_to_uniform_hemisphere(u, v))
    s.distance = INFINITE_DISTANCE
    s.pdf_solid_angle = 0.5 * INV_PI
    s.radiance = dome.radiance
    return s


@wp.func
def pdf_dome_constant(n: wp.vec3, wi: wp.vec3) -> float:
    return wp.where(wp.dot(n, wi) > 0.0, 0.5 * INV_PI, 0.0)
