"""Maps from the unit square to directions and points, each with its density beside it."""

import warp as wp

wp.set_module_options({"enable_backward": False})

PI = wp.constant(3.14159265358979)
INV_PI = wp.constant(0.318309886183791)


@wp.func
def sin_cos_eighth(x: float) -> wp.vec2:
    """(sin x, cos x) for |x| <= pi / 4 by their Taylor polynomials, to within 2e-7: several times faster on the CPU."""
    x2 = x * x
    sin_x = x * (1.0 + x2 * (-1.0 / 6.0 + x2 * (1.0 / 120.0 - x2 * (1.0 / 5040.0 - x2 / 362880.0))))
    cos_x = 1.0 + x2 * (-0.5 + x2 * (1.0 / 24.0 - x2 * (1.0 / 720.0 - x2 / 40320.0)))
    return wp.vec2(sin_x, cos_x)


@wp.func
def square_to_disk(u: float, v: float) -> wp.vec2:
    """Uniform on the unit disk, keeping neighbours together.

    Reference: Shirley and Chiu (1997), "A Low Distortion Map Between Disk and Square".
    """
    x = 2.0 * u - 1.0
    y = 2.0 * v - 1.0
    if x == 0.0 and y == 0.0:
        return wp.vec2(0.0, 0.0)
    if wp.abs(x) > wp.abs(y):
        turn = sin_cos_eighth(0.25 * PI * (y / x))
        return wp.vec2(x * turn[1], x * turn[0])
    turn = sin_cos_eighth(0.25 * PI * (x / y))
    return wp.vec2(y * turn[0], y * turn[1])


@wp.func
def square_to_cosine_hemisphere(u: float, v: float) -> wp.vec3:
    """Density cos(theta) / pi about +Z (Malley's method)."""
    d = square_to_disk(u, v)
    return wp.vec3(d[0], d[1], wp.sqrt(wp.max(0.0, 1.0 - d[0] * d[0] - d[1] * d[1])))


@wp.func
def square_to_uniform_hemisphere(u: float, v: float) -> wp.vec3:
    """Density 1 / (2 pi) about +Z, by Lambert's equal-area map of the disk."""
    d = square_to_disk(u, v)
    r2 = d[0] * d[0] + d[1] * d[1]
    stretch = wp.sqrt(wp.max(0.0, 2.0 - r2))
    return wp.vec3(d[0] * stretch, d[1] * stretch, 1.0 - r2)


@wp.func
def square_to_uniform_cone(u: float, v: float, one_minus_cos: float) -> wp.vec3:
    """Density 1 / (2 pi (1 - cos_max)) about +Z; takes 1 - cos_max so that narrow cones keep their digits."""
    d = square_to_disk(u, v)
    r2 = d[0] * d[0] + d[1] * d[1]
    height = one_minus_cos * r2
    stretch = wp.sqrt(one_minus_cos * wp.max(0.0, 2.0 - height))
    return wp.vec3(d[0] * stretch, d[1] * stretch, 1.0 - height)


@wp.func
def square_to_triangle(u: float, v: float) -> wp.vec2:
    """Barycentric coordinates of the first two corners, uniform in area.

    Reference: Heitz (2019), "A Low-Distortion Map Between Triangle and Square".
    """
    b0 = 0.5 * u
    b1 = 0.5 * v
    offset = b1 - b0
    if offset > 0.0:
        b1 = b1 + offset
    else:
        b0 = b0 - offset
    return wp.vec2(b0, b1)
