"""The device half of learning: per pixel, how the second moment of F responds to the allocation.

For F = f / p_a with q_s = p_s / p_a (estimators of the derivatives of M2(a) = E[F^2] over the shares a_s):

    m_s  = E[F^2 q_s]        so that  dM2 / da_s        = -m_s
    h_st = E[F^2 q_s q_t]    so that  d2M2 / da_s da_t  = 2 h_st

F^2 is sum_c g_c F_c^2 over the colours, g the luminance weights: convex in a, with no cancellation. The sums are in
float64, where no radiance that float32 holds can overflow when squared.

A method may ask for more (Method.statistics), Y being the luminance of F:

    mean        E[Y] and E[F^2]
    posterior   E[Y a_s q_s]: the part of the light that strategy s samples
    candidates  for each share c of CANDIDATES, with F' = f / p_c: E[F'^2 p_c / p_a] and E[Y' q'_1 p_c / p_a], the
                second moment of F' and the mean of its samples from the first strategy. The part of F that was found
                after Russian roulette, F_l, answers to c as kernels/roulette.py says
    cost        E[A q_s + B]: cost of a path, had strategy s alone drawn its direction. A is the cost before Russian
                roulette sets in. From there on a path lives in proportion to its throughput f / p_a, so that all
                allocations spend the same on this part, B
    pair        E[R], E[A], E[B] and E[D] of next-event estimation, which takes a light sample and a BSDF sample and
                weighs them by the balance heuristic with a sample each (Veach 1997, equation 9.8). R: 1 where the
                path came to the vertex; D: 1 where the light sample could contribute there, so that its shadow ray
                was traced, whose cost A leaves out

With `pair` the samples come two at a time, from next-event estimation: X_l = f_d / P at the light's direction, and at
the BSDF's X_d = f_d / P from the lights and Y = f_i / p_1 from everything else, where P = p_1 + p_2 and f = f_d + f_i.
The other statistics follow from them: with s = p_1 / P and p_c / P = c s + (1 - c)(1 - s) =: t at either direction,

    E[F'^2 p_c / p_a] = E[X_l^2 / t_l + (X_d^2 + 2 X_d Y + s_b Y^2) / t_b],
    E[Y' q'_1 p_c / p_a] = E[X_l s_l / t_l + (X_d + Y) s_b / t_b]

but for the late part of Y^2, whose density would have been t_b / s_b times that of the BSDF.

Reference: Sbert, Havran, Szirmay-Kalos (2019); Murray et al. (2020), equations 5 and 10.
"""

from dataclasses import dataclass
from types import SimpleNamespace

import warp as wp

from warpmis.kernels.roulette import late_response
from warpmis.kernels.shading_frame import luminance

wp.set_module_options({"enable_backward": False})

# Cost of a shadow ray, in units of a path's ray with the vertex at its end: fitted by scripts/bench/cost.py.
SHADOW_RAY_COST = wp.constant(0.5)

# Shares of the first of two strategies that are compared.
CANDIDATES = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)


@dataclass(frozen=True)
class Layout:
    """Where each number stands in a pixel's vector: S first moments, the upper triangle of the S x S second ones row
    by row, then what `statistics` names. -1: not there."""

    strategies: int
    statistics: tuple[str, ...] = ()

    def _sizes(self) -> dict[str, int]:
        count = self.strategies
        sizes = {"mean": 2, "posterior": count, "candidates": 2 * len(CANDIDATES), "cost": count, "pair": 4}
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
        """How often radiance is a factor of the entry: 2 for moments of F^2, 1 for those of F, 0 for costs."""
        powers = {
            "mean": (1, 2),
            "posterior": (1,) * self.strategies,
            "candidates": (2, 1) * len(CANDIDATES),
            "cost": (0,) * self.strategies,
            "pair": (0, 0, 0, 0),
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
    """The functions `add`, `add_statistics` and `add_pair`, and their accumulator type vec_k."""
    count = layout.strategies
    vec_s = wp.types.vector(length=max(count, 1), dtype=wp.float32)
    vec_k = layout.vec
    mean = layout.offset("mean")
    posterior = layout.offset("posterior")
    candidates = layout.offset("candidates")
    cost = layout.offset("cost")
    pair = layout.offset("pair")

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
        late: wp.vec3,
        throughput: float,
        early_cost: float,
        late_cost: float,
        q: vec_s,
        a: vec_s,
    ) -> vec_k:
        """The method's statistics with one more sample of the mixture in them; throughput: at roulette."""
        F2 = squared(F)
        late2 = squared(late)
        y = wp.float64(luminance(F))
        for s in range(wp.static(count)):
            if wp.static(posterior >= 0):
                sums[wp.static(posterior + s)] += y * wp.float64(a[s] * q[s])
            if wp.static(cost >= 0):
                sums[wp.static(cost + s)] += wp.float64(early_cost * q[s] + late_cost)
        if wp.static(mean >= 0):
            sums[wp.static(mean)] += y
            sums[wp.static(mean + 1)] += F2
        if wp.static(candidates >= 0):
            for k in range(wp.static(len(CANDIDATES))):
                # p_c / p_a; what neither strategy can draw has no weight.
                ratio = wp.static(CANDIDATES[k]) * q[0] + wp.static(1.0 - CANDIDATES[k]) * q[1]
                if ratio > 0.0:
                    inverse = wp.float64(1.0 / ratio)
                    late_part = late2 * wp.float64(late_response(throughput, ratio))
                    sums[wp.static(candidates + 2 * k)] += (F2 - late2) * inverse + late_part
                    sums[wp.static(candidates + 2 * k + 1)] += y * wp.float64(q[0]) * inverse
        return sums

    @wp.func
    def add_pair(
        sums: vec_k,
        light: wp.vec3,
        s_light: float,
        direct: wp.vec3,
        indirect: wp.vec3,
        late: wp.vec3,
        throughput: float,
        s_bsdf: float,
        early_cost: float,
        late_cost: float,
        light_rays: int,
    ) -> vec_k:
        """The method's statistics with one more pair in them: X_l, s_l, X_d, Y, Y_l, its throughput, s_b, A, B, D."""
        bsdf = direct + indirect
        late2 = squared(late)
        y_light = wp.float64(luminance(light))
        y_bsdf = wp.float64(luminance(bsdf))
        light2 = squared(light)
        bsdf2 = squared(bsdf)
        sums[wp.static(mean)] += y_light + y_bsdf
        sums[wp.static(mean + 1)] += squared(light + bsdf)
        if early_cost > 0.0:
            sums[wp.static(pair)] += wp.float64(1.0)
        sums[wp.static(pair + 1)] += wp.float64(early_cost)
        sums[wp.static(pair + 2)] += wp.float64(late_cost)
        sums[wp.static(pair + 3)] += wp.float64(light_rays)
        by_bsdf2 = bsdf2 - late2 - (squared(indirect) - late2) * wp.float64(1.0 - s_bsdf)
        for k in range(wp.static(len(CANDIDATES))):
            t_light = wp.static(CANDIDATES[k]) * s_light + wp.static(1.0 - CANDIDATES[k]) * (1.0 - s_light)
            t_bsdf = wp.static(CANDIDATES[k]) * s_bsdf + wp.static(1.0 - CANDIDATES[k]) * (1.0 - s_bsdf)
            late_part = late2 * wp.float64(late_response(throughput, t_bsdf / s_bsdf))
            second = light2 / wp.float64(t_light) + by_bsdf2 / wp.float64(t_bsdf) + late_part
            sums[wp.static(candidates + 2 * k)] += second
            of_first = y_light * wp.float64(s_light / t_light) + y_bsdf * wp.float64(s_bsdf / t_bsdf)
            sums[wp.static(candidates + 2 * k + 1)] += of_first
        return sums

    return SimpleNamespace(add=add, add_statistics=add_statistics, add_pair=add_pair, vec_k=vec_k)
