"""The error that a denoised render promises, against references, over 20 seeds.

The promise holds with about 95 % confidence. Of 20 renders 4 or more break it with a probability of 1.6 % if that is so
(binomial, p = 0.05). If it held for 70 % of renders alone, 4 or more of 20 would break it with 89 % probability, and
the test would see it. The error is relMSE as everywhere, without the worst thousandth of the pixels.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scenes
from numpy.typing import NDArray

import warpmis
from warpmis.film.denoise import dot
from warpmis.film.metrics import OUTLIERS, squared_scale

SEEDS = 20
MOST_BROKEN = 3


def relative_mse(image: NDArray[Any], first: NDArray[Any], second: NDArray[Any]) -> float:
    """By two independent references, whose noise has no part in the mean of the product."""
    mean = (first + second) / 2.0
    errors = dot(image - first, image - second) / squared_scale(mean)
    apart = dot(image - mean, image - mean) / squared_scale(mean)
    kept = np.argsort(apart, axis=None)[: apart.size - int(OUTLIERS * apart.size)]
    return float(errors.ravel()[kept].mean())


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cornell_box", "open_terrace"])
def test_the_bound_holds(name: str) -> None:
    pytest.importorskip("pyoidn")
    scene = warpmis.load_stage(scenes.USD_SCENES / name / "scene.usda", width=64)
    pair = [warpmis.render(scene, method="nee", spp=2048, seed=seed).image.astype(float) for seed in (901, 902)]
    broken, gains = 0, []
    for seed in range(SEEDS):
        result = warpmis.render(scene, method="nee", spp=16, seed=seed, denoise=True)
        assert result.denoised is not None
        error = relative_mse(result.denoised, *pair)
        broken += error > result.stats["denoise"]["relative_error_bound"] ** 2
        gains.append(relative_mse(result.image, *pair) / error)
    assert broken <= MOST_BROKEN
    assert min(gains) > 1.0, "never worse than the noisy picture"
