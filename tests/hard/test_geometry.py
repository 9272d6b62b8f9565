"""Hard geometry: finite, of the right radiance, and the same picture wherever and however large the scene is."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from hard.checks import check_finite, check_mean, check_same, render
from hard.geometry_cases import GEOMETRY_CASES
from hard.room import room

import warpmis
from warpmis.rendering.result import RenderResult

CASES = {case.name: case for case in GEOMETRY_CASES}


@pytest.mark.parametrize("method", ["nee", "balance", "murray20"])
@pytest.mark.parametrize("name", CASES)
def test_hard_geometry(name: str, method: str) -> None:
    case = CASES[name]
    result = render(case, method)
    assert case.mean is not None
    check_mean(result, case.mean)
    assert any("left out" in line for line in result.warnings) == ("refused" in case.remedy), result.warnings


@cache
def seen(method: str, **changes: Any) -> RenderResult:
    result = warpmis.render(room(**changes), method=method, spp=128, max_depth=3)
    check_finite(result)
    assert result.stats["rejected_samples"] == 0
    return result


EXACT: dict[str, dict[str, Any]] = {
    "scaled by 2^20": {"size": 2.0**20},
    "scaled by 2^-20": {"size": 2.0**-20},
    "moved by 1e6": {"at": (1e6, -3e6, 2e6)},
    "faces in another order": {"faces_reversed": True},
}


@pytest.mark.parametrize("method", ["nee", "balance", "guided"])
@pytest.mark.parametrize("change", EXACT)
def test_the_same_bits(change: str, method: str) -> None:
    """No length is compared with one that is not the scene's, and none is rounded before it is near the origin."""
    plain, changed = seen(method), seen(method, **EXACT[change])
    np.testing.assert_array_equal(plain.image, changed.image)
    np.testing.assert_array_equal(plain.allocation, changed.allocation)


@pytest.mark.parametrize("size", [1e-6, 1e6])
def test_the_same_picture_at_any_size(size: float) -> None:
    """A factor that is no power of two rounds differently, no more."""
    difference = np.abs(seen("nee").image - seen("nee", size=size).image)
    assert np.median(difference) < 1e-5 * seen("nee").image.mean()


@pytest.mark.parametrize("change", [{"mirror": -1.0}, {"order": (3, 1, 0, 2)}])
def test_the_same_within_noise(change: dict[str, Any]) -> None:
    """A mirrored room, and lamps in another order, draw other samples."""
    check_same(seen("nee"), seen("nee", **change))
