"""Moments relative to a pixel's brightness, pooled over its neighbours: what one pixel has seen, the next need not.

Each pixel's moments are divided by its samples and by the power of its mean that makes them unitless, then averaged
over a square of pixels. A neighbour counts by how alike its first hits are, in normal, albedo and depth, so that the
allocation does not bleed over edges.

Reference: Schied et al. (2017), "Spatiotemporal Variance-Guided Filtering", for the edge-stopping weights.
"""

from functools import cache
from zlib import crc32

import warp as wp

from warpmis.device.views import FilmView
from warpmis.kernels.moments import Layout

# How far apart first hits may be and still count by 1/e: squared distance of unit normals, of albedos, and relative
# distance in depth.
NORMAL_SPREAD = 0.1
ALBEDO_SPREAD = 0.02
DEPTH_SPREAD = 0.1

# Every other pixel of the square is pooled: a quarter of the work for nearly as wide a view.
STRIDE = 2

# The mean of a pixel is that of the 3 x 3 about it, and at least this share of the whole picture's.
FLOOR = 1e-3


@wp.struct
class Guide:
    """What the first hits of a pixel look like on average."""

    normal: wp.vec3
    albedo: wp.vec3
    depth: float
    hit: float


@wp.func
def guide_of(film: FilmView, pixel: int) -> Guide:
    g = Guide()
    hits = wp.float64(film.hits[pixel])
    if hits > wp.float64(0.0):
        g.normal = wp.normalize(wp.vec3(film.normal[pixel]))
        g.albedo = wp.vec3(film.albedo[pixel] / wp.float64(film.accepted[pixel]))
        g.depth = float(film.depth[pixel] / hits)
        g.hit = 1.0
    return g


@wp.func
def alike(a: Guide, b: Guide) -> float:
    if a.hit != b.hit:
        return 0.0
    normal = wp.length_sq(a.normal - b.normal) / wp.static(NORMAL_SPREAD)
    albedo = wp.length_sq(a.albedo - b.albedo) / wp.static(ALBEDO_SPREAD)
    depth = (a.depth - b.depth) / wp.max(wp.static(DEPTH_SPREAD) * a.depth, 1.0e-20)
    return wp.exp(-(normal + albedo + depth * depth))


@cache
def make_scale(layout: Layout) -> wp.Kernel:
    """Kernel: (first, moments, film, width, height, floor) -> one over each pixel's mean."""
    vec_k = layout.vec
    mean = layout.offset("mean")

    @wp.kernel(module="unique", enable_backward=False)
    def scale(
        first: int,
        moments: wp.array(dtype=vec_k),
        film: FilmView,
        width: int,
        height: int,
        floor: wp.float64,
        scales: wp.array(dtype=wp.float64),
    ):
        pixel = first + wp.tid()
        total = wp.float64(0.0)
        samples = wp.float64(0.0)
        for dy in range(-1, 2):
            for dx in range(-1, 2):
                x = pixel % width + dx
                y = pixel / width + dy
                if x >= 0 and x < width and y >= 0 and y < height:
                    total += moments[y * width + x][wp.static(mean)]
                    samples += wp.float64(film.accepted[y * width + x])
        brightness = floor
        if samples > wp.float64(0.0):
            brightness += total / samples
        scales[pixel] = wp.float64(0.0)
        if brightness > wp.float64(0.0) and wp.isfinite(brightness):
            scales[pixel] = wp.float64(1.0) / brightness

    return scale


@cache
def make_pool(layout: Layout) -> wp.Kernel:
    """Kernel: (first, moments, scales, film, width, height, radius) -> relative moments, pooled."""
    vec_k = layout.vec
    size = layout.size
    powers = tuple(layout.power(entry) for entry in range(size))
    signature = crc32(repr(layout).encode()) >> 1  # as in kernels/trace.py

    @wp.kernel(module="unique", enable_backward=False)
    def pool(
        first: int,
        moments: wp.array(dtype=vec_k),
        scales: wp.array(dtype=wp.float64),
        film: FilmView,
        width: int,
        height: int,
        radius: int,
        pooled: wp.array(dtype=vec_k),
    ):
        if wp.static(signature) < 0:
            return
        pixel = first + wp.tid()
        center = guide_of(film, pixel)
        total = vec_k()
        weight = wp.float64(0.0)
        reach = radius / wp.static(STRIDE)
        for row in range(-reach, reach + 1):
            for column in range(-reach, reach + 1):
                x = pixel % width + wp.static(STRIDE) * column
                y = pixel / width + wp.static(STRIDE) * row
                if x >= 0 and x < width and y >= 0 and y < height:
                    other = y * width + x
                    samples = wp.float64(film.accepted[other])
                    w = float(1.0)
                    if other != pixel:
                        w = alike(center, guide_of(film, other))
                    if w > 1.0e-3 and samples > wp.float64(0.0):
                        weight += wp.float64(w)
                        scale = scales[other]
                        part = moments[other] * (wp.float64(w) / samples)
                        for k in range(wp.static(size)):
                            if wp.static(powers[k] == 1):
                                part[k] = part[k] * scale
                            if wp.static(powers[k] == 2):
                                part[k] = part[k] * scale * scale
                        total += part
        if weight > wp.float64(0.0):
            total = total / weight
        pooled[pixel] = total

    return pool
