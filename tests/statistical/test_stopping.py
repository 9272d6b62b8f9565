"""Stopping is honest: over 40 seeds the error is below the target, and within its stated spread, as often as stated.

The truth is a render of many more samples, whose own noise is taken out. Seeds are fixed. Of each claim, 95 %, the
binomial test rejects the truth with a probability of 1 %, and finds with 97 % a claim that holds in 70 % alone.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from statistical.estimates import load

import warpmis
from warpmis.film.metrics import relative_mse, squared_error, squared_scale, without_outliers

SEEDS = 40
SIGNIFICANCE = 0.01
CLAIMED = 0.95

# Samples of the truth over those of a run.
REFERENCE = 16


def test_power() -> None:
    rejected = [k for k in range(SEEDS) if not holds(k)]
    assert stats.binom.sf(rejected[0] - 1, SEEDS, 1.0 - CLAIMED) < SIGNIFICANCE
    assert stats.binom.sf(rejected[0] - 1, SEEDS, 0.3) > 0.97


def holds(broken: int) -> bool:
    return bool(stats.binomtest(broken, SEEDS, 1.0 - CLAIMED, alternative="greater").pvalue > SIGNIFICANCE)


@pytest.mark.parametrize(
    ("name", "target", "sampler", "method"),
    [
        ("room", 0.2, "lattice", "nee"),
        ("room", 0.1, "lattice", "guided"),
        pytest.param("cornell_box", 0.1, "independent", "auto", marks=pytest.mark.slow),
        pytest.param("ajar_door", 0.3, "lattice", "auto", marks=pytest.mark.slow),
        pytest.param("veach_plates", 0.05, "independent", "auto", marks=pytest.mark.slow),
        pytest.param("cornell_box", 0.1, "lattice", "auto", marks=pytest.mark.slow),
        pytest.param("veach_plates", 0.05, "lattice", "auto", marks=pytest.mark.slow),
    ],
)
def test_the_error_is_what_it_is_said_to_be(name: str, target: float, sampler: str, method: str) -> None:
    scene = load(name)
    settings = {"target_error": target, "sampler": sampler, "method": method}
    runs = [warpmis.render(scene, seed=seed, **settings) for seed in range(SEEDS)]
    told = [run.stats["stopping"] for run in runs]
    assert {one["reason"] for one in told} == {"target error"}
    spp = REFERENCE // 2 * round(np.median([one["spp"] for one in told]))
    halves = [warpmis.render(scene, spp=spp, seed=1000 + half, method="guided").image for half in range(2)]
    truth = 0.5 * (halves[0].astype(np.float64) + halves[1])
    noise = without_outliers(squared_error(*halves) / 4.0 / squared_scale(truth)).mean()
    errors = np.array([max(relative_mse(run.image, truth) - noise, 0.0) for run in runs]) ** 0.5
    estimates, spreads = (np.array([one[key] for one in told]) for key in ("relative_error", "standard_error"))
    apart = (errors - estimates) / spreads
    broken = int((errors > target).sum())
    outside = int((np.abs(apart) > stats.norm.isf((1.0 - CLAIMED) / 2)).sum())
    found = f"{errors.mean():.4f} for {estimates.mean():.4f}, {broken} above the target, {outside} outside the spread"
    found += f", scatter {apart.std():.2f} of the spread, {np.median([one['spp'] for one in told]):.0f} spp"
    print(name, sampler, method, found)
    assert holds(broken), found
    assert holds(outside), found
    assert errors.mean() == pytest.approx(estimates.mean(), rel=0.1), found
