"""What learning decides for each cell: its estimator, and how a mixture's strategies share the samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp
from numpy.typing import NDArray

# The estimators of a cell: a mixture of the strategies, or next-event estimation without any mixture.
MIXTURE = 0
NEXT_EVENT = 1


@dataclass(frozen=True, eq=False)
class Allocation:
    """The decisions for a number of cells, on a device.

    Attributes:
        shares: of the strategies in a mixture, shape (cells, S), float32. Each row sums to 1, also where the cell has
            next-event estimation.
        estimators: MIXTURE or NEXT_EVENT, shape (cells,), uint8; empty where all cells have the mixture for good.
    """

    shares: wp.array
    estimators: wp.array

    @staticmethod
    def of(shares: NDArray[np.float32], begins_with_next_event: bool, device: str) -> Allocation:
        """Of shares of shape (cells, S); where cells begin with next-event estimation, they may go over to the mixture
        and back."""
        cells, count = shares.shape
        vec_s = wp.types.vector(length=count, dtype=wp.float32)
        estimators = np.full(cells if begins_with_next_event else 0, NEXT_EVENT, dtype=np.uint8)
        return Allocation(
            wp.array(shares, dtype=vec_s, device=device), wp.array(estimators, dtype=wp.uint8, device=device)
        )

    def is_next_event(self) -> NDArray[np.bool_]:
        """Which cells have next-event estimation, shape (cells,)."""
        if self.estimators.shape[0] == 0:
            return np.zeros(self.shares.shape[0], dtype=np.bool_)
        return np.asarray(self.estimators.numpy() == NEXT_EVENT)
