"""One Newton step on the second moment of each cell, for any number of strategies.

With the last share eliminated, a_S = 1 - sum of the others, and r_s = q_s - q_S:

    gradient_s = -E[F^2 r_s],    Hessian_st = 2 E[F^2 r_s r_t],    a <- a - Hessian^-1 gradient

The factor 2 matters: without it the iteration oscillates about the optimum for ever. The sum of all shares but the last
is then clamped to [low, high], by a common factor, as published: for two strategies that is a clamp of the first share,
for more it keeps the last strategy explored and the others together. LEAST is ours: Newton's step may leave a share
negative, and a share of 0 could never grow again.

Reference: Murray et al. (2020), equations 5 and 10 and section 4; moments as in kernels/moments.py.
"""

import warp as wp

from warpmis.device.kernel_factory import KernelFunction, kernel_factory
from warpmis.kernels.moments import Layout

# Keeps the system solvable where two strategies have nearly equal densities; relative to the Hessian's trace.
RIDGE = 1e-6

# Smallest share of any strategy, before the common factor.
LEAST = 0.01


@kernel_factory
def make_newton_seed(layout: Layout) -> KernelFunction:
    """Solver kernel for two strategies or more: (first cell, moments, shares, low, high) -> shares in place."""
    count = layout.strategies
    unknowns = count - 1
    vec_s = wp.types.vector(length=count, dtype=wp.float32)
    vec_k = layout.vec
    vec_n = wp.types.vector(length=unknowns, dtype=wp.float64)
    mat_n = wp.types.matrix(shape=(unknowns, unknowns), dtype=wp.float64)

    @wp.func
    def second(moments: vec_k, s: int, t: int) -> wp.float64:
        """h_st from the packed upper triangle."""
        i = wp.min(s, t)
        j = wp.max(s, t)
        return moments[wp.static(count) + i * wp.static(count) - i * (i - 1) / 2 + j - i]

    @wp.func
    def solve(matrix: mat_n, right: vec_n) -> vec_n:
        """Gaussian elimination; the matrix is positive definite, so no pivoting is needed."""
        for i in range(wp.static(unknowns)):
            for k in range(i + 1, wp.static(unknowns)):
                factor = matrix[k, i] / matrix[i, i]
                for j in range(i, wp.static(unknowns)):
                    matrix[k, j] = matrix[k, j] - factor * matrix[i, j]
                right[k] = right[k] - factor * right[i]
        x = vec_n()
        for step in range(wp.static(unknowns)):
            i = wp.static(unknowns) - 1 - step
            rest = right[i]
            for j in range(i + 1, wp.static(unknowns)):
                rest = rest - matrix[i, j] * x[j]
            x[i] = rest / matrix[i, i]
        return x

    @wp.func
    def clamped(a: vec_s, low: float, high: float) -> vec_s:
        total = float(0.0)
        for s in range(wp.static(unknowns)):
            a[s] = wp.max(a[s], wp.static(LEAST))
            total += a[s]
        factor = wp.clamp(total, low, high) / total
        rest = float(1.0)
        for s in range(wp.static(unknowns)):
            a[s] = a[s] * factor
            rest -= a[s]
        a[wp.static(count - 1)] = rest
        return a

    def newton_seed(first: int, moments: wp.array(dtype=vec_k), shares: wp.array(dtype=vec_s), low: float, high: float):
        cell = first + wp.tid()
        sums = moments[cell]
        a = shares[cell]
        second_moment = wp.float64(0.0)
        for s in range(wp.static(count)):
            second_moment += wp.float64(a[s]) * sums[s]
        # No light was found, or it is out of range: there is nothing to learn from, and the shares stay.
        if not (second_moment > wp.float64(0.0)) or not wp.isfinite(second_moment):
            return
        sums = sums / second_moment  # so that no product overflows or vanishes
        last = wp.static(count - 1)
        descent = vec_n()
        hessian = mat_n()
        trace = wp.float64(0.0)
        for s in range(wp.static(unknowns)):
            descent[s] = sums[s] - sums[last]
            for t in range(wp.static(unknowns)):
                crossed = second(sums, s, t) - second(sums, s, last) - second(sums, last, t) + second(sums, last, last)
                hessian[s, t] = wp.float64(2.0) * crossed
            trace += hessian[s, s]
        # Equal densities everywhere: every allocation is as good.
        if not (trace > wp.float64(1e-12)):
            return
        for s in range(wp.static(unknowns)):
            hessian[s, s] = hessian[s, s] + wp.float64(wp.static(RIDGE / unknowns)) * trace
        step = solve(hessian, descent)
        if not wp.isfinite(wp.dot(step, step)):
            return
        for s in range(wp.static(unknowns)):
            a[s] = a[s] + wp.clamp(float(step[s]), -2.0, 2.0)
        shares[cell] = clamped(a, low, high)

    return newton_seed
