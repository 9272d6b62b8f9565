"""The spatial cache leaves the picture unbiased, where it learns from next to nothing and where its gate flips.

Paired t-tests over seeds against next-event estimation, Sidak-corrected; the power is asserted too.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from statistical.estimates import REGIONS, block_means, caught_bias, estimates, load, paired_p_values
from stats import sidak

import warpmis
from warpmis.cache import gate, training
from warpmis.cache.cell_shares import CellShares
from warpmis.config import CELL_STRATEGIES
from warpmis.rendering import guided

SIGNIFICANCE = 0.01
SEEDS = 24
MOST_SEEDS = 36


@cache
def reference() -> NDArray[np.float64]:
    """Of the room, by next-event estimation."""
    return estimates("room", MOST_SEEDS, spp=48, method="nee")


@pytest.fixture
def small_rounds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rounds of 2, 2, 2 and 4 samples per pixel in a picture of 24 x 24, all but the first in the picture."""
    monkeypatch.setattr(training, "FIRST_PATHS", 1152)
    monkeypatch.setattr(training, "KEPT_SAMPLES", 1)
    monkeypatch.setattr(training, "PILOT_SAMPLES", 2)
    monkeypatch.setattr(gate, "PILOT_SHARE", 1.0)
    monkeypatch.setattr(guided, "FEWEST_SAMPLES", 0)
    kept = [(one.stride, one.samples, one.is_kept) for one in training.training_rounds(576, 32)]
    assert kept == [(1, 2, False), (1, 2, True), (1, 2, True), (1, 4, True)]


MIXTURE: dict[str, Any] = {"method": "cells", "strategies": CELL_STRATEGIES}


def check(found: NDArray[np.float64]) -> None:
    expected = reference()[: len(found)]
    level = sidak(SIGNIFICANCE, REGIONS)
    assert paired_p_values(found, expected).min() > level
    assert caught_bias(found, expected, level) < 0.02


# Of more strategies each learns from fewer samples.
@pytest.mark.parametrize(
    ("how", "seeds"), [({"method": "guided"}, SEEDS), (MIXTURE, MOST_SEEDS)], ids=["guided", "all strategies"]
)
def test_learning_from_few_samples_is_unbiased(small_rounds: None, how: dict[str, Any], seeds: int) -> None:
    check(estimates("room", seeds, spp=32, **how))


def test_a_gate_that_flips_is_unbiased(small_rounds: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """What a trial has to promise is the median of what trials promise: half of the pictures are guided."""
    scene = load("room")
    monkeypatch.setattr(gate, "QUIET", 0.0)
    gains: list[float] = []

    def remember(pilot: gate.Trial, trials: list[gate.Trial], prospects: list[gate.Prospect]) -> bool:
        if trials:
            gains.append(gate.promised(pilot, trials[-1], prospects[len(trials) - 1]))
        return False

    with monkeypatch.context() as watched:
        watched.setattr(guided, "pays", remember)
        for seed in range(20):
            warpmis.render(scene, method="auto", spp=32, seed=seed)
    monkeypatch.setattr(gate, "LEAST_GAIN", float(np.median(gains)))
    results = [warpmis.render(scene, method="auto", spp=32, seed=seed) for seed in range(SEEDS)]
    share = np.mean([result.stats["next_event_pixels"] for result in results])
    assert 0.3 < share < 0.7
    check(np.array([block_means(result.image) for result in results]))


@pytest.mark.slow
@pytest.mark.parametrize("strategies", [("bsdf",), ("bsdf", "light"), ("bsdf", "guide"), CELL_STRATEGIES])
@pytest.mark.parametrize("name", ["cornell_box", "veach_plates", "hidden_light"])
def test_mixtures_by_cells_have_the_mean(name: str, strategies: tuple[str, ...]) -> None:
    found = estimates(name, 24, spp=512, method="cells", strategies=strategies)
    reference = estimates(name, 24, spp=512, method="nee")
    level = sidak(SIGNIFICANCE, 12 * REGIONS)
    assert paired_p_values(found, reference).min() > level
    assert caught_bias(found, reference, level) < 0.05


def test_learned_shares_lower_the_variance(monkeypatch: pytest.MonkeyPatch) -> None:
    """Against equal shares of the same strategies, with the same guides and rates; two of the strategies lose here."""
    how: dict[str, Any] = {"method": "cells", "strategies": ("bsdf", "uniform", "area", "light"), "spp": 128}
    learned = estimates("room", 12, **how)
    with monkeypatch.context() as frozen:
        frozen.setattr(CellShares, "_solve", lambda self, launch: None)
        equal = estimates("room", 12, **how)
    ratio = learned.var(axis=0, ddof=1).sum() / equal.var(axis=0, ddof=1).sum()
    assert ratio < 0.8


@pytest.mark.slow
def test_mean_of_a_thousand_short_renders(small_rounds: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 16 samples per pixel each, most of them spent on learning, by a trial that now and then says no."""
    monkeypatch.setattr(gate, "QUIET", 0.0)
    found = estimates("room", 1000, spp=16, method="auto")
    reference = estimates("room", 1000, spp=16, method="nee")
    level = sidak(SIGNIFICANCE, REGIONS)
    assert paired_p_values(found, reference).min() > level
    assert caught_bias(found, reference, level) < 0.02
