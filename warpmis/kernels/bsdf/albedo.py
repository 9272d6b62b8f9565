"""What GGX lobes reflect in all, and what they leave over for the layers below.

A lobe reflects F0 (E - B) + F90 B of the light that arrives from a direction. E and B are looked up by the cosine and
the roughness (device/albedo.py). E is below 1 because light that meets a second facet is left out; `compensation`
scales the lobe so that it is not lost.

References: Karis (2013), "Real Shading in Unreal Engine 4"; Turquin (2019), "Practical multiple scattering compensation
for microfacet models", equation 16.
"""

import warp as wp

from warpmis.kernels.bsdf.microfacet import SMOOTH_ALPHA, grazing_reflectance

wp.set_module_options({"enable_backward": False})

ONE = wp.constant(wp.vec3(1.0, 1.0, 1.0))


@wp.func
def white_albedo(table: wp.array2d(dtype=wp.vec2), cos_theta: float, alpha: float) -> wp.vec2:
    """(E, B), between the table's four nearest entries; exact for a mirror."""
    if alpha < SMOOTH_ALPHA:
        m = wp.clamp(1.0 - cos_theta, 0.0, 1.0)
        m2 = m * m
        return wp.vec2(1.0, m2 * m2 * m)
    y = wp.sqrt(wp.sqrt(wp.min(alpha, 1.0))) * float(table.shape[0] - 1)
    x = wp.sqrt(wp.clamp(cos_theta, 0.0, 1.0)) * float(table.shape[1] - 1)
    row = wp.min(int(y), table.shape[0] - 2)
    column = wp.min(int(x), table.shape[1] - 2)
    low = wp.lerp(table[row, column], table[row, column + 1], x - float(column))
    high = wp.lerp(table[row + 1, column], table[row + 1, column + 1], x - float(column))
    return wp.lerp(low, high, y - float(row))


@wp.func
def compensation(f0: wp.vec3, white: wp.vec2) -> wp.vec3:
    """Factor on a lobe that brings back what masking loses, tinted by the second facet."""
    return ONE + f0 * ((1.0 - white[0]) / white[0])


@wp.func
def lobe_albedo(f0: wp.vec3, white: wp.vec2) -> wp.vec3:
    """What a lobe reflects in all, compensation included."""
    single = f0 * (white[0] - white[1]) + ONE * (grazing_reflectance(wp.max(f0)) * white[1])
    return wp.cw_mul(single, compensation(f0, white))


@wp.func
def coat_albedo(table: wp.array2d(dtype=wp.vec2), coat: float, f0: float, alpha: float, cos_theta: float) -> float:
    """What a coat reflects in all. It is too dark for a second facet to matter."""
    white = white_albedo(table, cos_theta, alpha)
    return coat * (f0 * (white[0] - white[1]) + grazing_reflectance(f0) * white[1])
