"""Estimates of one picture by many seeds, and paired t-tests between two ways to estimate it.

Ways share their camera rays where the seed is the same, so the differences are free of the noise of lamps in view.
Blocks of the picture are tested besides its mean, so that biases of opposite signs cannot cancel.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import scenes
from numpy.typing import NDArray
from scipy import stats
from stats import POWER

import warpmis
from warpmis.rendering.render import Uploads

SCENES = ("cornell_box", "ajar_door", "veach_plates", "open_terrace", "hidden_light")
# Where single paths decide, more pictures tell more than more samples do: with them the t-distribution's tails, which
# Sidak's levels lie far out in, get shorter, too.
SEEDS = {name: 16 if name == "open_terrace" else 12 for name in SCENES}
BLOCKS = 3
REGIONS = 1 + BLOCKS**2


@cache
def load(name: str) -> warpmis.Scene:
    if name in ("hidden_light", "room"):
        return getattr(scenes, name)(pixels=24)
    return warpmis.load_stage(scenes.USD_SCENES / name / "scene.usda", width=24)


@cache
def uploads_of(name: str) -> Uploads:
    """The scene's trees, built once for all of its renders."""
    return Uploads()


def block_means(image: NDArray[Any]) -> NDArray[np.float64]:
    """Luminance of the whole picture, then of each of BLOCKS x BLOCKS blocks, shape (REGIONS,)."""
    luminance = image @ np.array([0.2126, 0.7152, 0.0722])
    rows = np.array_split(luminance, BLOCKS, axis=0)
    blocks = [block.mean() for row in rows for block in np.array_split(row, BLOCKS, axis=1)]
    return np.array([luminance.mean(), *blocks])


def estimates(name: str, seeds: int, **settings: Any) -> NDArray[np.float64]:
    """Regions' means of a scene, a row a seed, shape (seeds, REGIONS)."""
    scene, uploads = load(name), uploads_of(name)
    pictures = (warpmis.render(scene, uploads=uploads, seed=seed, **settings).image for seed in range(seeds))
    return np.array([block_means(picture) for picture in pictures])


def paired_p_values(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Two-sided p-value of each region's equal mean, shape (REGIONS,)."""
    difference = a - b
    varies = np.ptp(difference, axis=0) > 0.0
    p = np.where(difference.mean(axis=0) == 0.0, 1.0, 0.0)
    p[varies] = stats.ttest_1samp(difference[:, varies], 0.0, axis=0).pvalue
    return p


def caught_bias(a: NDArray[np.float64], b: NDArray[np.float64], significance: float) -> float:
    """The bias of the picture's mean, relative to it, that the test would find with probability POWER."""
    error = stats.sem(a[:, 0] - b[:, 0])
    mean = 0.5 * (a[:, 0].mean() + b[:, 0].mean())
    return float((stats.t.isf(significance / 2, len(a) - 1) + stats.norm.ppf(POWER)) * error / mean)
