"""What a cell knows of the paths that pass through it, and the rates that follow.

With F the light that a vertex sends on by way of its drawn direction, d the light of its light sample and c the rays of
the tail:

    worth of the tail       sqrt(E[F^2] / E[c])
    worth of a shadow ray   sqrt(E[d^2] / cost of a shadow ray)

Times what the path carries, they are the rates that minimise variance x cost.

Reference: Rath, Grittmann, Herholz, Weier, Slusallek (2022), "EARS: Efficiency-Aware Russian Roulette and Splitting",
equation 12.
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
# Records of a cell that count as much as the whole scene's mean.
PRIOR_WORTH = 50.0


@dataclass(frozen=True, eq=False)
class CellMoments:
    """Sums over the records of each cell, shape (cells,) each.

    Attributes:
        count: of records.
        tail: of F^2; light: of d^2; cost: of the tail's rays.
    """

    count: FloatArray
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


def worths(moments: CellMoments) -> tuple[FloatArray, FloatArray]:
    """What a tail and a shadow ray are worth in each cell [radiance / sqrt(ray)], shape (cells,) each.

    Cells of few records lean on the mean over all: a cell that has not met its light must not be given up.
    """
    total = max(float(moments.count.sum()), 1.0)

    def mean(sums: FloatArray) -> FloatArray:
        return (sums + PRIOR_WORTH * sums.sum() / total) / (moments.count + PRIOR_WORTH)

    tail = np.sqrt(mean(moments.tail) / np.maximum(mean(moments.cost), 1.0))
    return tail, np.sqrt(mean(moments.light) / SHADOW_RAY_COST)
