"""The spatial cache leaves the picture unbiased, where it learns from next to nothing and where its gate flips.

Paired t-tests over seeds against next-event estimation, Sidak-corrected; the power is asserted too.
"""

from __future__ import annotations

import numpy as np
import pytest
from statistical.estimates import REGIONS, block_means, caught_bias, estimates, load, paired_p_values
from stats import sidak

import warpmis
from warpmis.cache import training
from warpmis.rendering import guided

SIGNIFICANCE = 0.01
SEEDS = 150


@pytest.fixture
def small_rounds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rounds of 2, 4 and 8 samples per pixel in a picture of 24 x 24, all of them in the picture."""
    monkeypatch.setattr(training, "FIRST_PATHS", 1152)
    monkeypatch.setattr(training, "KEPT_SAMPLES", 1)


def test_learning_from_few_samples_is_unbiased(small_rounds: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guided, "THRESHOLD", 0.0)
    assert [(r.samples, r.is_kept) for r in training.training_rounds(576, 32)] == [(2, False), (4, True), (8, True)]
    found = estimates("room", SEEDS, spp=32, method="guided")
    reference = estimates("room", SEEDS, spp=64, method="nee")
    level = sidak(SIGNIFICANCE, REGIONS)
    assert paired_p_values(found, reference).min() > level
    assert caught_bias(found, reference, level) < 0.02


def test_a_gate_that_flips_is_unbiased(small_rounds: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """The gate's threshold is the median of what it sees: half of the pictures are guided."""
    scene = load("room")
    seen: list[float] = []
    original = guided.relative_variance
    monkeypatch.setattr(guided, "relative_variance", lambda *pictures: seen.append(original(*pictures)) or seen[-1])
    for seed in range(20):
        warpmis.render(scene, method="guided", spp=2, seed=seed)
    monkeypatch.setattr(guided, "THRESHOLD", float(np.median(seen)))
    results = [warpmis.render(scene, method="guided", spp=32, seed=seed) for seed in range(SEEDS)]
    share = np.mean([result.stats["next_event_pixels"] for result in results])
    assert 0.3 < share < 0.7
    found = np.array([block_means(result.image) for result in results])
    reference = estimates("room", SEEDS, spp=64, method="nee")
    level = sidak(SIGNIFICANCE, REGIONS)
    assert paired_p_values(found, reference).min() > level
    assert caught_bias(found, reference, level) < 0.02
