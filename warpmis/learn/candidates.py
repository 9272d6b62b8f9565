"""The best of a grid of allocations: the samples of any allocation predict the variance of each.

A sample taken with p_a says which second moment a candidate a' would have had, for F' = f / p_a':

    M2(a') = E[F^2 p_a / p_a'],    p_a' / p_a = sum_s a'_s q_s

(what Russian roulette changes in it: kernels/roulette.py). This is exact however far a' is from a, where Newton's
quadratic model is not, and it adds up over rounds whatever their allocations. Stratified choices of strategy do not pay
the variance between the strategies' own means:

    V(a') = M2(a') - sum_s a'_s mu_s^2,    mu_s = E[F' q_s p_a / p_a']

The best candidate has the least V + weight x cost. If the samples are pairs of next-event estimation
(kernels/moments.py), next-event estimation is one more candidate. Its cost is known, and from it a mixture's: without
the shadow ray; and where the lights draw the direction, with LIGHT_COST of what follows before Russian roulette for the
directions that can contribute, and without it for the others.

Reference: Veach (1997), section 9.2, the multi-sample and the one-sample model; Sbert, Havran, Szirmay-Kalos (2018),
"Multiple Importance Sampling Revisited: Breaking the Bounds", for the deterministic mixture's variance.
"""

import warp as wp

from warpmis.device.kernel_factory import KernelFunction, kernel_factory
from warpmis.kernels.moments import CANDIDATES, SHADOW_RAY_COST, Layout
from warpmis.learn.allocation import MIXTURE, NEXT_EVENT

# Cost of what follows a direction that the lights drew, in units of what follows one that the BSDF drew:
# scripts/bench/cost.py.
LIGHT_COST = 0.85

# In a round that ends early, stratified choices give a strategy its share of the n samples up to an error of variance
# 0.5 or so. That leaves 0.5 / n of the squared distance between the strategies' means; here for n = 256. It decides
# where one strategy alone has no variance: all shares would seem equally good.
UNEVEN = 0.5 / 256.0

# On a lattice the variance of a mixture counts so much more than that of next-event estimation: each strategy has only
# its share of the points, and fewer points gain less (scripts/bench/sampler.py).
ON_A_LATTICE = 1.1


@kernel_factory
def make_candidates(layout: Layout, stratified: bool, lattice: bool = False) -> KernelFunction:
    """Solver kernel for two strategies: (first cell, relative moments, cost weight) -> shares, estimators, (V, cost).

    V and cost are the chosen candidate's. If the samples come in pairs, the first strategy is the BSDF, and the kernel
    also chooses the estimator.
    """
    vec_r = layout.relative_vec
    vec_s = wp.types.vector(length=2, dtype=wp.float32)
    mean = layout.offset("mean")
    candidates = layout.offset("candidates")
    pair = layout.offset("pair")
    has_pairs = "pair" in layout.statistics
    mixture_factor = ON_A_LATTICE if lattice and has_pairs else 1.0

    @wp.func
    def mixture_cost(m: vec_r, share: float) -> float:
        if wp.static(not has_pairs):
            return 1.0
        reached = m[wp.static(pair)]
        onwards = m[wp.static(pair + 1)] - reached
        if reached > 0.0:
            alive = m[wp.static(pair + 3)] / reached
            by_lights = (1.0 - share) * alive * wp.static(LIGHT_COST)
            onwards = onwards * (share + by_lights)
        return reached + onwards + m[wp.static(pair + 2)]

    @wp.func
    def mixture_variance(second: float, first_mean: float, mean: float, share: float) -> float:
        """first_mean: mu_1; mu_2 follows, because both strategies' parts add up to the mean."""
        if wp.static(not stratified):
            return second - mean * mean
        rest = mean - share * first_mean
        return second - share * first_mean * first_mean - rest * rest / (1.0 - share)

    @wp.func
    def unevenness(first_mean: float, mean: float, share: float) -> float:
        """The part of the variance between the strategies' means mu_s that stratified choices leave."""
        if wp.static(not stratified):
            return 0.0
        distance = (first_mean - mean) / (1.0 - share)
        return wp.static(UNEVEN) * distance * distance

    def best_candidate(
        first: int,
        moments: wp.array(dtype=vec_r),
        cost_weight: float,
        shares: wp.array(dtype=vec_s),
        estimators: wp.array(dtype=wp.uint8),
        efficiency: wp.array(dtype=wp.vec2),
    ):
        cell = first + wp.tid()
        m = moments[cell]
        # No light was found, or it is out of range: there is nothing to learn from, and the decision stays.
        if not (m[wp.static(mean + 1)] > 0.0) or not wp.isfinite(m):
            return
        least = float(wp.inf)
        best = shares[cell]
        best_efficiency = wp.vec2()
        for k in range(wp.static(len(CANDIDATES))):
            share = wp.static(CANDIDATES[k])
            second = m[wp.static(candidates + 2 * k)]
            first_mean = m[wp.static(candidates + 2 * k + 1)]
            variance = mixture_variance(second, first_mean, m[wp.static(mean)], share)
            cost = mixture_cost(m, share)
            loss = wp.static(mixture_factor) * variance + cost_weight * cost
            loss += unevenness(first_mean, m[wp.static(mean)], share)
            if loss < least:
                least = loss
                best = vec_s(share, 1.0 - share)
                best_efficiency = wp.vec2(variance, cost)
        if wp.static(has_pairs):
            cost = m[wp.static(pair + 1)] + m[wp.static(pair + 2)]
            cost += SHADOW_RAY_COST * m[wp.static(pair + 3)]
            variance = m[wp.static(mean + 1)] - m[wp.static(mean)] * m[wp.static(mean)]
            estimators[cell] = wp.uint8(wp.static(MIXTURE))
            if variance + cost_weight * cost < least:
                estimators[cell] = wp.uint8(wp.static(NEXT_EVENT))
                best_efficiency = wp.vec2(variance, cost)
        shares[cell] = best
        efficiency[cell] = best_efficiency

    return best_candidate
