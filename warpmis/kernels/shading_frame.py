"""Orthonormal frames and the colour weights that turn RGB into luminance."""

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.struct
class Frame:
    """Tangent s, bitangent t and normal n, orthonormal and right-handed."""

    s: wp.vec3
    t: wp.vec3
    n: wp.vec3


@wp.func
def frame_from_normal(n: wp.vec3) -> Frame:
    """Reference: Duff et al. (2017), "Building an Orthonormal Basis, Revisited", JCGT 6(1), listing 3."""
    sign = wp.where(n[2] >= 0.0, 1.0, -1.0)
    a = -1.0 / (sign + n[2])
    b = n[0] * n[1] * a
    frame = Frame()
    frame.s = wp.vec3(1.0 + sign * n[0] * n[0] * a, sign * b, -sign * n[0])
    frame.t = wp.vec3(b, sign + n[1] * n[1] * a, -n[1])
    frame.n = n
    return frame


@wp.func
def to_local(frame: Frame, v: wp.vec3) -> wp.vec3:
    return wp.vec3(wp.dot(v, frame.s), wp.dot(v, frame.t), wp.dot(v, frame.n))


@wp.func
def to_world(frame: Frame, v: wp.vec3) -> wp.vec3:
    return frame.s * v[0] + frame.t * v[1] + frame.n * v[2]


@wp.func
def luminance(color: wp.vec3) -> float:
    """Relative luminance of linear Rec.709."""
    return 0.2126 * color[0] + 0.7152 * color[1] + 0.0722 * color[2]


@wp.func
def max_abs(v: wp.vec3) -> float:
    return wp.max(wp.abs(v[0]), wp.max(wp.abs(v[1]), wp.abs(v[2])))
