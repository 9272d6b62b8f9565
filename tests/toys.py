"""Integrands on [0, 1] whose moments are known without sampling, for tests of what is learned from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpmis.kernels.moments import Layout

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Toy:
    """An integrand and the strategies' densities, constant on equal cells of [0, 1].

    Attributes:
        f: integrand, shape (n,).
        p: densities, each of mean 1 over the cells, shape (n, S).
    """

    f: FloatArray
    p: FloatArray

    @property
    def integral(self) -> float:
        return float(self.f.mean())

    def expectation(self, values: FloatArray, a: Sequence[float] | FloatArray) -> Any:
        """Of one value a cell, shape (n, ...), where cells are drawn by p_a."""
        return np.tensordot(self.p @ np.asarray(a), values, axes=(0, 0)) / len(self.f)

    def second_moment(self, a: Sequence[float] | FloatArray) -> float:
        return float((self.f**2 / (self.p @ np.asarray(a))).mean())

    def variance(self, a: Sequence[float] | FloatArray) -> float:
        """Of F = f / p_a, the strategy drawn anew for each sample."""
        return self.second_moment(a) - self.integral**2

    def stratified_variance(self, a: Sequence[float] | FloatArray) -> float:
        """Of F, where each strategy draws just its share: the variance within the strategies, sum_s a_s V_s[F]."""
        F = self.f / (self.p @ np.asarray(a))
        within = [(self.p[:, s] * F**2).mean() - (self.p[:, s] * F).mean() ** 2 for s in range(self.p.shape[1])]
        return float(np.dot(a, within))

    def quotients(self, a: Sequence[float] | FloatArray) -> FloatArray:
        """q_s = p_s / p_a, shape (n, S)."""
        return self.p / (self.p @ np.asarray(a))[:, None]

    def moments(self, a: Sequence[float] | FloatArray) -> FloatArray:
        """m_s, then h_st for s <= t row by row, of one sample."""
        q = self.quotients(a)
        F2 = (self.f / (self.p @ np.asarray(a))) ** 2
        rows, columns = np.triu_indices(q.shape[1])
        values = np.concatenate([F2[:, None] * q, F2[:, None] * q[:, rows] * q[:, columns]], axis=1)
        return self.expectation(values, a)

    def best(self, low: float = 0.1, high: float = 0.9) -> float:
        """The first of two shares with the least variance, on a grid of 1e-4."""
        grid = np.linspace(low, high, round((high - low) * 1e4) + 1)
        return float(grid[np.argmin([self.second_moment((share, 1.0 - share)) for share in grid])])


def smooth() -> Toy:
    """f between two densities that overlap everywhere: an optimum well inside."""
    x = (np.arange(2000) + 0.5) / 2000
    p = np.stack([2.0 * x, np.ones_like(x)], axis=1)
    return Toy(0.6 * 2.0 * x + 0.4 * (0.5 + 0.5 * np.sin(3.0 * x)), p)


def perfect() -> Toy:
    """f is the first density, and the second draws nothing of it: M2 = c / a."""
    first = np.where(np.arange(1000) < 500, 2.0, 0.0)
    return Toy(first, np.stack([first, 2.0 - first], axis=1))


def bumps(count: int, seed: int) -> Toy:
    """`count` overlapping bumps, and a positive integrand that none of them nor any mixture equals."""
    rng = np.random.default_rng(seed)
    x = (np.arange(400) + 0.5) / 400
    centers = np.linspace(0.0, 1.0, count)
    p = np.exp(-((x[:, None] - centers) ** 2) / (0.5 / count)) + 0.05
    p /= p.mean(axis=0)
    return Toy(p @ rng.dirichlet(np.full(count, 8.0)) * (1.0 + 0.2 * np.sin(9.0 * x + 6.0 * rng.random())), p)


def random_moments(count: int, pixels: int, seed: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """F^2, shape (pixels, n), q, shape (pixels, n, S), and allocations, shape (pixels, S).

    Heavy-tailed as a renderer's. In some pixels one strategy is by far the best. The allocations are exact in
    float32, as the kernels read them.
    """
    rng = np.random.default_rng(seed)
    a = rng.dirichlet(np.full(count, 3.0), size=pixels) * (1.0 - 0.05 * count) + 0.05
    a = a.astype(np.float32).astype(np.float64)
    p = rng.gamma(1.0, size=(pixels, 200, count)) ** 2
    q = p / np.einsum("ps,pns->pn", a, p)[..., None]
    liked = np.einsum("ps,pns->pn", rng.dirichlet(np.full(count, 0.3), size=pixels), q)
    return liked**2 * rng.lognormal(0.0, 1.5, size=liked.shape), q, a


def sums(F2: FloatArray, q: FloatArray) -> FloatArray:
    """Moments as the trace kernel adds them up, of samples F2, shape (pixels, n), and q, shape (pixels, n, S)."""
    rows, columns = np.triu_indices(q.shape[-1])
    first = np.einsum("pn,pns->ps", F2, q)
    return np.concatenate([first, np.einsum("pn,pnk->pk", F2, q[..., rows] * q[..., columns])], axis=1)


def filled(layout: Layout, **parts: FloatArray | float) -> FloatArray:
    """A pixel's vector with the named statistics in their places; `moments` stands for m_s and h_st, 0 for the rest."""
    vector = np.zeros(layout.size)
    for name, part in parts.items():
        values = np.atleast_1d(part)
        start = 0 if name == "moments" else layout.offset(name)
        vector[start : start + len(values)] = values
    return vector


def solve(kernel: wp.Kernel, vec_k: type, moments: FloatArray, allocation: Any, *arguments: Any) -> FloatArray:
    """The allocations after one run of a solver on moments of type vec_k, shape (pixels, S)."""
    vec_s = wp.types.vector(length=np.shape(allocation)[1], dtype=wp.float32)
    shares = wp.array(np.array(allocation, dtype=np.float32), dtype=vec_s, device="cpu")
    known = wp.array(np.ascontiguousarray(moments, dtype=np.float64), dtype=vec_k, device="cpu")
    wp.launch(kernel, dim=len(shares), inputs=[0, known, shares, *arguments], device="cpu")
    return shares.numpy().astype(np.float64)


def bad_moments(good: FloatArray) -> dict[str, FloatArray]:
    """What nothing can be learned from: no light, and sums of which one or all are out of range."""
    cases = {"no light": np.zeros_like(good), "all nan": np.full_like(good, np.nan)}
    cases["all infinite"] = np.full_like(good, np.inf)
    for entry in range(len(good)):
        for value in (np.nan, np.inf):
            cases[f"entry {entry} {value}"] = np.where(np.arange(len(good)) == entry, value, good)
    return cases
