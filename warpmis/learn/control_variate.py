"""The coefficient of a control variate: X - g c has the least variance for g = E[X c] / E[c^2], where E[c] = 0.

X is the light that a light sample and a BSDF sample bring straight from the lights, c the control of
path/weighted_pair.py. Of two techniques with a sample each this is the optimal estimator of Kondapaneni et al. (2019):
their coefficients, A^-1 b, are half the integral each, plus and minus g. Light from other surfaces hardly goes with c,
and has rare bright samples, from which few samples would learn noise.

Each colour has a coefficient of its own: with a common one, a red wall would get noise in green and blue.

The moments are those of single samples, as published. Those of even rounds gain no more (docs/weights.md).

Reference: Kondapaneni, Vevoda, Grittmann, Skrivan, Slusallek, Krivanek (2019), "Optimal Multiple Importance Sampling",
equations 14 to 17.
"""

import warp as wp

from warpmis.device.kernel_factory import KernelFunction, kernel_factory
from warpmis.kernels.moments import Layout

vec_colors = wp.types.vector(length=3, dtype=wp.float32)


@kernel_factory
def make_control_variate(layout: Layout) -> KernelFunction:
    """Solver kernel: (first cell, moments, coefficients) -> coefficients in place, relative to the brightness; 0 where
    there is no control."""
    vec_r = layout.relative_vec
    control = layout.offset("control")

    def control_variate(first: int, moments: wp.array(dtype=vec_r), coefficients: wp.array(dtype=vec_colors)):
        cell = first + wp.tid()
        row = moments[cell]
        squares = row[wp.static(control + 3)]
        found = vec_colors()
        if squares > 0.0:
            for color in range(3):
                g = row[wp.static(control) + color] / squares
                # Radiance out of range tells nothing.
                if wp.isfinite(g):
                    found[color] = g
        coefficients[cell] = found

    return control_variate


@kernel_factory
def make_in_radiance() -> KernelFunction:
    """Kernel: (first pixel, brightness, coefficients) -> coefficients in place, times the pixel's brightness."""

    def in_radiance(first: int, brightness: wp.array(dtype=float), coefficients: wp.array(dtype=vec_colors)):
        pixel = first + wp.tid()
        coefficients[pixel] = coefficients[pixel] * brightness[pixel]

    return in_radiance
