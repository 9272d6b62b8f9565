"""Statistics for tests of samplers and estimators: how sure a test may be that numbers and densities agree.

Samplers are tested as Mitsuba 3 does (Jakob et al., mitsuba.chi2): directions are counted in cells, the density is
integrated over each cell, and Pearson's chi-square compares both. The density comes from the function that a renderer
asks for it, evaluated at many points of each cell, so that sampler and density are checked against each other.
Means are compared by z-tests (Subr and Arvo 2007, "Statistical Hypothesis Testing for Assessing Monte Carlo Estimators:
Applications to Image Synthesis"). Seeds are fixed: a test that passes keeps passing.

A test that cannot fail proves nothing: `detectable_imbalance` and `detectable_bias` tell which error would have been
found, and the tests assert that it is small enough.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import optimize
from scipy import stats as distributions

FloatArray = NDArray[np.float64]

# Probability with which an error of the stated size is found.
POWER = 0.99

# Pearson's statistic is chi-square distributed only where a cell expects this many counts.
MIN_EXPECTED = 5.0

# Share of the samples that rounding may put into cells of density 0 (Mitsuba's tolerance).
STRAY_SHARE = 1e-5

# Where all samples but this share lie in the grid, an integral that is by as little off is the quadrature's error: the
# shape of the density is tested alone. A greater error is left in the expected counts, where it shows as a misfit.
QUADRATURE_ERROR = 2e-3


def sidak(significance: float, tests: int) -> float:
    """Significance of each of `tests` independent tests, if all together may reject the truth with `significance`.

    Reference: Sidak (1967), "Rectangular Confidence Regions for the Means of Multivariate Normal Distributions".
    """
    return -float(np.expm1(np.log1p(-significance) / tests))


@dataclass(frozen=True)
class ChiSquare:
    """Result of a goodness-of-fit test. p_value: probability of a fit this bad if the density is right."""

    statistic: float
    dof: int
    p_value: float
    count: float


def chi_square(observed: FloatArray, expected: FloatArray) -> ChiSquare:
    """Pearson's test of counts against expected counts of the same sum.

    Cells that expect fewer than MIN_EXPECTED are pooled, the smallest first. Samples in cells that expect none reject
    outright, but for the share that rounding explains.

    Reference: Pearson (1900); the pooling is Mitsuba's (mitsuba.chi2.ChiSquareTest).
    """
    observed = np.asarray(observed, dtype=np.float64).ravel()
    expected = np.asarray(expected, dtype=np.float64).ravel()
    assert observed.shape == expected.shape and (expected >= 0.0).all()
    count = float(observed.sum())
    impossible = expected == 0.0
    if observed[impossible].sum() > STRAY_SHARE * count:
        return ChiSquare(np.inf, 0, 0.0, count)
    order = np.argsort(expected[~impossible], kind="stable")
    o, e = observed[~impossible][order], expected[~impossible][order]
    # The pool holds the smallest cells, and as many as it takes for the pool itself to expect enough.
    pooled = int(np.searchsorted(e, MIN_EXPECTED))
    if pooled:
        pooled = max(pooled, int(np.searchsorted(np.cumsum(e), MIN_EXPECTED)) + 1)
        o = np.append(o[pooled:], o[:pooled].sum())
        e = np.append(e[pooled:], e[:pooled].sum())
    dof = len(e) - 1
    statistic = float(((o - e) ** 2 / e).sum())
    p_value = float(distributions.chi2.sf(statistic, dof)) if dof > 0 else 1.0
    return ChiSquare(statistic, dof, p_value, count)


def uniformity(values: FloatArray, cells: int) -> ChiSquare:
    """Chi-square test of points in the unit cube, shape (n, dimensions), in cells^dimensions equal boxes."""
    values = np.asarray(values, dtype=np.float64)
    points = values[:, None] if values.ndim == 1 else values
    columns = np.minimum((points * cells).astype(np.int64), cells - 1)
    index = np.ravel_multi_index(tuple(columns.T), (cells,) * points.shape[1])
    counts = np.bincount(index, minlength=cells ** points.shape[1])
    return chi_square(counts.astype(np.float64), np.full(len(counts), len(points) / len(counts)))


@dataclass(frozen=True, eq=False)
class DirectionGrid:
    """Cells of directions: rings of 1 - cos(theta) about an axis times sectors of phi. What lies outside is one cell.

    1 - cos(theta) instead of the cosine, so that the grid may cover a cone of seconds of arc.

    Attributes:
        frame: rows s, t, n of a right-handed orthonormal frame, n the axis, shape (3, 3).
        heights: edges of 1 - cos(theta), increasing within [0, 2], shape (rings + 1,).
        azimuths: edges of phi, increasing within [-pi, pi], shape (sectors + 1,).
    """

    frame: FloatArray
    heights: FloatArray
    azimuths: FloatArray

    @classmethod
    def about(cls, axis: FloatArray, heights: FloatArray, sectors: int) -> DirectionGrid:
        """Equal sectors about an axis."""
        return cls(frame_about(axis), np.asarray(heights, float), np.linspace(-np.pi, np.pi, sectors + 1))

    @classmethod
    def fitted(
        cls,
        directions: NDArray[np.float32],
        levels: FloatArray,
        sectors: int,
        *,
        axis: FloatArray | None = None,
        margin: float = 1.2,
    ) -> DirectionGrid:
        """A grid where the directions are, about their mean or a given axis.

        The rings end at the quantiles `levels`, from 0 to 1, of 1 - cos(theta), the last one by the factor `margin`
        later; all sectors are equally full. The directions must be others than those that will be tested, or the test
        would be too lenient.
        """
        frame = frame_about(directions.mean(axis=0, dtype=np.float64) if axis is None else axis)
        height, azimuth = polar(frame, directions)
        heights = np.quantile(height, levels)
        heights[0], heights[-1] = 0.0, min(2.0, margin * heights[-1])
        azimuths = np.quantile(azimuth, np.linspace(0.0, 1.0, sectors + 1))
        azimuths[0], azimuths[-1] = -np.pi, np.pi
        return cls(frame, heights, azimuths)

    @cached_property
    def cells(self) -> int:
        return (len(self.heights) - 1) * (len(self.azimuths) - 1)

    def counts(self, directions: NDArray[np.float32]) -> FloatArray:
        """Directions in each cell, the last entry those outside, shape (cells + 1,)."""
        height, azimuth = polar(self.frame, directions)
        ring = np.searchsorted(self.heights, height, side="right") - 1
        sector = np.searchsorted(self.azimuths, azimuth, side="right") - 1
        sectors = len(self.azimuths) - 1
        # phi = pi itself is the last sector's edge.
        sector = np.minimum(sector, sectors - 1) if self.azimuths[-1] >= np.pi else sector
        inside = (ring >= 0) & (ring < len(self.heights) - 1) & (sector >= 0) & (sector < sectors)
        index = np.where(inside, ring * sectors + sector, self.cells)
        return np.bincount(index, minlength=self.cells + 1).astype(np.float64)

    def points(self, side: int, seed: int = 1) -> NDArray[np.float32]:
        """side x side directions in each cell, one jittered in each part of it, shape (cells * side^2, 3).

        Jittered, because a regular lattice would alias with edges of the density that run along it.
        """
        u, v = np.random.default_rng(seed).random((2, self.cells, side, side))
        u = (np.arange(side)[:, None] + u) / side
        v = (np.arange(side)[None, :] + v) / side
        shape = (len(self.heights) - 1, len(self.azimuths) - 1, side, side)
        height = self.heights[:-1, None, None, None] + np.diff(self.heights)[:, None, None, None] * u.reshape(shape)
        phi = self.azimuths[:-1, None, None] + np.diff(self.azimuths)[:, None, None] * v.reshape(shape)
        sin_theta = np.sqrt(height * (2.0 - height))
        local = np.stack([sin_theta * np.cos(phi), sin_theta * np.sin(phi), 1.0 - height], axis=-1)
        return (local.reshape(-1, 3) @ self.frame).astype(np.float32)

    @cached_property
    def solid_angles(self) -> FloatArray:
        """Solid angle of each cell [sr], shape (cells,)."""
        return (np.diff(self.heights)[:, None] * np.diff(self.azimuths)[None, :]).ravel()

    def integrals(self, values: NDArray[np.float32], side: int) -> FloatArray:
        """Integral over each cell of what was evaluated at `points(side)`, shape (cells, ...)."""
        values = values.reshape(self.cells, side * side, *values.shape[1:])
        means = values.mean(axis=1, dtype=np.float64)
        return means * self.solid_angles.reshape(-1, *(1,) * (means.ndim - 1))


class Grid(Protocol):
    """Cells of directions, and a quadrature over each; see DirectionGrid."""

    def counts(self, directions: NDArray[np.float32]) -> FloatArray: ...

    def points(self, side: int) -> NDArray[np.float32]: ...

    def integrals(self, values: NDArray[np.float32], side: int) -> FloatArray: ...


Density = Callable[[NDArray[np.float32]], NDArray[np.float32]]


def fit_directions(
    directions: NDArray[np.float32], density: Density, grid: Grid, side: int = 32, missing: int = 0
) -> tuple[ChiSquare, float]:
    """Chi-square test of sampled directions against a density in solid angle, and the density's integral.

    Args:
        directions: independent samples, shape (n, 3), those left out for which the sampler had no direction.
        density: the density of any directions, evaluated by another way than the sampler's own.
        side: the density is integrated over a cell from side^2 points.
        missing: how often the sampler had no direction: counted as outside the grid, where the density's integral
            leaves room for them.
    """
    masses = grid.integrals(density(grid.points(side)), side)
    integral = float(masses.sum())
    count = len(directions) + missing
    observed = grid.counts(directions)
    observed[-1] += missing
    expected = np.append(masses, max(0.0, 1.0 - integral)) * count
    outside = observed[-1] / count
    if outside < QUADRATURE_ERROR and abs(integral + outside - 1.0) < QUADRATURE_ERROR:
        observed, expected = observed[:-1], expected[:-1] * ((1.0 - outside) / integral)
    return chi_square(observed, expected), integral


def frame_about(axis: FloatArray) -> FloatArray:
    """Rows s, t, n of an orthonormal right-handed frame with n along the axis."""
    n = np.asarray(axis, dtype=np.float64) / np.linalg.norm(axis)
    s = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
    s /= np.linalg.norm(s)
    return np.stack([s, np.cross(n, s), n])


def polar(frame: FloatArray, directions: NDArray[np.float32]) -> tuple[FloatArray, FloatArray]:
    """1 - cos(theta) and phi of directions in a frame. |d - n|^2 / 2 keeps the digits of small angles."""
    d = np.asarray(directions, dtype=np.float64)
    height = 0.5 * ((d - frame[2]) ** 2).sum(axis=1)
    return np.minimum(height, 2.0), np.arctan2(d @ frame[1], d @ frame[0])


def z_test(mean: float, standard_error: float, expected: float) -> float:
    """Two-sided p-value of a mean against a number that is exactly known."""
    if standard_error == 0.0:
        return float(mean == expected)
    return float(2.0 * distributions.norm.sf(abs(mean - expected) / standard_error))


def welch_test(a: FloatArray, b: FloatArray) -> float:
    """Two-sided p-value for the equality of two samples' means, their variances unequal.

    Reference: Welch (1947), "The Generalization of Student's Problem when Several Different Population Variances are
    Involved".
    """
    return float(distributions.ttest_ind(a, b, equal_var=False).pvalue)


def standard_error(values: FloatArray) -> float:
    """Of the mean of independent values."""
    values = np.asarray(values, dtype=np.float64)
    return float(values.std(ddof=1) / np.sqrt(len(values)))


def detectable_bias(standard_error: float, significance: float) -> float:
    """The error of a mean that a two-sided z-test finds with probability POWER: (z_(1-a/2) + z_POWER) se."""
    return float((distributions.norm.isf(0.5 * significance) + distributions.norm.ppf(POWER)) * standard_error)


def detectable_imbalance(count: float, dof: int, significance: float) -> float:
    """The relative error d that a chi-square test finds with probability POWER if the density is by d too large over
    one half of the probability and too small by d over the other: its noncentrality is count d^2.

    Reference: Patnaik (1949), "The Non-Central Chi-Square and F-Distributions and their Applications".
    """
    critical = distributions.chi2.isf(significance, dof)
    noncentrality = optimize.brentq(lambda x: distributions.ncx2.sf(critical, dof, x) - POWER, 1e-3, 100.0 * critical)
    return float(np.sqrt(noncentrality / count))
