"""The prototype of scripts/bench/complex_paths.py, whose chains render what is rare and bright, is unbiased.

Welch's t-tests over seeds against next-event estimation, Sidak-corrected; the power is asserted too.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from programs import SCRIPTS, program
from scenes import room
from scipy import stats
from statistical.estimates import REGIONS, block_means
from stats import POWER, sidak

import warpmis

SCENES = {"room": 0.03, "glass_block": 0.06}
LEVEL = sidak(0.01, len(SCENES) * REGIONS)
SEEDS = 32


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The program, which has chains whatever they promise, for about half of the light."""
    monkeypatch.syspath_prepend(SCRIPTS / "bench")
    module = program("bench/complex_paths.py")
    monkeypatch.setattr(module, "WORTH_IT", 1e-9)
    monkeypatch.setattr(module, "FACTORS", (0.5,))
    return module


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_the_mean_is_that_of_next_event_estimation(name: str, bench: Any, tmp_path: Path) -> None:
    scene = room(24) if name == "room" else warpmis.load_stage(str(bench.glass_block(tmp_path)), width=24)
    prototype = bench.Prototype(scene)
    pictures = [prototype.render(256, seed) for seed in range(SEEDS)]
    assert min(picture.share for picture in pictures) > 0.0
    assert np.mean([picture.complex for picture in pictures]) > 0.01
    # A chain begins with the path that was drawn.
    assert np.median([picture.replay for picture in pictures]) < 1e-4
    found = np.array([block_means(picture.image) for picture in pictures])
    settings = {"method": "nee", "spp": 512, "max_depth": bench.MAX_DEPTH}
    plain = np.array([block_means(warpmis.render(scene, seed=seed, **settings).image) for seed in range(SEEDS)])
    assert stats.ttest_ind(found, plain, equal_var=False).pvalue.min() > LEVEL
    error = np.hypot(stats.sem(found[:, 0]), stats.sem(plain[:, 0])) / plain[:, 0].mean()
    assert (stats.t.isf(LEVEL / 2, SEEDS - 1) + stats.norm.ppf(POWER)) * error < SCENES[name]
