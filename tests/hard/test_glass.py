"""Hard glass: finite, right, and the same by every way to sample the rest of the scene."""

from __future__ import annotations

import pytest
from hard.checks import check_mean, check_same, luminance, render
from hard.glass_cases import GLASS_CASES

CASES = {case.name: case for case in GLASS_CASES}


@pytest.mark.parametrize("method", ["nee", "balance", "guided"])
@pytest.mark.parametrize("name", [name for name, case in CASES.items() if case.mean is not None])
def test_hard_glass_of_known_radiance(name: str, method: str) -> None:
    case = CASES[name]
    assert case.mean is not None
    result = render(case, method)
    check_mean(result, case.mean)
    assert result.stats["rejected_samples"] == 0


def test_a_lamp_shut_in_glass_is_seen_alike() -> None:
    results = [render(CASES["lamp-in-a-closed-glass-box"], method) for method in ("nee", "balance", "guided")]
    for result in results:
        assert result.stats["rejected_samples"] == 0
        assert luminance(result.image).mean() > 0.0
        check_same(results[0], result)
