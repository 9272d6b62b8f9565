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
from warpmis.learn.newton_seed import make_newton_seed
from warpmis.learn.newton_share import make_newton_share
from warpmis.learn.newton_simplex import make_newton_simplex
from warpmis.learn.pooling import FLOOR, make_pool, make_scale
from warpmis.methods import Method

# Runs a kernel over all pixels: its first argument is the first pixel of a launch, these are the others.
Launch = Callable[[wp.Kernel, list[Any]], None]

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

# The least of several noisy estimates is too low, by about this over the root of the samples per pixel.
NOISE = 0.3


class Learner:
    """One render's learning.

    Attributes:
        moments: sums over the samples since the round began, or over all rounds if the method keeps them.
    """

    def __init__(
        self, method: Method, strategies: tuple[str, ...], size: tuple[int, int], stratified: bool, device: str
    ) -> None:
        self.method = method
        self.width, self.height = size
        self.count = len(strategies)
        self.layout = Layout(self.count if self.count > 1 else 0, method.statistics)
        pixels = self.width * self.height
        self.moments = wp.zeros(pixels if self.layout.size else 1, dtype=self.layout.vec, device=device)
        if method.solver == "candidates":
            self.solver = make_candidates(self.layout, stratified)
            self.efficiency = wp.zeros(pixels, dtype=wp.vec2d, device=device)
        elif method.learns:
            self.solver = SOLVERS[method.solver](self.layout)
        self.pools = "mean" in method.statistics
        if self.pools:
            self.scale, self.pool = make_scale(self.layout), make_pool(self.layout)
            self.scales = wp.zeros(pixels, dtype=wp.float64, device=device)
            self.pooled = wp.zeros(pixels, dtype=self.layout.vec, device=device)

    @property
    def kernels(self) -> list[wp.Kernel]:
        """All that will be launched, so that they can be compiled beforehand."""
        solver = [self.solver] if self.method.learns else []
        return [*solver, self.scale, self.pool] if self.pools else solver

    @property
    def min_share(self) -> float:
        """Bound of each share: the method's for two strategies, and as much for all together where there are more."""
        return 2.0 * self.method.min_share / self.count

    def begin_round(self, learn: bool) -> None:
        """The round that renders starts anew for every method: its moments tell how good the shares are."""
        if not (learn and self.method.keeps):
            self.moments.zero_()

    def step(self, allocation: wp.array, film: FilmView, launch: Launch) -> None:
        """Replace the allocation by the next one; `film` holds the samples of the moments."""
        if self.pools:
            self._pool(film, launch)
        if self.method.solver == "newton_simplex":
            launch(self.solver, [self.pooled, allocation, self.min_share])
        elif self.method.solver == "candidates":
            self._choose(allocation, film, launch)
        elif self.method.solver == "expectation":
            launch(self.solver, [self.moments, allocation, self.min_share])
        else:
            launch(self.solver, [self.moments, allocation, self.method.min_share, self.method.max_share])

    def _choose(self, allocation: wp.array, film: FilmView, launch: Launch) -> None:
        """Least variance; where cost counts, least product of the picture's variance and cost, by fixed point.

        All pixels take the same number of samples, so it is the product of the sums that is to be small: its derivative
        weighs cost by their quotient. Time saved where there is little noise is as good as any.
        """
        margin = NOISE / float(np.sqrt(max(int(film.accepted.numpy().max()), 1)))
        weight = 0.0
        launch(self.solver, [self.pooled, weight, margin, allocation, self.efficiency])
        for _ in range(COST_STEPS if self.method.cost_aware else 0):
            variance, cost = self.efficiency.numpy().T
            lit = np.isfinite(variance) & (variance > 0.0)
            if not lit.any():
                return
            trusted = variance[lit] <= np.quantile(variance[lit], TRUSTED)
            weight = float(variance[lit][trusted].sum() / cost[lit][trusted].sum())
            launch(self.solver, [self.pooled, weight, margin, allocation, self.efficiency])

    def _pool(self, film: FilmView, launch: Launch) -> None:
        total = self.moments.numpy()[:, self.layout.offset("mean")]
        usable = total[np.isfinite(total)]
        floor = FLOOR * float(usable.sum()) / max(int(film.accepted.numpy().sum()), 1)
        launch(self.scale, [self.moments, film, self.width, self.height, floor, self.scales])
        radius = self.method.pool_radius
        launch(self.pool, [self.moments, self.scales, film, self.width, self.height, radius, self.pooled])
