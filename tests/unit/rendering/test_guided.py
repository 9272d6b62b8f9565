"""A render by the spatial cache: what is decided when, what is kept, and that it is repeatable."""

from __future__ import annotations

import dataclasses
import itertools
import time
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import scenes

import warpmis
from warpmis import Interrupted, Progress
from warpmis.cache import training
from warpmis.cache.training import Training, training_rounds
from warpmis.rendering import guided


@pytest.fixture(autouse=True)
def small_rounds(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(training, "FIRST_PATHS", 1024)
    monkeypatch.setattr(guided, "THRESHOLD", 0.0)


def render(**settings: Any) -> warpmis.RenderResult:
    return warpmis.render(scenes.room(), **{"method": "guided", "spp": 64, **settings})


def test_rounds_double_up_to_half_of_the_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    assert training_rounds(9216, 256) == [Training(1, n, n >= 8) for n in (1, 2, 4, 8, 16, 32)]
    assert training_rounds(9216, 64) == [Training(1, n, n >= 8) for n in (1, 2, 4, 8, 16)]
    assert training_rounds(576, 256)[0] == Training(1, 16, False), "it has no guide at all"
    assert training_rounds(256, 16) == []


def test_large_pictures_train_on_some_pixels(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    rounds = training_rounds(1920 * 1080, 64)
    assert rounds[0].stride == 16 and rounds[0].samples == 1
    paths = [1920 * 1080 / one.stride**2 * one.samples for one in rounds]
    assert sum(paths) < 1.5 * training.MOST_PATHS
    assert all(b > a for a, b in pairwise(paths))


def test_same_bits_for_any_threads() -> None:
    one, two, three = (render(threads=threads) for threads in (1, 2, 3))
    np.testing.assert_array_equal(one.image, two.image)
    np.testing.assert_array_equal(one.image, three.image)
    assert one.stats["next_event_pixels"] == 0.0


def test_seeds_differ() -> None:
    assert not np.array_equal(render(seed=1).image, render(seed=2).image)


def test_picture_that_does_not_gain_is_that_of_next_event_estimation(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guided, "THRESHOLD", 1e30)
    result = render()
    assert result.stats["next_event_pixels"] == 1.0
    np.testing.assert_array_equal(result.image, warpmis.render(scenes.room(), method="nee", spp=64).image)


def test_small_rounds_are_left_out() -> None:
    """Of 64 samples a pixel of 16 x 16: rounds of 4 (left out), 8 and 16, then the rest."""
    result = render()
    assert (result.samples == 60).all()


def test_guided_room_is_less_noisy() -> None:
    """A closed room, most of whose light is indirect, at equal samples; the mean over pixels of the squared error."""
    reference = warpmis.render(scenes.room(), method="nee", spp=8192, seed=99).image
    errors = {
        method: np.mean([(render(method=method, seed=seed, spp=256).image - reference) ** 2 for seed in range(4)])
        for method in ("nee", "guided")
    }
    assert errors["guided"] < 0.6 * errors["nee"]


@pytest.mark.parametrize("max_depth", [0, 1, 2])
def test_short_paths(max_depth: int) -> None:
    short, reference = (
        render(max_depth=max_depth, method=method, spp=spp).image for method, spp in (("guided", 256), ("nee", 1024))
    )
    assert np.isfinite(short).all()
    assert short.mean() == pytest.approx(reference.mean(), rel=0.03)


def test_interrupt_while_training_leaves_a_whole_picture() -> None:
    def stop(report: Progress) -> None:
        if report.detail == "round 3/3":
            raise KeyboardInterrupt

    with pytest.raises(Interrupted) as caught:
        render(progress=stop)
    assert caught.value.result.samples.min() >= 4
    assert np.isfinite(caught.value.result.image).all() and caught.value.result.image.min() >= 0.0


def test_training_takes_no_more_than_its_part_of_a_time_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    """By a clock that ticks a second whenever it is read: the picture still has samples in every pixel."""
    ticks = itertools.count()
    monkeypatch.setattr(time, "perf_counter", lambda: float(next(ticks)))
    seen: list[str] = []
    result = render(spp=None, time_limit=40.0, threads=1, progress=lambda report: seen.append(report.detail))
    assert result.stats["stopping"]["reason"] == "time limit"
    assert 0.0 < result.stats["seconds"]["learn"] < 30.0 and result.stats["seconds"]["render"] > 0.0
    assert result.samples.min() >= 1
    assert "round 7/7" not in seen


def test_black_scene_stays_black() -> None:
    dark = dataclasses.replace(scenes.room(), lights=())
    result = warpmis.render(dark, method="guided", spp=32)
    assert not result.image.any() and result.stats["rejected_samples"] == 0


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_brightness_does_not_matter(scale: float) -> None:
    room = scenes.room()
    lamps = tuple(dataclasses.replace(light, radiance=light.radiance * scale) for light in room.lights)
    scaled = warpmis.render(dataclasses.replace(room, lights=lamps), method="guided", spp=64).image / scale
    assert scaled.mean() == pytest.approx(render().image.mean(), rel=0.02)
