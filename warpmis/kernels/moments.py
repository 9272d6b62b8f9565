"""The device half of learning: per pixel, how the second moment of F responds to the allocation.

For F = f / p_a with q_s = p_s / p_a (estimators of the derivatives of M2(a) = E[F^2] over the shares a_s):

    m_s  = E[F^2 q_s]        so that  dM2 / da_s        = -m_s
    h_st = E[F^2 q_s q_t]    so that  d2M2 / da_s da_t  = 2 h_st

F^2 is sum_c g_c F_c^2 over the colours, g the luminance weights: convex in a, with no cancellation. The sums are in
float64, where no radiance that float32 holds can overflow when squared.

Reference: Sbert, Havran, Szirmay-Kalos (2019); Murray et al. (2020), equations 5 and 10.
"""

from types import SimpleNamespace

import warp as wp

wp.set_module_options({"enable_backward": False})


def moment_count(strategies: int) -> int:
    """Numbers a pixel: S first moments, then the upper triangle of the S x S second ones, row by row."""
    return strategies + strategies * (strategies + 1) // 2


@wp.func
def squared(F: wp.vec3) -> wp.float64:
    r = wp.float64(F[0])
    g = wp.float64(F[1])
    b = wp.float64(F[2])
    return wp.float64(0.2126) * r * r + wp.float64(0.7152) * g * g + wp.float64(0.0722) * b * b


def make_moments(count: int) -> SimpleNamespace:
    """The function `add`, for `count` strategies, and its accumulator type vec_k."""
    vec_s = wp.types.vector(length=max(count, 1), dtype=wp.float32)
    vec_k = wp.types.vector(length=max(moment_count(count), 1), dtype=wp.float64)

    @wp.func
    def add(sums: vec_k, F: wp.vec3, q: vec_s) -> vec_k:
        """The sums with one more sample in them."""
        F2 = squared(F)
        for s in range(wp.static(count)):
            F2_q = F2 * wp.float64(q[s])
            sums[s] += F2_q
            for t in range(wp.static(count)):
                if wp.static(t >= s):
                    sums[wp.static(count + s * count - s * (s - 1) // 2 + t - s)] += F2_q * wp.float64(q[t])
        return sums

    return SimpleNamespace(add=add, vec_k=vec_k)
