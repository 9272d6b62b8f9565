"""Newton on the simplex: the quadratic model of the second moment, minimised where every share is at least min_share.

The samples taken with an allocation b model the second moment at another one, a, to second order about b:

    M2(a) ~ 3 M2 - 3 m.a + a'h a        (since sum_t h_st b_t = m_s and sum_s m_s b_s = M2)

b itself has dropped out: the models of several rounds add up as their moments do, each weighted by its samples. At
a = b the descent direction is m, which makes this Newton's step. Where a cost c_s per strategy is known, V(a) c.a is
minimised instead of V(a): to first order, V c.a / (c.a at the present allocation) is added.

The minimum under the bounds is found by moving share to the strategy that gains most from it, from the one where the
exact minimum along that line lowers the model most, until no such pair is left: an active-set method with a working set
of two. (The strategy that gains least in place of that one zigzags: up to fifty times the steps.)

Reference: Murray et al. (2020), equation 10; Fan, Chen, Lin (2005), "Working Set Selection Using Second Order
Information for Training Support Vector Machines", for the choice of the pair.
"""

import warp as wp

from warpmis.device.kernel_factory import KernelFunction, kernel_factory
from warpmis.kernels.moments import Layout

# Share is moved between a pair at most this often for each strategy, until the gain is below GAIN of the second moment.
SWEEPS = 24
GAIN = 1e-9


@kernel_factory
def make_newton_simplex(layout: Layout) -> KernelFunction:
    """Solver kernel: (first cell, relative moments, shares, min_share) -> shares in place."""
    count = layout.strategies
    vec_r = layout.relative_vec
    vec_s = wp.types.vector(length=count, dtype=wp.float32)
    vec_d = wp.types.vector(length=count, dtype=wp.float64)
    mat_d = wp.types.matrix(shape=(count, count), dtype=wp.float64)
    mean = layout.offset("mean")
    cost = layout.offset("cost")

    @wp.func
    def second_moments(m: vec_r) -> mat_d:
        """h, from the packed upper triangle."""
        h = mat_d()
        for s in range(wp.static(count)):
            for t in range(wp.static(count)):
                if wp.static(t >= s):
                    value = wp.float64(m[wp.static(count + s * count - s * (s - 1) // 2 + t - s)])
                    h[s, t] = value
                    h[t, s] = value
        return h

    @wp.func
    def cost_weight_of(m: vec_r, descent: vec_d, a: vec_d) -> wp.float64:
        """V / c.a at the present allocation; with descent = 3 m - 2 h a the model is 3 M2 - a.(descent + 3 m) / 2."""
        cell_cost = wp.float64(0.0)
        second = wp.float64(3.0) * wp.float64(m[wp.static(mean + 1)])
        for s in range(wp.static(count)):
            cell_cost += a[s] * wp.float64(m[wp.static(cost) + s])
            second -= wp.float64(0.5) * a[s] * (descent[s] + wp.float64(3.0) * wp.float64(m[s]))
        y = wp.float64(m[wp.static(mean)])
        return wp.max(second - y * y, wp.float64(0.0)) / wp.max(cell_cost, wp.float64(1.0))

    def newton_simplex(
        first: int,
        moments: wp.array(dtype=vec_r),
        shares: wp.array(dtype=vec_s),
        min_share: float,
    ):
        cell = first + wp.tid()
        m = moments[cell]
        scale = float(0.0)
        for s in range(wp.static(count)):
            scale = wp.max(scale, m[s])
        # No light was found, or it is out of range: there is nothing to learn from, and the shares stay.
        if not (scale > 0.0) or not wp.isfinite(m):
            return
        bound = wp.float64(min_share)
        h = second_moments(m)
        a = vec_d(shares[cell])
        descent = wp.float64(-2.0) * (h * a)
        for s in range(wp.static(count)):
            descent[s] = descent[s] + wp.float64(3.0) * wp.float64(m[s])
        if wp.static(cost >= 0):
            cost_weight = cost_weight_of(m, descent, a)
            for s in range(wp.static(count)):
                descent[s] = descent[s] - cost_weight * wp.float64(m[wp.static(cost) + s])
        for _pair in range(wp.static(SWEEPS * count)):
            up = int(0)
            for s in range(wp.static(count)):
                if descent[s] > descent[up]:
                    up = s
            down = int(up)
            moved = wp.float64(0.0)
            lowered = wp.float64(0.0)
            widest = wp.float64(0.0)
            for s in range(wp.static(count)):
                if a[s] > bound:
                    gap = descent[up] - descent[s]
                    widest = wp.max(widest, gap)
                    curved = h[up, up] - wp.float64(2.0) * h[up, s] + h[s, s]
                    step = a[s] - bound
                    # Equal densities: no curvature, and the cost alone decides.
                    if wp.float64(2.0) * curved * step > gap:
                        step = gap / (wp.float64(2.0) * curved)
                    if step * (gap - curved * step) > lowered:
                        lowered = step * (gap - curved * step)
                        moved = step
                        down = s
            if widest <= wp.float64(wp.static(GAIN)) * wp.float64(scale):
                break
            a[up] = a[up] + moved
            a[down] = a[down] - moved
            descent = descent - wp.float64(2.0) * moved * (h[up] - h[down])
        result = vec_s()
        for s in range(wp.static(count)):
            result[s] = float(a[s])
        shares[cell] = result

    return newton_simplex
