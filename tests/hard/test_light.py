"""Hard lights: finite, and the closed form's radiance, by every way to sample them."""

from __future__ import annotations

import pytest
from hard.checks import check_mean, render
from hard.light_cases import LIGHT_CASES

from warpmis.features import Features

# One kernel a method for all cases.
LIGHTS = Features(
    rect_light=True,
    disk_light=True,
    sphere_light=True,
    cylinder_light=True,
    distant_light=True,
    dome_picture=True,
    delta_light=True,
)
CASES = {case.name: case for case in LIGHT_CASES}


@pytest.mark.parametrize("method", ["nee", "balance", "murray20", "auto"])
@pytest.mark.parametrize("name", CASES)
def test_hard_light(name: str, method: str) -> None:
    case = CASES[name]
    result = render(case, method, LIGHTS)
    assert case.mean is not None
    check_mean(result, case.mean)
    refused = "refused" in case.remedy
    assert any("left out" in line for line in result.warnings) == refused, result.warnings
