"""What every solver is: it turns the moments of many cells into their next allocations.

A cell is whatever has an allocation of its own: a pixel, a block of pixels, or a cell of a spatial cache. A solver sees
rows of numbers, one a cell, and treats each row on its own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import warp as wp

from warpmis.kernels.moments import Layout
from warpmis.methods import Method

# Runs a kernel over all cells: its first argument is the first cell of a launch, the list holds the others.
Launch = Callable[[wp.Kernel, list[Any]], None]


@dataclass(frozen=True)
class Problem:
    """What a solver is built for.

    Attributes:
        method: the bounds of the shares, and whether cost counts.
        layout: where each moment stands in a cell's row.
        cells: number of allocations.
        device: a Warp device.
        stratified: whether the choices of strategy are stratified over a cell's samples.
        lattice: whether a cell's samples lie on a lattice.
    """

    method: Method
    layout: Layout
    cells: int
    device: str
    stratified: bool
    lattice: bool = False

    @property
    def min_share(self) -> float:
        """Bound of each share: the method's for two strategies; their sum stays the same where there are more."""
        return 2.0 * self.method.min_share / self.layout.strategies


class Solver(Protocol):
    """One algorithm, built for a Problem."""

    def kernels(self) -> list[wp.Kernel]:
        """All that `step` launches, so that they can be compiled beforehand."""

    def buffers(self) -> list[wp.array]:
        """What the solver keeps on the device."""

    def step(self, moments: wp.array, shares: wp.array, launch: Launch) -> None:
        """Replace each cell's shares, shape (cells, S), by the next ones.

        moments: shape (cells, K). Sums in float64; or means relative to the brightness, in float32, for the methods
        that pool them (Method.pool_radius).
        """


@dataclass(frozen=True)
class KernelSolver:
    """A solver of shares that is a single kernel: (first cell, moments, shares, *bounds) -> shares in place."""

    kernel: wp.Kernel
    bounds: tuple[float, ...]

    def kernels(self) -> list[wp.Kernel]:
        return [self.kernel]

    def buffers(self) -> list[wp.array]:
        return []

    def step(self, moments: wp.array, shares: wp.array, launch: Launch) -> None:
        launch(self.kernel, [moments, shares, *self.bounds])
