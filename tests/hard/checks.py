"""What must hold of the picture of every hard case."""

from __future__ import annotations

from typing import Any

import numpy as np
import stats
from hard.case import HardCase

import warpmis
from warpmis.rendering.result import RenderResult
from warpmis.scene import Scene
from warpmis.scene.features import Features

SIGNIFICANCE = 1e-4  # of one test; there are some hundred, with fixed seeds
# Rays start off a surface by 5e-7 of its size, and radiance is float32: a mean of equal samples is off by that much.
ROUNDING = 2e-5


LOADED: dict[str, Scene] = {}


def scene_of(case: HardCase) -> Scene:
    """The case's scene, read once for all methods."""
    if case.name not in LOADED:
        built = case.build()
        LOADED[case.name] = built if isinstance(built, Scene) else warpmis.load_stage(built)
    return LOADED[case.name]


def render(case: HardCase, method: str, features: Features | None = None, **settings: Any) -> RenderResult:
    """The case's picture, after a check that every number in it is finite and none was rejected."""
    asked = {"spp": 64, "method": method, "max_depth": 2, "features": features, **case.settings, **settings}
    result = warpmis.render(scene_of(case), **asked)
    check_finite(result)
    assert result.stats["rejected_samples"] == 0
    return result


def check_finite(result: RenderResult) -> None:
    for name, picture in result.channels().items():
        assert np.isfinite(picture).all(), name
    assert (result.variance >= 0.0).all()
    total = result.allocation.sum(axis=-1)
    assert ((np.abs(total - 1.0) < 1e-5) | (total == 0.0)).all()


def standard_error(result: RenderResult) -> float:
    """Of the mean luminance, from the variance of the pixels' samples."""
    variance = result.variance.astype(np.float64) / np.maximum(result.samples, 1)
    return float(np.sqrt(variance.sum()) / variance.size)


def spread(result: RenderResult) -> float:
    """Standard error of the mean luminance where all pixels see the same point: from their spread, which is less than
    that of random choices, for the choice of strategy is stratified over a pixel's samples."""
    return float(luminance(result.image).std(ddof=1) / np.sqrt(result.variance.size))


def luminance(image: Any) -> Any:
    return image.astype(np.float64) @ np.array([0.2126, 0.7152, 0.0722])


def check_mean(result: RenderResult, expected: tuple[float, float, float], significance: float = SIGNIFICANCE) -> None:
    """A z-test of the mean luminance of a picture of one point; rounding's error counts as one standard error."""
    mean, wanted = float(luminance(result.image).mean()), float(luminance(np.array(expected)))
    error = np.hypot(spread(result), ROUNDING * wanted)
    assert stats.z_test(mean, float(error), wanted) > significance, (mean, wanted, error)


def check_same(a: RenderResult, b: RenderResult, scale: float = 1.0, significance: float = SIGNIFICANCE) -> None:
    """A z-test of the difference of two pictures' means, the second times `scale`."""
    means = [float(luminance(result.image).mean()) for result in (a, b)]
    difference = means[0] - scale * means[1]
    error = np.hypot(standard_error(a), scale * standard_error(b)) + ROUNDING * abs(means[0])
    assert stats.z_test(difference, float(error), 0.0) > significance, (means, error)
