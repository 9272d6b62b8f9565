"""Hard lights: finite, and the closed form's radiance, by every way to sample them."""

from __future__ import annotations

import numpy as np
import pytest
from hard.checks import check_mean, render
from hard.light_cases import LIGHT_CASES
from hard.parts import UP, camera, floor, light, stage

import warpmis

CASES = {case.name: case for case in LIGHT_CASES}


@pytest.mark.parametrize("method", ["nee", "balance", "murray20"])
@pytest.mark.parametrize("name", CASES)
def test_hard_light(name: str, method: str) -> None:
    case = CASES[name]
    result = render(case, method)
    assert case.mean is not None
    check_mean(result, case.mean)
    refused = "refused" in case.remedy
    assert any("left out" in line for line in result.warnings) == refused, result.warnings


def test_light_strategy_of_a_light_that_is_turned_away_loses_no_sample() -> None:
    """A panel shines at a ceiling, and the floor has its light from there alone: towards the panel nothing is drawn, so
    that the shares make no difference."""

    def variance(share: float) -> float:
        scene = stage(
            floor(),
            floor(half=3.0, height=2.0, name="Ceiling", color=0.8),
            light("RectLight", rotate=UP, width=0.5, height=0.5, intensity=9.0),
            camera(),
        )
        allocation = (share, 1.0 - share)
        settings = {"method": "fixed", "allocation": allocation, "spp": 256, "max_depth": 2}
        return float(warpmis.render(scene, **settings).variance.mean(dtype=np.float64))

    assert variance(0.1) == pytest.approx(variance(0.9), rel=0.15)
