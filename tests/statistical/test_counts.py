"""Any counts of light samples and paths at the first vertex leave the picture unbiased, and so does a pilot.

Paired t-tests over seeds against next-event estimation, Sidak-corrected; the power is asserted too.
"""

from __future__ import annotations

import numpy as np
import pytest
from statistical.estimates import REGIONS, block_means, caught_bias, estimates, load, paired_p_values
from stats import sidak

import warpmis
from warpmis.rendering import counted

SIGNIFICANCE = 0.01
SEEDS = 24
PILOTS = 48
GIVEN = ((0, 1), (2, 1), (1, 2), (4, 3))
SCENES = {"room": 0.03, "hidden_light": 0.03}
LEVEL = sidak(SIGNIFICANCE, (len(GIVEN) * len(SCENES) + 1) * REGIONS)


def small_pilots(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two rounds of two samples in a few pixels, whatever the picture's samples."""
    values = {"FEWEST_PIXELS": 1, "PILOT_PART": 1e9, "PILOT_ROUNDS": 2, "PILOT_SAMPLES": 2, "PILOT_PIXELS": 36}
    for name, value in values.items():
        monkeypatch.setattr(counted, name, value)


@pytest.mark.parametrize("name", SCENES)
def test_given_counts(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    small_pilots(monkeypatch)
    reference = estimates(name, SEEDS, spp=32, method="nee")
    for lights, paths in GIVEN:
        monkeypatch.setattr(counted, "best_counts", lambda *_, given=(lights, paths): given)
        found = estimates(name, SEEDS, spp=16, method="counts")
        assert paired_p_values(found, reference).min() > LEVEL, (lights, paths)
        if lights > 0:  # without them few paths find the lamp
            assert caught_bias(found, reference, LEVEL) < SCENES[name], (lights, paths)


def test_a_pilot_that_decides_by_chance(monkeypatch: pytest.MonkeyPatch) -> None:
    """What comes out of so small pilots is noise, and must not be in the picture."""
    small_pilots(monkeypatch)
    scene = load("room")
    results = [warpmis.render(scene, method="counts", spp=16, seed=seed) for seed in range(PILOTS)]
    chosen = {tuple(result.allocation[0, 0].round(2).tolist()) for result in results}
    assert len(chosen) >= 2
    found = np.array([block_means(result.image) for result in results])
    reference = estimates("room", PILOTS, spp=32, method="nee")
    assert paired_p_values(found, reference).min() > LEVEL
    assert caught_bias(found, reference, LEVEL) < 0.02
