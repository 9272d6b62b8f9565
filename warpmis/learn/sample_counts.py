"""How many light samples and paths a vertex should take: the counts of least variance x cost, from a pilot.

The pilot takes two of each. Let U_i be what a pixel's i-th light samples bring with all that neither brings, and B_j
what its j-th paths bring, as means of one round. Samples of a kind are alike, so for any counts n and m the variance of

    X = (U_1 + .. + U_n) / n + (B_1 + .. + B_m) / m

follows from five moments, which the pilot's rounds tell:

    V(n, m) = C_U + (V_U - C_U) / n + C_B + (V_B - C_B) / m + 2 C_UB

with the variances V of one, and the covariances C of two of a kind and of one of each. Rounds are lattices of their
own, so the moments know what even samples gain. Both V and C have the same rare bright samples in them: their ratio,
which decides, has little noise. The cost is c + n c_light + m c_path.

Next-event estimation weighs by the counts; the pilot weighs both kinds alike, which is close.

References: Rath, Grittmann, Herholz, Weier, Slusallek (2022), "EARS: Efficiency-Aware Russian Roulette and Splitting";
Grittmann, Yazici, Georgiev, Slusallek (2022), "Efficiency-Aware Multiple Importance Sampling for Bidirectional
Rendering Algorithms", which choose counts by least variance x cost.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Light samples and paths that are tried; (1, 1) is next-event estimation. Four of either lost in every scene.
CANDIDATES = ((1, 1), (2, 1), (1, 2), (2, 2))
# What kernels with counts take for the same rays, over that of next-event estimation (scripts/bench/counts.py); and how
# much more than (1, 1) other counts must promise.
KERNEL, MARGIN = 1.1, 1.03
# A pixel darker than a tenth of the mean counts as if it were that bright, and of so many pixels the worst is left out.
DARK, ONE_OUTLIER_IN = 0.1, 100


@dataclass(frozen=True)
class Cost:
    """Of a sample: what it takes whatever the counts, and each light sample and each path more [rays]."""

    base: float
    light: float
    path: float

    def of(self, lights: int, paths: int) -> float:
        return self.base + lights * self.light + paths * self.path


def covariances(rounds: Array) -> Array:
    """Between rounds, of (U_1, U_2, B_1, B_2), relative to the pixel's brightness, shape (pixels, 4, 4).

    Args:
        rounds: means of each round [radiance], shape (rounds, pixels, 4).
    """
    mean = rounds.mean(axis=0)
    brightness = 0.5 * mean.sum(axis=1)
    scale = brightness**2 + (DARK * brightness.mean()) ** 2
    apart = (rounds - mean) / np.sqrt(np.maximum(scale, 1e-300))[:, np.newaxis]
    found: Array = np.einsum("rps,rpt->pst", apart, apart) / (len(rounds) - 1)
    return found


def variance(of: Array, lights: int, paths: int) -> Array:
    """V(n, m) of the module's text, from covariances of (U_1, U_2, B_1, B_2), shape (..., 4, 4)."""
    own_light, own_path = 0.5 * (of[..., 0, 0] + of[..., 1, 1]), 0.5 * (of[..., 2, 2] + of[..., 3, 3])
    across = of[..., :2, 2:].mean(axis=(-2, -1))
    common: Array = of[..., 0, 1] + of[..., 2, 3] + 2.0 * across
    return common + (own_light - of[..., 0, 1]) / lights + (own_path - of[..., 2, 3]) / paths


def best_counts(rounds: Array, cost: Cost) -> tuple[int, int]:
    """The candidate of least variance x cost over all pixels; (1, 1) unless another promises MARGIN times as much.

    Args:
        rounds: as in `covariances`, of 2 rounds or more.
    """
    of = covariances(rounds)
    plain = variance(of, 1, 1)
    kept = np.argsort(plain)[: len(plain) - len(plain) // ONE_OUTLIER_IN]
    whole = of[kept].mean(axis=0)
    products = {counts: KERNEL * float(variance(whole, *counts)) * cost.of(*counts) for counts in CANDIDATES}
    products[1, 1] /= KERNEL
    best = min(products, key=lambda counts: products[counts])
    if not 0.0 < products[best] * MARGIN < products[1, 1]:
        return (1, 1)
    return best
