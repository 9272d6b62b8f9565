"""The guide: directions drawn by what a cell has seen, over the cosine-warped hemisphere about the shading normal."""

import math

import warp as wp

from warpmis.device.cache_views import GUIDE_BINS, GUIDE_LEVELS, GUIDE_NODES
from warpmis.kernels.rng import ONE_MINUS_EPSILON
from warpmis.kernels.shading_frame import Frame
from warpmis.kernels.warps import INV_PI, square_to_disk

wp.set_module_options({"enable_backward": False})

# Where the finest level begins among the nodes of a cell.
FINEST = wp.constant(GUIDE_NODES - GUIDE_BINS * GUIDE_BINS)


@wp.func
def guide_frame(n: wp.vec3) -> Frame:
    """A frame that depends on the normal alone: a bin is nearly one direction in all of a cell."""
    frame = Frame()
    # No field of frames is smooth on the whole sphere. This one is torn at one direction, which walls seldom have.
    across = wp.cross(wp.vec3(0.48, 0.6, 0.64), n)
    if wp.dot(across, across) < 1.0e-6:
        across = wp.cross(wp.vec3(0.6, 0.64, 0.48), n)
    frame.s = wp.normalize(across)
    frame.t = wp.cross(n, frame.s)
    frame.n = n
    return frame


@wp.func
def eighths_of_turn(x: float) -> float:
    """atan(x) over pi / 4 for |x| <= 1, to within float32: several times faster on the CPU.

    Reference: Abramowitz, Stegun (1964), "Handbook of Mathematical Functions", equation 4.4.49.
    """
    x2 = x * x
    high = 0.1065626393 + x2 * (-0.0752896400 + x2 * (0.0429096138 + x2 * (-0.0161657367 + x2 * 0.0028662257)))
    low = 1.0 + x2 * (-0.3333314528 + x2 * (0.1999355085 + x2 * (-0.1420889944 + x2 * high)))
    return x * low * wp.static(4.0 / math.pi)


@wp.func
def to_square(frame: Frame, wi: wp.vec3) -> wp.vec2:
    """Where a direction lies in the square: the inverse of square_to_disk below the hemisphere's shadow on the disk."""
    x = wp.dot(wi, frame.s)
    y = wp.dot(wi, frame.t)
    r = wp.sqrt(x * x + y * y)
    if r <= 0.0:
        return wp.vec2(0.5, 0.5)
    if wp.abs(x) > wp.abs(y):
        a = wp.where(x > 0.0, r, -r)
        return wp.vec2(0.5 * (a + 1.0), 0.5 * (a * eighths_of_turn(y / x) + 1.0))
    a = wp.where(y > 0.0, r, -r)
    return wp.vec2(0.5 * (a * eighths_of_turn(x / y) + 1.0), 0.5 * (a + 1.0))


@wp.func
def from_square(frame: Frame, u: float, v: float) -> wp.vec3:
    """The direction of a place in the square."""
    disk = square_to_disk(u, v)
    height = wp.sqrt(wp.max(0.0, 1.0 - disk[0] * disk[0] - disk[1] * disk[1]))
    return frame.s * disk[0] + frame.t * disk[1] + frame.n * height


@wp.func
def bin_of(u: float, v: float) -> int:
    """The bin of a place in the square, in Morton order: children of a node stand together."""
    column = wp.clamp(int(u * float(GUIDE_BINS)), 0, wp.static(GUIDE_BINS - 1))
    row = wp.clamp(int(v * float(GUIDE_BINS)), 0, wp.static(GUIDE_BINS - 1))
    index = int(0)
    for bit in range(wp.static(GUIDE_LEVELS)):
        index += ((column >> bit) & 1) << (2 * bit)
        index += ((row >> bit) & 1) << (2 * bit + 1)
    return index


@wp.func
def pdf_guide(densities: wp.array(dtype=wp.float32), cell: int, place: wp.vec2, cos_theta: float) -> float:
    """Density of the guide in solid angle, for a direction at this place in the square and this cosine."""
    if cos_theta <= 0.0:
        return 0.0
    return densities[cell * GUIDE_NODES + FINEST + bin_of(place[0], place[1])] * cos_theta * INV_PI


@wp.func
def sample_guide(densities: wp.array(dtype=wp.float32), cell: int, u: float, v: float) -> wp.vec2:
    """A place in the square, down the levels: v chooses the row of two, u the column, and both are remapped.

    Reference: McCool, Harwood (1997), "Probability Trees".
    """
    level = cell * GUIDE_NODES
    parent = int(0)
    x = float(0.0)
    y = float(0.0)
    width = float(1.0)
    count = int(4)
    for _level in range(wp.static(GUIDE_LEVELS)):
        node = level + 4 * parent
        parent = 4 * parent
        width = 0.5 * width
        left = densities[node]
        right = densities[node + 1]
        upper_left = densities[node + 2]
        upper_right = densities[node + 3]
        lower = left + right
        upper = upper_left + upper_right
        v = v * (lower + upper)
        if v < lower:
            v = v / lower
        else:
            v = (v - lower) / upper
            y += width
            parent += 2
            left = upper_left
            right = upper_right
        u = u * (left + right)
        if u < left:
            u = u / left
        else:
            u = (u - left) / right
            x += width
            parent += 1
        level += count
        count = 4 * count
    return wp.vec2(
        x + width * wp.clamp(u, 0.0, ONE_MINUS_EPSILON),
        y + width * wp.clamp(v, 0.0, ONE_MINUS_EPSILON),
    )
