"""A render by counts: one sample of each is next-event estimation, others are taken, and all is repeatable."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scenes

import warpmis
from warpmis import ConfigError
from warpmis.learn.schedule import Round
from warpmis.rendering import counted
from warpmis.rendering.tracer import Target


def render(**settings: Any) -> warpmis.RenderResult:
    return warpmis.render(scenes.room(), **{"method": "counts", "spp": 64, **settings})


def give(monkeypatch: pytest.MonkeyPatch, lights: int, paths: int) -> None:
    for name, value in (("PILOT_PART", 1e9), ("PILOT_ROUNDS", 1), ("PILOT_SAMPLES", 2)):
        monkeypatch.setattr(counted, name, value)
    monkeypatch.setattr(counted, "best_counts", lambda *_: (lights, paths))


def with_counts(self: counted.CountsIntegrator, part: Round) -> Target:
    return Target(self.kernel, self.shares, self.film, self.no_moments)


@pytest.mark.parametrize("sampler", ["lattice", pytest.param("independent", marks=pytest.mark.slow)])
def test_one_sample_of_each_is_next_event_estimation(sampler: str, monkeypatch: pytest.MonkeyPatch) -> None:
    give(monkeypatch, 1, 1)
    ours, plain = render(sampler=sampler), render(sampler=sampler, method="nee")
    np.testing.assert_array_equal(ours.image, plain.image)
    assert ours.stats["next_event_pixels"] == 1.0
    # Nor does the kernel that takes more find anything else.
    monkeypatch.setattr(counted.CountsIntegrator, "target_of", with_counts)
    np.testing.assert_allclose(render(sampler=sampler).image, plain.image, rtol=1e-5)


def test_counts_are_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each light sample more takes its shadow rays, and each path its ray, with direct light alone."""
    rays = {}
    for lights, paths in ((1, 1), (2, 1), (3, 1), (1, 2), (1, 3)):
        give(monkeypatch, lights, paths)
        result = render(max_depth=1, spp=64)
        rays[lights, paths] = result.stats["rays"]
        assert result.allocation[0, 0].tolist() == pytest.approx([paths / (lights + paths), lights / (lights + paths)])
    for one, two in (((2, 1), (3, 1)), ((1, 2), (1, 3))):
        assert rays[two] - rays[1, 1] == pytest.approx(2 * (rays[one] - rays[1, 1]), rel=0.02)
        assert 0.5 < (rays[one] - rays[1, 1]) / result.stats["samples"] <= 1.0


def test_same_bits_for_any_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    give(monkeypatch, 2, 2)
    one, three = (render(threads=threads) for threads in (1, 3))
    np.testing.assert_array_equal(one.image, three.image)


def test_a_small_picture_has_no_pilot() -> None:
    result = render(spp=4)
    assert result.stats["seconds"]["learn"] == 0.0
    np.testing.assert_array_equal(result.image, render(spp=4, method="nee").image)


def test_other_strategies_are_refused() -> None:
    with pytest.raises(ConfigError, match="'counts' is for the strategies bsdf,light"):
        render(strategies=("bsdf", "uniform"))
