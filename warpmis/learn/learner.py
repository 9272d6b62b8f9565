"""The host half of learning: a method's moments, and the kernels that turn them into the next allocation."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import warp as wp

from warpmis.device.views import FilmView
from warpmis.kernels.moments import Layout
from warpmis.learn.candidates import make_candidates
from warpmis.learn.expectation import make_expectation
from warpmis.learn.neighbours import Launch, Neighbours
from warpmis.learn.newton_seed import make_newton_seed
from warpmis.learn.newton_share import make_newton_share
from warpmis.learn.newton_simplex import make_newton_simplex
from warpmis.learn.whole_samples import make_whole_samples, rounds_well
from warpmis.methods import Method

# The solver kernels by name, but for the one that also needs to know how strategies are chosen.
SOLVERS: dict[str, Callable[[Layout], wp.Kernel]] = {
    "newton_share": make_newton_share,
    "newton_seed": make_newton_seed,
    "newton_simplex": make_newton_simplex,
    "expectation": make_expectation,
}

# Pixels whose variance is beyond this quantile do not count in the weight of cost: single paths decide theirs.
TRUSTED = 0.95

# Fixed-point steps of that weight.
COST_STEPS = 3


class Learner:
    """One render's learning, by cells of so many by so many pixels as the method's learning looks at one of.

    Attributes:
        cells: their number.
        moments: sums over the samples since the round began, or over all rounds if the method keeps them.
        plain_moments: of a round from which nothing is learned, without statistics, by pixels: they tell how good its
            shares are. The same buffer where the method takes none.
    """

    def __init__(
        self,
        method: Method,
        strategies: tuple[str, ...],
        size: tuple[int, int],
        stratified: bool,
        device: str,
        stride: int = 1,
        lattice: bool = False,
    ) -> None:
        """size: the picture's width and height [pixel]; lattice: whether the sampler is one."""
        self.method = method
        self.stride = stride
        self.width, self.height = (-(-length // stride) for length in size)
        self.cells = self.width * self.height
        self.count = len(strategies)
        self.stratified = stratified
        self.whole_samples = make_whole_samples(self.count)
        self.layout = Layout(self.count if self.count > 1 else 0, method.statistics)
        self.moments = wp.zeros(self.cells if self.layout.size else 1, dtype=self.layout.vec, device=device)
        self.plain_moments = self.moments
        if method.statistics:
            plain = Layout(self.layout.strategies)
            self.plain_moments = wp.zeros(size[0] * size[1] if plain.size else 1, dtype=plain.vec, device=device)
        if method.solver == "candidates":
            self.solver = make_candidates(self.layout, stratified, lattice)
            self.efficiency = wp.zeros(self.cells, dtype=wp.vec2, device=device)
        elif method.learns:
            self.solver = SOLVERS[method.solver](self.layout)
        self.neighbours = None
        if "mean" in method.statistics:
            self.neighbours = Neighbours(self.layout, method.pool_radius, (self.width, self.height), device)

    @property
    def kernels(self) -> list[wp.Kernel]:
        """All that will be launched, so that they can be compiled beforehand."""
        solver = [self.solver, self.whole_samples] if self.method.learns else []
        return [*solver, *self.neighbours.kernels] if self.neighbours else solver

    @property
    def buffers(self) -> list[Any]:
        """All that is kept on the device, among what is not."""
        pooling = vars(self.neighbours).values() if self.neighbours else ()
        return list({id(buffer): buffer for buffer in (*vars(self).values(), *pooling)}.values())

    @property
    def min_share(self) -> float:
        """Bound of each share: the method's for two strategies, and as much for all together where there are more."""
        return 2.0 * self.method.min_share / self.count

    def begin_round(self, learn: bool) -> None:
        """The round that renders starts anew for every method."""
        if not learn:
            self.plain_moments.zero_()
        elif not self.method.keeps:
            self.moments.zero_()

    def make_whole(self, allocation: wp.array, samples: int, launch: Launch) -> None:
        """Make the shares whole numbers of samples, for a round of so many, where that is worth it."""
        if self.stratified and rounds_well(samples, self.count):
            launch(self.whole_samples, [allocation, samples, self.min_share])

    def step(self, allocation: wp.array, film: FilmView, launch: Launch) -> None:
        """Replace the cells' allocation by the next one; `film` holds the samples of the moments."""
        if self.neighbours:
            self.neighbours.pool(self.moments, film, launch)
            if self.method.solver == "candidates":
                self._choose(self.neighbours.pooled, allocation, launch)
            else:
                launch(self.solver, [self.neighbours.pooled, allocation, self.min_share])
        elif self.method.solver == "expectation":
            launch(self.solver, [self.moments, allocation, self.min_share])
        else:
            launch(self.solver, [self.moments, allocation, self.method.min_share, self.method.max_share])

    def _choose(self, pooled: wp.array, allocation: wp.array, launch: Launch) -> None:
        """Least variance; where cost counts, least product of the picture's variance and cost, by fixed point.

        All pixels take the same number of samples, so it is the product of the sums that is to be small: its derivative
        weighs cost by their quotient. Time saved where there is little noise is as good as any.
        """
        weight = 0.0
        launch(self.solver, [pooled, weight, allocation, self.efficiency])
        for _ in range(COST_STEPS if self.method.cost_aware else 0):
            variance, cost = self.efficiency.numpy().T
            lit = np.isfinite(variance) & (variance > 0.0)
            if not lit.any():
                return
            trusted = variance[lit] <= np.quantile(variance[lit], TRUSTED)
            weight = float(variance[lit][trusted].sum() / cost[lit][trusted].sum())
            launch(self.solver, [pooled, weight, allocation, self.efficiency])
