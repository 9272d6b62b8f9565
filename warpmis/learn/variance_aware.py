"""Weights by what the variances of the techniques tell: w_t ~ v_t p_t with v_t = 1 + mean_t^2 / variance_t.

The balance heuristic bounds a technique's variance by its second moment. That is far too much for a technique whose
samples are evenly spread: v_t is how much. Mean and variance are those of what the technique brings by the balance
heuristic, as in the authors' program; the variance is that between rounds, times their samples, for the samples of one
round are on a lattice together, and variances of single samples know nothing of that.

Reference: Grittmann, Georgiev, Slusallek, Krivanek (2019), "Variance-Aware Multiple Importance Sampling".
"""

import warp as wp

from warpmis.device.kernel_factory import KernelFunction, kernel_factory
from warpmis.kernels.moments import Layout

# A technique's variance counts as this part of its squared mean or more.
LEAST_VARIANCE = 1e-6


@kernel_factory
def make_end_round(layout: Layout) -> KernelFunction:
    """Kernel: (first cell, moments) -> moments in place, with the present round among those before.

    Of k sums s_1 .. s_k the sum of squared deviations grows by (k - 1) / k (s_k - mean of the others)^2.

    Reference: Welford (1962), "Note on a Method for Calculating Corrected Sums of Squares and Products".
    """
    vec_k = layout.vec
    rounds = layout.offset("between_rounds")

    def end_round(first: int, moments: wp.array(dtype=vec_k)):
        cell = first + wp.tid()
        row = moments[cell]
        before = row[wp.static(rounds)]
        k = before + wp.float64(1.0)
        row[wp.static(rounds)] = k
        for t in range(2):
            now = row[wp.static(rounds + 1) + t]
            total = row[wp.static(rounds + 3) + t]
            if before > wp.float64(0.0):
                apart = now - total / before
                deviations = row[wp.static(rounds + 5) + t] * (before - wp.float64(1.0)) / before
                deviations += apart * apart * before / k
                row[wp.static(rounds + 5) + t] = deviations * k / before
            row[wp.static(rounds + 3) + t] = total + now
            row[wp.static(rounds + 1) + t] = wp.float64(0.0)
        moments[cell] = row

    return end_round


@wp.func
def variance_factor(mean: float, variance: float) -> float:
    """v = 1 + mean^2 / variance; 1 of a technique that brings nothing."""
    square = mean * mean
    if square <= 0.0:
        return 1.0
    return 1.0 + square / wp.max(variance, wp.static(LEAST_VARIANCE) * square)


@kernel_factory
def make_variance_aware(layout: Layout) -> KernelFunction:
    """Solver kernel: (first cell, moments, weights, least, most) -> weights in place, of bsdf and light, of sum 1.

    Sums over all samples divided by their number are the mean; the variance of a round's sum divided by it is that of
    one sample. Both are relative to the brightness.
    """
    vec_r = layout.relative_vec
    vec_s = wp.types.vector(length=2, dtype=wp.float32)
    rounds = layout.offset("between_rounds")

    def variance_aware(
        first: int, moments: wp.array(dtype=vec_r), weights: wp.array(dtype=vec_s), least: float, most: float
    ):
        cell = first + wp.tid()
        row = moments[cell]
        v_light = variance_factor(row[wp.static(rounds + 3)], row[wp.static(rounds + 5)])
        v_bsdf = variance_factor(row[wp.static(rounds + 4)], row[wp.static(rounds + 6)])
        of_bsdf = v_bsdf / (v_bsdf + v_light)
        # Radiance out of range tells nothing.
        if wp.isfinite(of_bsdf):
            of_bsdf = wp.clamp(of_bsdf, least, most)
            weights[cell] = vec_s(of_bsdf, 1.0 - of_bsdf)

    return variance_aware
