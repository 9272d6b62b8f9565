"""Each strategy of the mixture, and the mixture of all: what is drawn has the density that the path divides by.

The density is taken as the path takes it, `vertex_densities` completed by the lights on the ray, which knows nothing of
how the direction was drawn; also where a strategy has nothing to sample and draws from the BSDF.

Significance is Sidak-corrected over the file; each chi-square test has the power to find a density that is wrong by
3 % over half of its probability, one way or the other (asserted).
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from statistical.strategies import LOOK, MIXTURE, POINTS, normal_of, run
from stats import DirectionGrid, detectable_imbalance, fit_directions, sidak

from warpmis.config import STRATEGIES

COUNT = 150_000
PILOT = 1 << 15
SIGNIFICANCE = sidak(0.01, len(POINTS) * (len(STRATEGIES) + 1))
DETECTABLE = 0.03

# The hemisphere is theirs without a sample lost.
WHOLE = ("uniform", "cosine")
SIDE = 48


def directions_above(point: str, strategy: int, count: int, seed: int) -> NDArray[np.float32]:
    """What is drawn by a strategy, or by the mixture of all in unequal shares, above the horizon."""
    wi = run(POINTS[point], strategy, count, allocation(), seed)[0]
    return wi[wi @ normal_of(POINTS[point]).astype(np.float32) > 0.0]


@cache
def allocation() -> NDArray[np.float64]:
    return np.random.default_rng(1).dirichlet(np.full(len(STRATEGIES), 3.0))


@pytest.mark.parametrize("point", POINTS)
@pytest.mark.parametrize("name", [*STRATEGIES, "mixture"])
def test_directions_have_the_density_that_the_path_divides_by(name: str, point: str) -> None:
    strategy = MIXTURE if name == "mixture" else STRATEGIES.index(name)
    pilot = directions_above(point, strategy, PILOT, seed=2)
    grid = DirectionGrid.fitted(pilot, np.linspace(0.0, 1.0, 13), sectors=12)
    wi = directions_above(point, strategy, COUNT, seed=1)

    def density(directions: NDArray[np.float32]) -> NDArray[np.float32]:
        p = run(POINTS[point], LOOK, directions)[1]["densities"]
        return p @ allocation().astype(np.float32) if name == "mixture" else p[:, strategy]

    missing = COUNT - len(wi)
    fit, integral = fit_directions(wi, density, grid, SIDE, missing)
    assert fit.p_value > SIGNIFICANCE, fit
    assert detectable_imbalance(fit.count, fit.dof, SIGNIFICANCE) < DETECTABLE
    # The quadrature's error; a part of it where samples are lost, below the horizon or at an emitter's back.
    assert integral == pytest.approx(1.0 - missing / COUNT, abs=5e-3)
    assert integral <= 1.0 + 2e-3
    if name in WHOLE or (name == "diffuse" and "diffuse" not in POINTS[point].falls_back):
        assert missing == 0


@pytest.mark.parametrize("point", POINTS)
def test_where_there_is_nothing_to_sample_the_density_is_that_of_the_bsdf(point: str) -> None:
    random = np.random.default_rng(1).normal(size=(20_000, 3))
    n = normal_of(POINTS[point])
    random[random @ n <= 0.0] *= -1.0
    wi = (random / np.linalg.norm(random, axis=1)[:, None]).astype(np.float32)
    out = run(POINTS[point], LOOK, wi)[1]
    above = out["pdf_bsdf"] > 0.0
    assert above.mean() > 0.999
    bsdf = out["densities"][:, STRATEGIES.index("bsdf")]
    np.testing.assert_array_equal(bsdf, out["pdf_bsdf"])
    fallen = {name for k, name in enumerate(STRATEGIES) if (out["densities"][:, k] == bsdf).all()} - {"bsdf"}
    same = {"diffuse": {"cosine", "diffuse"}, "gold": {"specular"}}.get(POINTS[point].material, set())
    assert fallen == set(POINTS[point].falls_back) | same


def test_strategies_are_chosen_by_their_shares_and_never_at_share_0() -> None:
    shares = np.array([0.0, 0.3, 0.0, 0.05, 0.25, 0.0, 0.4, 0.0])
    _, out = run(POINTS["everything"], MIXTURE, COUNT, shares)
    counts = np.bincount(out["strategy"], minlength=len(shares))
    assert (counts[shares == 0.0] == 0).all()
    np.testing.assert_allclose(counts / COUNT, shares, atol=4.0 * np.sqrt(0.25 / COUNT))
    # 1 / a_s for the one that drew: on average each strategy has its own share's worth.
    q = out["q"][np.arange(COUNT), out["strategy"]]
    np.testing.assert_allclose(q, 1.0 / shares[out["strategy"]], rtol=1e-6)
    np.testing.assert_allclose(out["q"].sum(axis=1), q, rtol=1e-6)
