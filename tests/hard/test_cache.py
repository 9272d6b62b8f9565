"""Hard cases of the spatial cache: guided pictures have the mean of next-event estimation, and stay finite.

Welch's test of the mean of each quarter of the picture, over seeds, Sidak-corrected. What bias would be found: POWER.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hard.parts import UP, bound, box, camera, floor, light, material, mesh, stage
from hard.room import room
from stats import detectable_bias, sidak, welch_test

import warpmis
from warpmis.cache import training
from warpmis.cache.cell_moments import CellMoments, worths
from warpmis.cache.cell_shares import LEAST_PART, CellShares
from warpmis.film.metrics import LUMINANCE
from warpmis.rendering.launches import Launcher

SEEDS = 16
POWER = {"thin wall": 0.1}  # next-event estimation is noisy there
POWER_OF_OTHERS = 0.05
SPP = {"thin wall": 160, "half dark": 256, "mirrors": 128}
SPP_OF_OTHERS = 40
SETTINGS: dict[str, Any] = {"max_depth": 4, "width": 16}
LOOK = camera((0.0, 0.5, 0.9), -20.0, 0.8)


@pytest.fixture(autouse=True)
def small_rounds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures of 256 pixels train for half of their samples."""
    monkeypatch.setattr(training, "FIRST_PATHS", 1024)


def thin_wall() -> Any:
    """A sheet without thickness between a lit half and a dark one, which a gap above it lights."""
    sheet = mesh("Sheet", [(0, -1, 1), (0, -1, -1), (0, 0.7, -1), (0, 0.7, 1)], [(0, 1, 2, 3)], 0.7)
    return stage(
        box(1.0, color=0.7), sheet, light("SphereLight", at=(0.6, -0.2, 0.0), radius=0.1, intensity=10.0), LOOK
    )


def mirrors() -> Any:
    """Nothing scatters: no vertex is ever recorded."""
    metal = material(diffuseColor=0.9, metallic=1.0, roughness=0.0)
    lamp = light("SphereLight", at=(0.2, 0.3, -0.4), radius=0.2, intensity=2.0)
    return stage(box(1.0, color=None, more=bound()), metal, lamp, LOOK)


def half_dark() -> Any:
    """A floor under a sheet: what lies below is black for good."""
    below = floor(1.0, -0.5, "Below", 0.5)
    lamp = light("DiskLight", at=(0.0, 0.1, 0.0), rotate=UP, radius=0.2, intensity=5.0)
    return stage(floor(1.0), below, floor(1.0, 1.0, "Ceiling", 0.8), lamp, LOOK)


CASES: dict[str, Callable[[], Any]] = {
    "room": room,
    "scaled by 1e-6": lambda: room(size=1e-6),
    "scaled by 1e6": lambda: room(size=1e6),
    "moved by 1e6": lambda: room(size=100.0, at=(1e6, -1e6, 1e6)),
    "thin wall": thin_wall,
    "mirrors": mirrors,
    "half dark": half_dark,
}


def quarters(image: np.ndarray) -> np.ndarray:
    """Mean luminance of each quarter of the picture, shape (4,)."""
    luminance = image @ LUMINANCE
    half = luminance.shape[0] // 2
    return luminance.reshape(2, half, 2, half).mean(axis=(1, 3)).ravel()


GUIDED: dict[str, dict[str, Any]] = {
    "guided": {"method": "guided"},
    "cells": {"method": "cells", "strategies": ("bsdf", "light", "guide")},
}


@pytest.mark.parametrize("name", CASES)
def test_guided_pictures_have_the_right_mean(name: str) -> None:
    scene, spp = warpmis.load_stage(CASES[name]()), SPP.get(name, SPP_OF_OTHERS)
    found: dict[str, np.ndarray] = {}
    for label, how in {"nee": {"method": "nee"}, **GUIDED}.items():
        results = [warpmis.render(scene, spp=spp, seed=seed, **how, **SETTINGS) for seed in range(SEEDS)]
        assert all(np.isfinite(result.image).all() and result.image.min() >= 0.0 for result in results)
        assert all(result.stats["rejected_samples"] == 0 for result in results)
        found[label] = np.array([quarters(result.image) for result in results])
    level = sidak(0.01, 4 * len(CASES) * len(GUIDED))
    pairs = ((ours, theirs) for label in GUIDED for ours, theirs in zip(found[label].T, found["nee"].T, strict=True))
    for ours, theirs in pairs:
        if np.ptp(theirs) == 0.0:
            np.testing.assert_allclose(ours, theirs, rtol=1e-5)
            continue
        assert welch_test(ours, theirs) > level
        error = np.hypot(ours.std(ddof=1), theirs.std(ddof=1)) / np.sqrt(SEEDS) / theirs.mean()
        assert detectable_bias(float(error), level) < POWER.get(name, POWER_OF_OTHERS)


def test_one_sample_that_carries_all() -> None:
    """Shares keep their bounds, and worths stay finite, whatever a single record says."""
    ones = np.ones(3)
    huge = np.array([1.0, 1e30, 1e38])
    sharing = CellShares(("bsdf", "light", "guide"), "cpu")
    sharing.inherit(np.zeros(3, np.int64), ones)
    ratios = np.array([[2.0, 0.5, 0.5], [0.0, 3.0, 0.0], [1e-30, 0.0, 3.0]])
    sharing.learn(np.arange(3), huge, ratios, Launcher("cpu", 1).run_over)
    assert (sharing.shares >= LEAST_PART / 3 - 1e-6).all()
    np.testing.assert_allclose(sharing.shares.sum(axis=1), 1.0, atol=1e-6)
    moments = CellMoments(count=100.0 * ones, tail=huge, light=huge, cost=ones)
    assert all(np.isfinite(worth).all() for worth in worths(moments))
