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
    """Solver kernel: (first cell, moments, shares, min_share) -> shares in place."""
    count = layout.strategies
    vec_k = layout.vec
    vec_s = wp.types.vector(length=count, dtype=wp.float32)
    posterior = layout.offset("posterior")

    def expectation(first: int, moments: wp.array(dtype=vec_k), shares: wp.array(dtype=vec_s), min_share: float):
        cell = first + wp.tid()
        sums = moments[cell]
        total = wp.float64(0.0)
        for s in range(wp.static(count)):
            total += sums[wp.static(posterior) + s]
        # No light was found, or it is out of range: there is nothing to learn from, and the shares stay.
        if not (total > wp.float64(0.0)) or not wp.isfinite(total):
            return
        # Every strategy keeps a part of the samples, so that it stays explored.
        rest = 1.0 - wp.static(float(count)) * min_share
        result = vec_s()
        for s in range(wp.static(count)):
            result[s] = min_share + rest * float(sums[wp.static(posterior) + s] / total)
        shares[cell] = result

    return expectation
