"""The shares of the strategies in each cell, by Newton on the simplex: the pixels' learning, at every vertex.

With F the light that a vertex sends on by way of its drawn direction and q_s = p_s / p_a, the moments are those of
kernels/moments.py: m_s = E[F^2 q_s] and h_st = E[F^2 q_s q_t]. They are relative to the cell's E[F^2], so bright and
dark cells count alike. learn/newton_simplex.py turns them into shares. Cells of few records lean on the mean over all
cells. The moments of earlier rounds stay valid under other shares, so they are kept. Their guides were worse, so they
count less after each round.

Reference: Murray et al. (2020), equations 5 to 10.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpmis.kernels.moments import Layout
from warpmis.learn.newton_simplex import make_newton_simplex

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Launch = Callable[[wp.Kernel, int, list[Any]], None]

# No share falls below this part of an equal one.
LEAST_PART = 0.2
# Records of a cell that count as much as the mean over all cells.
PRIOR = 60.0
# What is known counts for this part after another round, beside what all of the cache forgets.
KEPT = 0.3
# Added to the diagonal of the relative h: a pull towards equal shares where densities hardly differ.
RIDGE = 0.1
# Strategies whose directions end on lights.
OF_LIGHTS = ("light", "area", "dome")


def share_kernel(strategies: tuple[str, ...]) -> wp.Kernel:
    """What `CellShares.learn` launches."""
    return make_newton_simplex(_layout(strategies))


def _layout(strategies: tuple[str, ...]) -> Layout:
    return Layout(len(strategies), ("mean",))


class CellShares:
    """Shares of `strategies` in each cell, shape (cells, S), and the sums that they come from.

    Attributes:
        count: records of each cell, shape (cells,).
        sums: of F^2 q_s, of F^2 q_s q_t for t >= s row by row, and of F^2, shape (cells, K + 1).
    """

    def __init__(self, strategies: tuple[str, ...], device: str) -> None:
        self.strategies = strategies
        self.device = device
        size = len(strategies)
        self.shares: FloatArray = np.full((1, size), 1.0 / size)
        self.count: FloatArray = np.zeros(1)
        self.sums: FloatArray = np.zeros((1, size + size * (size + 1) // 2 + 1))

    def inherit(self, parent: IntArray, factor: FloatArray) -> None:
        """Those of each new cell are its parent's, with the sums times `factor`."""
        self.shares = self.shares[parent]
        self.count = self.count[parent] * factor
        self.sums = self.sums[parent] * factor[:, np.newaxis]

    def learn(self, cells: IntArray, squares: FloatArray, ratios: FloatArray, launch: Launch) -> None:
        """Take in the records of a round, and make the next shares.

        Args:
            cells: of each record, shape (n,); squares: F^2, shape (n,).
            ratios: q of each strategy, shape (n, S).
        """
        number = len(self.count)
        self.count = KEPT * self.count + np.bincount(cells, minlength=number)
        first, second = np.triu_indices(len(self.strategies))
        columns = [*(squares * q for q in ratios.T)]
        columns += [columns[s] * ratios[:, t] for s, t in zip(first, second, strict=True)]
        added = [np.bincount(cells, column, number) for column in (*columns, squares)]
        self.sums = KEPT * self.sums + np.stack(added, axis=1)
        self._solve(launch)

    def relative_moments(self) -> FloatArray:
        """What the solver gets, shape (cells, K): a cell's own, and the mean over all for what it has not seen."""
        scale = self.sums[:, -1:]
        own = np.where(scale > 0.0, self.sums / np.maximum(scale, 1e-300), 0.0)
        known = self.count * (scale[:, 0] > 0.0)
        mean = (known[:, np.newaxis] * own).sum(axis=0) / max(float(known.sum()), 1e-300)
        trust = (known / (known + PRIOR))[:, np.newaxis]
        return trust * own + (1.0 - trust) * mean

    def _solve(self, launch: Launch) -> None:
        layout = _layout(self.strategies)
        rows = np.zeros((len(self.count), layout.size), np.float32)
        relative = self.relative_moments()
        rows[:, : relative.shape[1] - 1] = relative[:, :-1]
        first, second = np.triu_indices(len(self.strategies))
        rows[:, len(self.strategies) + np.flatnonzero(first == second)] += np.float32(RIDGE)
        rows[:, layout.offset("mean") + 1] = relative[:, -1]
        vec_s = wp.types.vector(length=len(self.strategies), dtype=wp.float32)
        moments = wp.array(rows, dtype=layout.relative_vec, device=self.device)
        shares = wp.array(self.shares.astype(np.float32), dtype=vec_s, device=self.device)
        launch(share_kernel(self.strategies), len(rows), [moments, shares, LEAST_PART / len(self.strategies)])
        self.shares = shares.numpy().astype(np.float64)

    def share_of(self, *names: str) -> FloatArray:
        """What these strategies have together in each cell, shape (cells,)."""
        return self.shares[:, [name in names for name in self.strategies]].sum(axis=1)

    def found_by_lights(self, cells: IntArray, ratios: FloatArray) -> FloatArray:
        """Part of each record's direction that sampling of lights draws: sum_s a_s q_s of those, shape (n,)."""
        is_of_lights = np.array([name in OF_LIGHTS for name in self.strategies])
        return np.minimum((self.shares[cells] * ratios * is_of_lights).sum(axis=1), 1.0)
