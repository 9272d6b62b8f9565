"""The host half of learn/candidates.py: how much cost counts, which is decided for all cells together."""

from __future__ import annotations

import numpy as np
import warp as wp

from warpmis.learn.allocation import Allocation
from warpmis.learn.candidates import make_candidates
from warpmis.learn.solver import Launch, Problem

# Cells whose variance is beyond this quantile do not count in the weight of cost: there single paths decide.
TRUSTED_QUANTILE = 0.95

# Fixed-point steps of that weight.
COST_STEPS = 3


class BestCandidate:
    """Least variance in each cell; where cost counts, the least product of all cells' variance and cost.

    All cells take the same number of samples, so the product of the sums is to be small. Its derivative weighs cost by
    their quotient, which we find by fixed point. Time saved where there is little noise is as good as any.
    """

    def __init__(self, problem: Problem) -> None:
        self.kernel = make_candidates(problem.layout, problem.stratified, problem.lattice)
        self.cost_steps = COST_STEPS if problem.method.cost_aware else 0
        # Variance and cost of what was chosen, a pair a cell.
        self.efficiency = wp.zeros(problem.cells, dtype=wp.vec2, device=problem.device)

    def kernels(self) -> list[wp.Kernel]:
        return [self.kernel]

    def buffers(self) -> list[wp.array]:
        return [self.efficiency]

    def step(self, moments: wp.array, allocation: Allocation, launch: Launch) -> None:
        outputs = [allocation.shares, allocation.estimators, self.efficiency]
        launch(self.kernel, [moments, 0.0, *outputs])
        for _ in range(self.cost_steps):
            variance, cost = self.efficiency.numpy().T
            lit = np.isfinite(variance) & (variance > 0.0)
            if not lit.any():
                return
            trusted = variance[lit] <= np.quantile(variance[lit], TRUSTED_QUANTILE)
            cost_weight = float(variance[lit][trusted].sum() / cost[lit][trusted].sum())
            launch(self.kernel, [moments, cost_weight, *outputs])
