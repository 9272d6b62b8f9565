"""Expectation maximisation: the mixture that is nearest to the integrand in Kullback and Leibler's sense.

    a_s <- E[F a_s q_s] / E[F]

With F in place of F^2 a bright sample weighs less than in the moments of the variance, so few samples suffice; the
optimum is that of another measure, which agrees with the least variance where a mixture can equal the integrand.

Reference: Cappe, Douc, Guillin, Marin, Robert (2008), "Adaptive Importance Sampling in General Mixture Classes".
"""

import warp as wp

from warpmis.device.kernel_factory import KernelFunction, kernel_factory
from warpmis.kernels.moments import Layout


@kernel_factory
def make_expectation(layout: Layout) -> KernelFunction:
    """Solver kernel: (first, moments, allocation, min_share) -> allocation in place."""
    count = layout.strategies
    vec_k = layout.vec
    vec_s = wp.types.vector(length=count, dtype=wp.float32)
    posterior = layout.offset("posterior")

    def expectation(first: int, moments: wp.array(dtype=vec_k), allocation: wp.array(dtype=vec_s), min_share: float):
        pixel = first + wp.tid()
        sums = moments[pixel]
        total = wp.float64(0.0)
        for s in range(wp.static(count)):
            total += sums[wp.static(posterior) + s]
        # No light was found, or it is out of range: nothing is known, the allocation stays.
        if not (total > wp.float64(0.0)) or not wp.isfinite(total):
            return
        # A part of the samples is for all strategies alike, so that each stays explored.
        left = 1.0 - wp.static(float(count)) * min_share
        shares = vec_s()
        for s in range(wp.static(count)):
            shares[s] = min_share + left * float(sums[wp.static(posterior) + s] / total)
        allocation[pixel] = shares

    return expectation
