"""One render's learning: a method's moments, and the solver that turns them into the next allocation."""

from __future__ import annotations

from typing import Any

import warp as wp

from warpmis.device.views import FilmView
from warpmis.kernels.moments import Layout
from warpmis.learn.control_variate import make_in_radiance
from warpmis.learn.neighbours import Neighbours
from warpmis.learn.solver import Launch, Problem
from warpmis.learn.solvers import SOLVERS
from warpmis.learn.variance_aware import make_end_round
from warpmis.learn.whole_samples import make_whole_samples, rounds_well
from warpmis.methods import Method


class Learner:
    """Learning by pixels.

    Attributes:
        moments: sums over the samples since the round began, or over all rounds if the method keeps them.
        plain_moments: of a round from which nothing is learned, without statistics, by pixels: they tell how good its
            shares are. The same buffer where the method takes no statistics.
    """

    def __init__(
        self,
        method: Method,
        strategies: tuple[str, ...],
        size: tuple[int, int],
        stratified: bool,
        device: str,
        lattice: bool = False,
    ) -> None:
        """size: the picture's width and height [pixel]; lattice: whether the sampler is one."""
        self.method = method
        pixels = size[0] * size[1]
        self.count = len(strategies)
        is_mixture = self.count > 1 and not method.is_of_pair
        self.layout = Layout(self.count if is_mixture else 0, method.statistics)
        self.whole_samples = None if method.is_of_pair else make_whole_samples(self.count)
        self.end_round = make_end_round(self.layout) if "between_rounds" in method.statistics else None
        self.in_radiance = make_in_radiance() if method.allocation == "control" else None
        self.problem = Problem(method, self.layout, pixels, device, stratified, lattice)
        self.moments = allocate_moments(self.layout, pixels, device)
        self.plain_moments = self.moments
        if method.statistics:
            self.plain_moments = allocate_moments(Layout(self.layout.strategies), pixels, device)
        self.solver = SOLVERS[method.solver](self.problem) if method.learns else None
        self.neighbours = None
        if method.pool_radius is not None:
            self.neighbours = Neighbours(self.layout, method.pool_radius, size, device)

    @property
    def kernels(self) -> list[wp.Kernel]:
        """All that will be launched, so that they can be compiled beforehand."""
        if self.solver is None:
            return []
        own = [kernel for kernel in (self.whole_samples, self.end_round, self.in_radiance) if kernel is not None]
        return [*self.solver.kernels(), *own, *(self.neighbours.kernels if self.neighbours else [])]

    @property
    def buffers(self) -> list[Any]:
        """All that learning keeps on the device."""
        sums = [self.moments] if self.plain_moments is self.moments else [self.moments, self.plain_moments]
        solver = self.solver.buffers() if self.solver else []
        return [*sums, *solver, *(self.neighbours.buffers if self.neighbours else [])]

    def begin_round(self, learn: bool) -> None:
        """The round that renders starts anew for every method."""
        if not learn:
            self.plain_moments.zero_()
        elif not self.method.keeps:
            self.moments.zero_()

    def step(self, shares: wp.array, film: FilmView, launch: Launch) -> None:
        """Replace the pixels' shares by the next ones; `film` holds the samples of the moments."""
        assert self.solver is not None
        moments = self.moments
        if self.end_round:
            launch(self.end_round, [moments])
        if self.neighbours:
            moments = self.neighbours.pool(self.moments, film, launch)
        self.solver.step(moments, shares, launch)
        if self.neighbours and self.in_radiance:
            launch(self.in_radiance, [self.neighbours.brightness, shares])

    def round_to_samples(self, shares: wp.array, samples: int, launch: Launch) -> None:
        """Make the shares whole numbers of samples, for a round of so many, where that is worth it."""
        if self.whole_samples and self.problem.stratified and rounds_well(samples, self.count):
            launch(self.whole_samples, [shares, samples, self.problem.min_share])


def allocate_moments(layout: Layout, cells: int, device: str) -> wp.array:
    """A row of zeros a cell; one in all where the layout is empty."""
    return wp.zeros(cells if layout.size else 1, dtype=layout.vec, device=device)
