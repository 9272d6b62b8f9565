"""The device half of learning: per pixel, how the second moment of F responds to the allocation.

For F = f / p_a with q_s = p_s / p_a (estimators of the derivatives of M2(a) = E[F^2] over the shares a_s):

    m_s  = E[F^2 q_s]        so that  dM2 / da_s        = -m_s
    h_st = E[F^2 q_s q_t]    so that  d2M2 / da_s da_t  = 2 h_st

F^2 is sum_c g_c F_c^2 over the colours, g the luminance weights: convex in a, with no cancellation. The sums are in
float64, where no radiance that float32 holds can overflow when squared.

A method may ask for more (Method.statistics), Y being the luminance of F:

    mean        E[Y] and E[F^2]
    posterior   E[Y a_s q_s]: the part of the light that strategy s samples
    cost        E[A q_s + B]: cost of a path, had strategy s alone drawn its direction. A is the cost before Russian
                roulette sets in. From there on a path lives in proportion to its throughput f / p_a, so that all
                allocations spend the same on this part, B

Of next-event estimation's light sample and BSDF sample (path/weighted_pair.py) there are no moments but these, F being
what both bring straight from the lights:

    between_rounds  number of rounds; then of each sample's part of Y: sums of the present round, sums of all rounds,
                    and the variance of a round's sum (learn/variance_aware.py)
    control         E[F c] for each colour, and E[c^2], of the control c

Reference: Sbert, Havran, Szirmay-Kalos (2019); Murray et al. (2020), equations 5 and 10.
"""

from dataclasses import dataclass
from types import SimpleNamespace

import warp as wp

from warpmis.kernels.shading_frame import luminance

wp.set_module_options({"enable_backward": False})

# Cost of a shadow ray, in units of a path's ray with the vertex at its end: fitted by scripts/bench/cost.py.
SHADOW_RAY_COST = wp.constant(0.5)


@dataclass(frozen=True)
class Layout:
    """Where each number stands in a pixel's vector: S first moments, the upper triangle of the S x S second ones row
    by row, then what `statistics` names. -1: not there."""

    strategies: int
    statistics: tuple[str, ...] = ()

    def _sizes(self) -> dict[str, int]:
        count = self.strategies
        sizes = {"mean": 2, "posterior": count, "cost": count, "between_rounds": 7, "control": 4}
        return {name: sizes[name] for name in self.statistics}

    @property
    def second(self) -> int:
        return self.strategies

    def offset(self, statistic: str) -> int:
        at = self.strategies + self.strategies * (self.strategies + 1) // 2
        for name, size in self._sizes().items():
            if name == statistic:
                return at
            at += size
        return -1

    def power(self, entry: int) -> int:
        """How often radiance is a factor of the entry: 2 for moments of F^2, 1 for those of F, 0 for costs, controls
        and numbers."""
        powers = {
            "mean": (1, 2),
            "posterior": (1,) * self.strategies,
            "cost": (0,) * self.strategies,
            "between_rounds": (0, 1, 1, 1, 1, 2, 2),
            "control": (1, 1, 1, 0),
        }
        for name in self.statistics:
            place = entry - self.offset(name)
            if 0 <= place < len(powers[name]):
                return powers[name][place]
        return 2

    @property
    def size(self) -> int:
        return self.strategies + self.strategies * (self.strategies + 1) // 2 + sum(self._sizes().values())

    @property
    def vec(self) -> type:
        return wp.types.vector(length=max(self.size, 1), dtype=wp.float64)

    @property
    def relative_vec(self) -> type:
        """As `vec`, for moments relative to the brightness (learn/pooling.py), whose range float32 holds."""
        return wp.types.vector(length=max(self.size, 1), dtype=wp.float32)


@wp.func
def squared(F: wp.vec3) -> wp.float64:
    r = wp.float64(F[0])
    g = wp.float64(F[1])
    b = wp.float64(F[2])
    return wp.float64(0.2126) * r * r + wp.float64(0.7152) * g * g + wp.float64(0.0722) * b * b


def make_moments(layout: Layout) -> SimpleNamespace:
    """The functions `add` and `add_statistics`, and their accumulator type vec_k."""
    count = layout.strategies
    vec_s = wp.types.vector(length=max(count, 1), dtype=wp.float32)
    vec_k = layout.vec
    mean = layout.offset("mean")
    posterior = layout.offset("posterior")
    cost = layout.offset("cost")

    @wp.func
    def add(sums: vec_k, F: wp.vec3, q: vec_s) -> vec_k:
        """The moments with one more sample in them."""
        F2 = squared(F)
        for s in range(wp.static(count)):
            F2_q = F2 * wp.float64(q[s])
            sums[s] += F2_q
            for t in range(wp.static(count)):
                if wp.static(t >= s):
                    sums[wp.static(count + s * count - s * (s - 1) // 2 + t - s)] += F2_q * wp.float64(q[t])
        return sums

    @wp.func
    def add_statistics(
        sums: vec_k,
        F: wp.vec3,
        early_cost: float,
        late_cost: float,
        q: vec_s,
        a: vec_s,
    ) -> vec_k:
        """The method's statistics with one more sample of the mixture in them."""
        y = wp.float64(luminance(F))
        for s in range(wp.static(count)):
            if wp.static(posterior >= 0):
                sums[wp.static(posterior + s)] += y * wp.float64(a[s] * q[s])
            if wp.static(cost >= 0):
                sums[wp.static(cost + s)] += wp.float64(early_cost * q[s] + late_cost)
        if wp.static(mean >= 0):
            sums[wp.static(mean)] += y
            sums[wp.static(mean + 1)] += squared(F)
        return sums

    return SimpleNamespace(add=add, add_statistics=add_statistics, vec_k=vec_k)
