"""Every method estimates the same picture: paired t-tests over independent seeds, Sidak-corrected.

Methods share their camera rays where the seed is the same, so the differences are free of the noise of lamps in view.

Blocks of the picture are tested besides its mean, so that biases of opposite signs cannot cancel. The power that the
test must have is asserted too: a bias of the given size of the mean would be caught in 99 of 100 runs.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
import scenes
from scipy import stats

import warpmis

SEEDS = 12
BLOCKS = 3
METHODS = {
    "bsdf": {"method": "bsdf"},
    "balance": {"method": "balance"},
    "nee": {"method": "nee"},
    "murray20": {"method": "murray20", "learn_rounds": 2, "learn_spp": 64},
    "fixed 0.2": {"method": "fixed", "allocation": (0.2, 0.8)},
    "fixed 0.8": {"method": "fixed", "allocation": (0.8, 0.2)},
}
# Bias of the picture's mean that is caught with a probability of 99 %: between any two methods of which none is BSDF
# sampling alone, and between that and the others. BSDF sampling finds a small lamp by chance alone, hence the second.
POWER = {
    "cornell_box": (0.02, 0.02),
    "ajar_door": (0.15, 0.15),
    "veach_plates": (0.06, 0.1),
    "open_terrace": (0.15, 0.4),
    "hidden_light": (0.05, 0.05),
}
SIGNIFICANCE = 0.01


def load(name: str) -> warpmis.Scene:
    if name == "hidden_light":
        return scenes.hidden_light(pixels=24)
    return warpmis.load_stage(scenes.USD_SCENES / name / "scene.usda", width=24)


def block_means(image: np.ndarray) -> np.ndarray:
    """Luminance of the whole picture, then of each of BLOCKS x BLOCKS blocks."""
    luminance = image @ np.array([0.2126, 0.7152, 0.0722])
    rows = np.array_split(luminance, BLOCKS, axis=0)
    blocks = [block.mean() for row in rows for block in np.array_split(row, BLOCKS, axis=1)]
    return np.array([luminance.mean(), *blocks])


@pytest.mark.parametrize("name", POWER)
def test_methods_agree(name: str) -> None:
    scene = load(name)
    estimates = {
        label: np.array(
            [block_means(warpmis.render(scene, spp=256, seed=seed, **settings).image) for seed in range(SEEDS)]
        )
        for label, settings in METHODS.items()
    }
    pairs = list(combinations(METHODS, 2))
    tests = len(POWER) * len(pairs) * (1 + BLOCKS**2)
    level = 1.0 - (1.0 - SIGNIFICANCE) ** (1.0 / tests)
    disagreements = []
    caught: dict[bool, list[float]] = {False: [], True: []}
    for a, b in pairs:
        difference = estimates[a] - estimates[b]
        varies = np.ptp(difference, axis=0) > 0.0
        p = np.where(difference.mean(axis=0) == 0.0, 1.0, 0.0)
        p[varies] = stats.ttest_1samp(difference[:, varies], 0.0, axis=0).pvalue
        disagreements += [f"{a} and {b}, region {i}: p = {p[i]:.2g}" for i in np.flatnonzero(p < level)]
        error = stats.sem(difference[:, 0])
        caught["bsdf" in (a, b)].append((stats.t.isf(level / 2, SEEDS - 1) + stats.norm.isf(0.01)) * error)
    mean = np.mean([values[:, 0].mean() for values in estimates.values()])
    assert not disagreements, f"{name}: {disagreements}"
    smallest = tuple(max(caught[with_bsdf]) / mean for with_bsdf in (False, True))
    print(f"{name}: a bias of {smallest[0]:.2%} would be caught, of BSDF sampling alone {smallest[1]:.2%}")
    assert smallest[0] < POWER[name][0] and smallest[1] < POWER[name][1], f"{name}: too weak a test"
