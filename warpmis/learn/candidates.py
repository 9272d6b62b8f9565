"""The best of a grid of allocations, each one's variance told from the samples of any other.

A sample taken with p_a tells the second moment that a candidate a' would have had, for F' = f / p_a':

    M2(a') = E[F^2 p_a / p_a'],    p_a' / p_a = sum_s a'_s q_s

(what Russian roulette changes in it: kernels/roulette.py). This is exact however far a' is from a, where Newton's
quadratic model is not, and it adds up over rounds whatever their allocations. With the choices of strategy stratified,
the variance between the strategies' own means is not paid:

    V(a') = M2(a') - sum_s a'_s mu_s^2,    mu_s = E[F' q_s p_a / p_a']

The best is the least V, or V + weight x cost if the samples are pairs of next-event estimation (kernels/moments.py).
That is then among the candidates. Its cost is known, and from it a mixture's: without the shadow ray, and where the
lights draw the direction, with what follows before Russian roulette at LIGHT_COST for those directions that can
contribute, and none for the others. A pixel that goes on by next-event estimation has shares of 0.

Reference: Veach (1997), section 9.2, the multi-sample and the one-sample model; Sbert, Havran, Szirmay-Kalos (2018),
"Multiple Importance Sampling Revisited: Breaking the Bounds", for the deterministic mixture's variance.
"""

import warp as wp

from warpmis.device.kernel_factory import KernelFunction, kernel_factory
from warpmis.kernels.moments import CANDIDATES, SHADOW_RAY_COST, Layout

# Cost of what follows a direction that the lights drew, in units of what follows one that the BSDF drew:
# scripts/bench/cost.py.
LIGHT_COST = 0.85


# Of a round that ends before its time, stratified choices give a strategy its share of n samples but for a number
# whose variance is about 0.5, so that of the squared distance between the strategies' means 0.5 / n is paid; here for
# n = 256.
# It decides where one strategy alone has no variance: all shares would seem as good.
UNEVEN = 0.5 / 256.0


# So much more the variance of a mixture counts than that of next-event estimation where samples lie on a lattice: of
# its points a strategy of the mixture has a share alone, and fewer points gain less (scripts/bench/sampler.py).
ON_A_LATTICE = 1.1


@kernel_factory
def make_candidates(layout: Layout, stratified: bool, lattice: bool = False) -> KernelFunction:
    """Solver kernel for two strategies: (first, relative moments, cost weight) -> allocation, (V, cost).

    V and cost are the chosen candidate's. The first strategy is the BSDF if the samples come in pairs.
    """
    vec_r = layout.relative_vec
    vec_s = wp.types.vector(length=2, dtype=wp.float32)
    shares = tuple(CANDIDATES)
    number = len(shares)
    mean = layout.offset("mean")
    candidates = layout.offset("candidates")
    pair = layout.offset("pair")
    of_mixture = ON_A_LATTICE if lattice and pair >= 0 else 1.0

    @wp.func
    def cost_of(known: vec_r, share: float) -> float:
        if wp.static(pair < 0):
            return 1.0
        reached = known[wp.static(pair)]
        onwards = known[wp.static(pair + 1)] - reached
        if reached > 0.0:
            alive = known[wp.static(pair + 3)] / reached
            by_lights = (1.0 - share) * alive * wp.static(LIGHT_COST)
            onwards = onwards * (share + by_lights)
        return reached + onwards + known[wp.static(pair + 2)]

    @wp.func
    def variance_of(second: float, first_mean: float, mean: float, share: float) -> float:
        """first_mean: mu_1; the other's follows, since the shares' means make up the whole."""
        if wp.static(not stratified):
            return second - mean * mean
        rest = mean - share * first_mean
        return second - share * first_mean * first_mean - rest * rest / (1.0 - share)

    @wp.func
    def unevenness(first_mean: float, mean: float, share: float) -> float:
        """What stratified choices leave of the variance between the strategies' means mu_s."""
        if wp.static(not stratified):
            return 0.0
        apart = (first_mean - mean) / (1.0 - share)
        return wp.static(UNEVEN) * apart * apart

    def best_candidate(
        first: int,
        moments: wp.array(dtype=vec_r),
        cost_weight: float,
        allocation: wp.array(dtype=vec_s),
        efficiency: wp.array(dtype=wp.vec2),
    ):
        pixel = first + wp.tid()
        known = moments[pixel]
        # No light was found, or it is out of range: nothing is known, the allocation stays.
        if not (known[wp.static(mean + 1)] > 0.0) or not wp.isfinite(known):
            return
        best = float(wp.inf)
        chosen = allocation[pixel]
        of_chosen = wp.vec2()
        for k in range(wp.static(number)):
            share = wp.static(shares[k])
            second = known[wp.static(candidates + 2 * k)]
            of_first = known[wp.static(candidates + 2 * k + 1)]
            variance = variance_of(second, of_first, known[wp.static(mean)], share)
            spent = cost_of(known, share)
            loss = wp.static(of_mixture) * variance + cost_weight * spent
            loss += unevenness(of_first, known[wp.static(mean)], share)
            if loss < best:
                best = loss
                chosen = vec_s(share, 1.0 - share)
                of_chosen = wp.vec2(variance, spent)
        if wp.static(pair >= 0):
            spent = known[wp.static(pair + 1)] + known[wp.static(pair + 2)]
            spent += SHADOW_RAY_COST * known[wp.static(pair + 3)]
            variance = known[wp.static(mean + 1)] - known[wp.static(mean)] * known[wp.static(mean)]
            if variance + cost_weight * spent < best:
                chosen = vec_s(0.0, 0.0)
                of_chosen = wp.vec2(variance, spent)
        allocation[pixel] = chosen
        efficiency[pixel] = of_chosen

    return best_candidate
