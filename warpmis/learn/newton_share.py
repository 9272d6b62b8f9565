"""Newton in one variable: the share alpha of the first of two strategies.

    V' = -E[F^2 r],   V'' = 2 E[F^2 r^2],   r = q_1 - q_2,   alpha <- clamp(alpha - V' / V'', low, high)

The factor 2 matters: without it the iteration oscillates about the optimum for ever. One step from alpha = 1/2 clamped
to [0.25, 0.75] is Lu et al.'s closed form; steps until convergence, clamped to [0.1, 0.9], are Sbert et al.'s.

Reference: Lu, Pacanowski, Granier (2013); Sbert, Havran, Szirmay-Kalos (2019); Murray et al. (2020), equation 5.
"""

import warp as wp

from warpmis.device.kernel_factory import KernelFunction, kernel_factory
from warpmis.kernels.moments import Layout

# Below this share of M2 the second derivative is rounding: the densities are equal, and any allocation is as good.
FLAT = 1e-12


@kernel_factory
def make_newton_share(layout: Layout) -> KernelFunction:
    """Solver kernel for two strategies: (first cell, moments, shares, low, high) -> shares in place."""
    vec_k = layout.vec
    vec_s = wp.types.vector(length=2, dtype=wp.float32)

    def newton_share(
        first: int, moments: wp.array(dtype=vec_k), shares: wp.array(dtype=vec_s), low: float, high: float
    ):
        cell = first + wp.tid()
        sums = moments[cell]
        a = shares[cell]
        second_moment = wp.float64(a[0]) * sums[0] + wp.float64(a[1]) * sums[1]
        # No light was found, or it is out of range: there is nothing to learn from, and the shares stay.
        if not (second_moment > wp.float64(0.0)) or not wp.isfinite(second_moment):
            return
        # Divided first, so that no product overflows or vanishes.
        slope = sums[0] / second_moment - sums[1] / second_moment
        curvature = (sums[2] - sums[3] - sums[3] + sums[4]) / second_moment
        if not (curvature > wp.float64(wp.static(FLAT))):
            return
        share = wp.float64(a[0]) + slope / (wp.float64(2.0) * curvature)
        clamped = wp.clamp(float(share), low, high)
        shares[cell] = vec_s(clamped, 1.0 - clamped)

    return newton_share
