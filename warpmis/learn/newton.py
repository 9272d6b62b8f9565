"""One Newton step on the second moment of each pixel, for any number of strategies.

With the last share eliminated, a_S = 1 - sum of the others, and r_s = q_s - q_S:

    gradient_s = -E[F^2 r_s],    Hessian_st = 2 E[F^2 r_s r_t],    a <- a - Hessian^-1 gradient

The factor 2 matters: without it the iteration oscillates about the optimum for ever. The step is then projected onto
the shares of at least `min_share`, so that every kind of path stays explored: for two strategies that is the clamp to
[0.1, 0.9] of the paper.

Reference: Murray et al. (2020), equations 5 and 10; moments as in kernels/moments.py.
"""

from functools import cache

import warp as wp

from warpmis.kernels.moments import moment_count

# Keeps the system solvable where two strategies have nearly equal densities; relative to the Hessian's trace.
RIDGE = 1e-6


@cache
def make_newton(count: int) -> wp.Kernel:
    """The solver kernel for `count` >= 2 strategies: (moments, allocation, min_share) -> allocation in place."""
    unknowns = count - 1
    vec_s = wp.types.vector(length=count, dtype=wp.float32)
    vec_k = wp.types.vector(length=moment_count(count), dtype=wp.float64)
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
    def projected(a: vec_s, min_share: float) -> vec_s:
        """Closest point with every share at least min_share and sum 1.

        Reference: Michelot (1986), by fixing at the bound whatever falls under it until nothing does.
        """
        free = vec_s(1.0)
        for _pass in range(wp.static(count)):
            excess = float(-1.0)
            number = float(0.0)
            for s in range(wp.static(count)):
                excess += wp.where(free[s] > 0.0, a[s], min_share)
                number += free[s]
            shift = excess / wp.max(number, 1.0)
            for s in range(wp.static(count)):
                if free[s] > 0.0:
                    a[s] = a[s] - shift
            for s in range(wp.static(count)):
                if a[s] < min_share:
                    a[s] = min_share
                    free[s] = 0.0
        return a

    @wp.kernel(module="unique", enable_backward=False)
    def newton(moments: wp.array(dtype=vec_k), allocation: wp.array(dtype=vec_s), min_share: float):
        pixel = wp.tid()
        sums = moments[pixel]
        a = allocation[pixel]
        second_moment = wp.float64(0.0)
        for s in range(wp.static(count)):
            second_moment += wp.float64(a[s]) * sums[s]
        # No light was found, or it is out of range: nothing is known, the allocation stays.
        if not (second_moment > wp.float64(0.0)) or not wp.isfinite(second_moment):
            return
        sums = sums / second_moment
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
        if trace <= wp.float64(1e-12):
            return
        for s in range(wp.static(unknowns)):
            hessian[s, s] = hessian[s, s] + wp.float64(wp.static(RIDGE / unknowns)) * trace
        step = solve(hessian, descent)
        moved = vec_s()
        rest = float(1.0)
        for s in range(wp.static(unknowns)):
            moved[s] = a[s] + wp.clamp(float(step[s]), -2.0, 2.0)
            rest -= moved[s]
        moved[last] = rest
        allocation[pixel] = projected(moved, min_share)

    return newton
