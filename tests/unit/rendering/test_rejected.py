"""Samples that are not finite are left out, counted, and leave no trace in the picture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scenes

import warpmis
from warpmis.scene import RectLight, Scene


def glowing(radiance: float) -> Scene:
    """The room with a panel before its back wall that shines like `radiance` into the lower half of the picture."""
    panel = RectLight(
        "/panel", np.array([0, 0.3, -0.9]), np.array([-1.0, 0, 0]), np.array([0, 0.5, 0]), np.full(3, radiance)
    )
    return replace(scenes.room(), lights=(panel,))


@pytest.mark.parametrize("radiance", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("method", ["nee", "balance", "murray20", "guided"])
def test_bad_samples_are_counted_and_leave_no_trace(radiance: float, method: str) -> None:
    result = warpmis.render(glowing(radiance), method=method, spp=32, max_depth=2)
    assert result.stats["rejected_samples"] > 0.2 * result.stats["samples"]
    for picture in result.channels().values():
        assert np.isfinite(picture).all()


def test_they_are_told_of() -> None:
    """A note, which the command line and the report show, with their number."""
    result = warpmis.render(glowing(np.nan), method="nee", spp=32, max_depth=2)
    rejected = result.stats["rejected_samples"]
    assert result.notes == (
        f"{rejected} of {16 * 16 * 32} samples by method nee were not finite and are left out of the picture",
    )


def test_good_scenes_reject_nothing() -> None:
    result = warpmis.render(glowing(5.0), spp=32)
    assert result.stats["rejected_samples"] == 0
    assert result.notes == ()


@pytest.mark.parametrize("name", ["cornell_box", "ajar_door", "veach_plates", "open_terrace"])
def test_ordinary_scenes_reject_nothing(name: str) -> None:
    result = warpmis.render(scenes.USD_SCENES / name / "scene.usda", width=32, spp=64)
    assert result.stats["rejected_samples"] == 0
