"""What a cell knows of the paths that pass through it, and the share and the rates that follow.

With F the light that a vertex sends on by way of its drawn direction, q_s = p_s / p_a for the BSDF and the guide, d the
light of its light sample and c the rays of the tail:

    share of the BSDF       a <- a sqrt(E[F^2 q_B]), the guide's likewise, normalised
    worth of the tail       sqrt(E[F^2] / E[c])
    worth of a shadow ray   sqrt(E[d^2] / cost of a shadow ray)

The share is Murray et al.'s objective at every vertex: dM2/da_s = -E[F^2 q_s], so equal moments mark the optimum, and
the multiplicative step keeps to the simplex. The worths, times what the path carries, are the rates that minimise
variance x cost.

References: Murray et al. (2020), equations 7 to 9; Rath, Grittmann, Herholz, Weier, Slusallek (2022), "EARS:
Efficiency-Aware Russian Roulette and Splitting", equation 12.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from warpmis.kernels.moments import SHADOW_RAY_COST

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# What is known counts for half after another round: its guide was worse.
DECAY = 0.5
# Records that half trust in a cell's new share takes; and as many stand for the whole scene's mean in its worths.
PRIOR = 500.0
PRIOR_WORTH = 50.0
MIN_SHARE, MAX_SHARE = 0.1, 0.9
FIRST_SHARE = 0.5


@dataclass(frozen=True, eq=False)
class CellMoments:
    """Sums over the records of each cell, shape (cells,) each.

    Attributes:
        count: of records.
        by_bsdf, by_guide: of F^2 q_B and F^2 q_G; tail: of F^2; light: of d^2; cost: of the tail's rays.
    """

    count: FloatArray
    by_bsdf: FloatArray
    by_guide: FloatArray
    tail: FloatArray
    light: FloatArray
    cost: FloatArray

    @classmethod
    def zeros(cls, cells: int) -> CellMoments:
        return cls(*(np.zeros(cells) for _ in fields(cls)))

    def inherited(self, parent: IntArray, factor: FloatArray) -> CellMoments:
        """Those of each new cell: its parent's times `factor`."""
        return CellMoments(*(getattr(self, field.name)[parent] * factor for field in fields(self)))

    def plus(self, other: CellMoments) -> CellMoments:
        return CellMoments(*(getattr(self, field.name) + getattr(other, field.name) for field in fields(self)))


def updated_shares(shares: FloatArray, latest: CellMoments, all_rounds: CellMoments) -> FloatArray:
    """The BSDF's share of each cell after one step, shape (cells,). `latest`: the moments under the present shares."""
    bsdf = shares * np.sqrt(latest.by_bsdf)
    guide = (1.0 - shares) * np.sqrt(latest.by_guide)
    total = bsdf + guide
    step = np.where(total > 0.0, bsdf / np.maximum(total, 1e-300), shares)
    trust = all_rounds.count / (all_rounds.count + PRIOR)
    return np.clip(trust * step + (1.0 - trust) * shares, MIN_SHARE, MAX_SHARE)


def worths(moments: CellMoments) -> tuple[FloatArray, FloatArray]:
    """What a tail and a shadow ray are worth in each cell [radiance / sqrt(ray)], shape (cells,) each.

    Cells of few records lean on the mean over all: a cell that has not met its light must not be given up.
    """
    total = max(float(moments.count.sum()), 1.0)

    def mean(sums: FloatArray) -> FloatArray:
        return (sums + PRIOR_WORTH * sums.sum() / total) / (moments.count + PRIOR_WORTH)

    tail = np.sqrt(mean(moments.tail) / np.maximum(mean(moments.cost), 1.0))
    return tail, np.sqrt(mean(moments.light) / SHADOW_RAY_COST)
