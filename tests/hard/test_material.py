"""Hard materials: finite, no brighter than what shines on them, and the same by every way to sample them."""

from __future__ import annotations

import numpy as np
import pytest
from hard.checks import check_mean, check_same, luminance, render, standard_error
from hard.material_cases import MATERIAL_CASES

CASES = {case.name: case for case in MATERIAL_CASES}


@pytest.mark.parametrize("method", ["nee", "balance", "murray20"])
@pytest.mark.parametrize("name", [name for name, case in CASES.items() if case.mean is not None])
def test_hard_material_of_known_radiance(name: str, method: str) -> None:
    case = CASES[name]
    assert case.mean is not None
    check_mean(render(case, method), case.mean)


@pytest.mark.parametrize("name", [name for name, case in CASES.items() if case.mean is None])
def test_hard_material_creates_no_energy(name: str) -> None:
    """Under a sky of 1 nothing is brighter than 1; the methods agree."""
    case = CASES[name]
    results = {method: render(case, method, spp=256) for method in ("nee", "balance", "murray20")}
    for result in results.values():
        assert luminance(result.image).mean() <= 1.0 + 4.0 * standard_error(result) + 1e-5
        assert luminance(result.image).mean() > 0.0
        check_same(results["nee"], result)
    bsdf = render(case, "bsdf", spp=256)
    check_same(results["nee"], bsdf)
    assert np.isfinite(bsdf.image).all()
