"""Newton on the simplex: the quadratic model of the second moment, minimised where every share is at least min_share.

The samples taken with an allocation b model the second moment at another one, a, to second order about b:

    M2(a) ~ 3 M2 - 3 m.a + a'h a        (since sum_t h_st b_t = m_s and sum_s m_s b_s = M2)

b itself has dropped out: the models of several rounds add up as their moments do, each weighted by its samples. At
a = b the descent direction is m, which makes this Newton's step. Where a cost c_s per strategy is known, V(a) c.a is
minimised instead of V(a): to first order, V c.a / (c.a at the present allocation) is added.

The minimum under the bounds is found by moving share from the strategy that gains least from it to the one that gains
most, by the exact minimum along that line, until no such pair is left: an active-set method with a working set of two.

Reference: Murray et al. (2020), equation 10; Keerthi et al. (2001), "Improvements to Platt's SMO Algorithm for SVM
Classifier Design", for the maximal violating pair.
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from warpmis.kernels.moments import Layout

# Share moved by a pair at most this often for each strategy, and until the gain is below GAIN of the second moment.
SWEEPS = 24
GAIN = 1e-9


@cache
def make_quadratic(layout: Layout) -> SimpleNamespace:
    """Functions of the model: curvature (h a), second_moment."""
    count = layout.strategies
    vec_k = layout.vec
    vec_d = wp.types.vector(length=count, dtype=wp.float64)
    mean = layout.offset("mean")

    @wp.func
    def curvature(moments: vec_k, a: vec_d) -> vec_d:
        """h a, from the packed upper triangle."""
        out = vec_d()
        for s in range(wp.static(count)):
            for t in range(wp.static(count)):
                i = wp.min(s, t)
                j = wp.max(s, t)
                out[s] = out[s] + moments[wp.static(count) + i * wp.static(count) - i * (i - 1) / 2 + j - i] * a[t]
        return out

    @wp.func
    def second_moment(moments: vec_k, a: vec_d) -> wp.float64:
        ha = curvature(moments, a)
        value = wp.float64(3.0) * moments[wp.static(mean + 1)]
        for s in range(wp.static(count)):
            value += a[s] * (ha[s] - wp.float64(3.0) * moments[s])
        return value

    return SimpleNamespace(curvature=curvature, second_moment=second_moment, vec_d=vec_d)


@cache
def make_newton_simplex(layout: Layout) -> wp.Kernel:
    """Solver kernel: (first, relative moments, allocation, min_share) -> allocation in place."""
    count = layout.strategies
    vec_k = layout.vec
    vec_s = wp.types.vector(length=count, dtype=wp.float32)
    quadratic = make_quadratic(layout)
    vec_d = quadratic.vec_d
    mean = layout.offset("mean")
    cost = layout.offset("cost")

    @wp.kernel(module="unique", enable_backward=False)
    def newton_simplex(
        first: int,
        moments: wp.array(dtype=vec_k),
        allocation: wp.array(dtype=vec_s),
        min_share: float,
    ):
        pixel = first + wp.tid()
        known = moments[pixel]
        scale = wp.float64(0.0)
        for s in range(wp.static(count)):
            scale = wp.max(scale, known[s])
        # No light was found, or it is out of range: nothing is known, the allocation stays.
        if not (scale > wp.float64(0.0)) or not wp.isfinite(known):
            return
        bound = wp.float64(min_share)
        a = vec_d()
        for s in range(wp.static(count)):
            a[s] = wp.float64(allocation[pixel][s])
        cost_weight = wp.float64(0.0)
        if wp.static(cost >= 0):
            spent = wp.float64(0.0)
            for s in range(wp.static(count)):
                spent += a[s] * known[wp.static(cost) + s]
            variance = quadratic.second_moment(known, a) - known[wp.static(mean)] * known[wp.static(mean)]
            cost_weight = wp.max(variance, wp.float64(0.0)) / wp.max(spent, wp.float64(1.0))
        for _pair in range(wp.static(SWEEPS * count)):
            ha = quadratic.curvature(known, a)
            up = int(0)
            down = int(-1)
            best = wp.float64(0.0)
            worst = wp.float64(0.0)
            for s in range(wp.static(count)):
                descent = wp.float64(3.0) * known[s] - wp.float64(2.0) * ha[s]
                if wp.static(cost >= 0):
                    descent = descent - cost_weight * known[wp.static(cost) + s]
                if s == 0 or descent > best:
                    best = descent
                    up = s
                if a[s] > bound and (down < 0 or descent < worst):
                    worst = descent
                    down = s
            if down < 0 or best - worst <= wp.float64(wp.static(GAIN)) * scale:
                break
            pair = vec_d()
            pair[up] = wp.float64(1.0)
            pair[down] = wp.float64(-1.0)
            curved = wp.dot(pair, quadratic.curvature(known, pair))
            moved = a[down] - bound
            # Equal densities: no curvature, and the cost alone decides.
            if wp.float64(2.0) * curved * moved > best - worst:
                moved = (best - worst) / (wp.float64(2.0) * curved)
            a[up] = a[up] + moved
            a[down] = a[down] - moved
        shares = vec_s()
        for s in range(wp.static(count)):
            shares[s] = float(a[s])
        allocation[pixel] = shares

    return newton_simplex
