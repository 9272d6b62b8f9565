"""Moments relative to a pixel's brightness, pooled over its neighbours, which have seen much the same.

Each pixel's moments are divided by its samples and by the power of its mean that makes them unitless, then averaged
over a square of pixels, along the rows first, then along the columns. A neighbour counts by how similar its first hits
are, in normal, albedo and depth, so that the allocation does not bleed over edges. The mean of the whole picture joins
in with the weight of PRIOR samples: what holds elsewhere is likelier than what a few samples say.

Reference: Schied et al. (2017), "Spatiotemporal Variance-Guided Filtering", for the edge-stopping weights; Pham and van
Vliet (2005), "Separable Bilateral Filtering for Fast Video Preprocessing", for the two passes.
"""

import warp as wp

from warpmis.device.kernel_factory import KernelFunction, kernel_factory
from warpmis.device.views import FilmView
from warpmis.kernels.moments import Layout

# How far apart first hits may be and still count by 1/e: squared distance of unit normals, of albedos, and relative
# distance in depth.
NORMAL_SPREAD = 0.1
ALBEDO_SPREAD = 0.02
DEPTH_SPREAD = 0.1

# A pixel's brightness is the mean of the 3 x 3 about it, plus this share of the whole picture's.
FLOOR = 1e-3

# Samples that the whole picture's mean counts for.
PRIOR = 20.0

# A neighbour that counts for less is left out.
LEAST_SIMILARITY = 1e-3


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
def similarity(a: Guide, b: Guide) -> float:
    if a.hit != b.hit:
        return 0.0
    normal = wp.length_sq(a.normal - b.normal) / wp.static(NORMAL_SPREAD)
    albedo = wp.length_sq(a.albedo - b.albedo) / wp.static(ALBEDO_SPREAD)
    depth = (a.depth - b.depth) / wp.max(wp.static(DEPTH_SPREAD) * a.depth, 1.0e-20)
    return wp.exp(-(normal + albedo + depth * depth))


@kernel_factory
def make_relative(layout: Layout) -> KernelFunction:
    """Kernel: (first pixel, moments, film, width, height, floor) -> each pixel's relative moments, weight, guide and
    brightness.

    The weight is 1, or 0 where nothing was sampled. The brightness is the pixel's own mean, at most that of its
    surroundings: few samples of rare bright light tell too much, and at the edge of a highlight its surroundings do.
    """
    vec_k = layout.vec
    vec_r = layout.relative_vec
    mean = layout.offset("mean")
    size = layout.size
    powers = tuple(layout.power(entry) for entry in range(size))

    def relative(
        first: int,
        moments: wp.array(dtype=vec_k),
        film: FilmView,
        width: int,
        height: int,
        floor: wp.float64,
        own: wp.array(dtype=vec_r),
        weights: wp.array(dtype=float),
        guides: wp.array(dtype=Guide),
        own_brightness: wp.array(dtype=float),
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
        scale = wp.float64(0.0)
        if brightness > wp.float64(0.0) and wp.isfinite(brightness):
            scale = wp.float64(1.0) / brightness
        weights[pixel] = 0.0
        own_brightness[pixel] = 0.0
        part = vec_r()
        if film.accepted[pixel] > 0:
            weights[pixel] = 1.0
            per_sample = wp.float64(1.0) / wp.float64(film.accepted[pixel])
            own_brightness[pixel] = float(wp.min(moments[pixel][wp.static(mean)] * per_sample, brightness))
            for k in range(wp.static(size)):
                if wp.static(powers[k] == 0):
                    part[k] = float(moments[pixel][k] * per_sample)
                if wp.static(powers[k] == 1):
                    part[k] = float(moments[pixel][k] * per_sample * scale)
                if wp.static(powers[k] == 2):
                    part[k] = float(moments[pixel][k] * per_sample * scale * scale)
        own[pixel] = part
        guides[pixel] = guide_of(film, pixel)

    return relative


@kernel_factory
def make_row_sums(layout: Layout) -> KernelFunction:
    """Kernel, a thread a row: (means, weights, width) -> sums over the pixels that found light, and their number."""
    vec_r = layout.relative_vec
    mean = layout.offset("mean")

    def row_sums(
        means: wp.array(dtype=vec_r),
        weights: wp.array(dtype=float),
        width: int,
        sums: wp.array(dtype=vec_r),
        counts: wp.array(dtype=float),
    ):
        row = wp.tid()
        total = vec_r()
        count = float(0.0)
        for x in range(width):
            own = means[row * width + x]
            if weights[row * width + x] > 0.0 and own[wp.static(mean + 1)] > 0.0 and wp.isfinite(own):
                total += own
                count += 1.0
        sums[row] = total
        counts[row] = count

    return row_sums


@kernel_factory
def make_pool(layout: Layout) -> KernelFunction:
    """Kernel: (first, means, weights, guides, width, height, radius, along x or y, prior, its weight) -> means and
    weights of a line of pixels with the prior among them."""
    vec_r = layout.relative_vec

    def pool(
        first: int,
        means: wp.array(dtype=vec_r),
        weights: wp.array(dtype=float),
        guides: wp.array(dtype=Guide),
        width: int,
        height: int,
        radius: int,
        along_x: int,
        prior: vec_r,
        prior_weight: float,
        pooled: wp.array(dtype=vec_r),
        pooled_weights: wp.array(dtype=float),
    ):
        pixel = first + wp.tid()
        center = guides[pixel]
        at = pixel / width
        length = height
        stride = width
        if along_x != 0:
            at = pixel % width
            length = width
            stride = 1
        total = vec_r()
        weight = float(0.0)
        for step in range(wp.max(-radius, -at), wp.min(radius, length - 1 - at) + 1):
            other = pixel + step * stride
            w = weights[other]
            if step != 0 and w > 0.0:
                w = w * similarity(center, guides[other])
            if w > wp.static(LEAST_SIMILARITY):
                weight += w
                total += means[other] * w
        if weight > 0.0:
            total = (total + prior * prior_weight) / (weight + prior_weight)
        pooled[pixel] = total
        pooled_weights[pixel] = weight

    return pool
