"""A render by the spatial cache: what is decided when, what is kept, and that it is repeatable."""

from __future__ import annotations

import dataclasses
import itertools
import time
from typing import Any

import numpy as np
import pytest
import scenes

import warpmis
from warpmis import Interrupted, Progress
from warpmis.cache import gate, training
from warpmis.cache.training import training_rounds
from warpmis.rendering import guided


@pytest.fixture(autouse=True)
def small_rounds(monkeypatch: pytest.MonkeyPatch) -> None:
    """A trial of rounds of 8 samples per pixel in 16 x 16 pixels."""
    monkeypatch.setattr(training, "FIRST_PATHS", 1024)
    monkeypatch.setattr(gate, "PILOT_SHARE", 1.0)
    monkeypatch.setattr(guided, "FEWEST_SAMPLES", 0)


def render(**settings: Any) -> warpmis.RenderResult:
    return warpmis.render(scenes.room(), **{"method": "guided", "spp": 64, **settings})


def described(pixels: int, spp: int) -> list[tuple[int, int, bool]]:
    return [(one.stride, one.samples, one.is_kept) for one in training_rounds(pixels, spp)]


def test_rounds_double_up_to_half_of_the_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    trial, rare_trial = [(2, 8, False)] * 2, [(3, 8, False)] * 2
    rounds = [(1, 1, False), *trial, (1, 2, False), (1, 4, False), *trial, (1, 8, True), (1, 16, True)]
    assert described(9216, 256) == [*rounds, *trial, (1, 32, True)]
    assert described(9216, 64) == [rounds[0], *rare_trial, *rounds[3:5], *rare_trial, rounds[7]]
    assert described(576, 256)[0] == (1, 16, False), "it has no guide at all"
    assert described(256, 16) == []


def test_large_pictures_train_on_some_pixels(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    pixels = 1920 * 1080
    rounds = training_rounds(pixels, 64)
    assert rounds[0].stride == 16 and rounds[0].samples == 1
    assert [one.half for one in rounds[:4]] == [None, 0, 1, None]
    paths = [one.paths(pixels) for one in rounds]
    assert sum(paths) <= training.MOST_PATHS
    assert all(one.half is not None or one.paths(pixels) >= paths[0] for one in rounds)


def test_same_bits_for_any_threads() -> None:
    one, two, three = (render(threads=threads) for threads in (1, 2, 3))
    np.testing.assert_array_equal(one.image, two.image)
    np.testing.assert_array_equal(one.image, three.image)
    assert one.stats["next_event_pixels"] == 0.0


def test_seeds_differ() -> None:
    assert not np.array_equal(render(seed=1).image, render(seed=2).image)


@pytest.mark.parametrize("unless", ["quiet", "no gain", "few samples"])
def test_picture_that_does_not_gain_is_that_of_next_event_estimation(
    unless: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Bit for bit: by what the pilot finds, or the trial, or without either. A trial's samples stay in the picture."""
    seen: set[str] = set()
    if unless == "quiet":
        monkeypatch.setattr(gate, "QUIET", 1e30)
    elif unless == "no gain":
        monkeypatch.setattr(gate, "LEAST_GAIN", 1e30)
        monkeypatch.setattr(training, "KEPT_SAMPLES", 1 << 20)
    else:
        monkeypatch.setattr(guided, "FEWEST_SAMPLES", 1 << 40)
    result = render(method="auto", progress=lambda report: seen.add(report.detail))
    assert result.stats["next_event_pixels"] == 1.0 and (result.next_event == 1.0).all()
    assert ("pilot" in seen, any("round" in one for one in seen)) == {
        "quiet": (True, False), "no gain": (True, True), "few samples": (False, False)
    }[unless]  # fmt: skip
    spp = int(result.samples[0, 0])
    plain = warpmis.render(scenes.room(), method="nee", spp=64)
    assert spp == 64 or unless == "no gain"
    if unless != "no gain":
        np.testing.assert_array_equal(result.image, plain.image)


def test_a_picture_that_gains_is_the_guided_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """With the same bits: the pilot's samples are not in it."""
    monkeypatch.setattr(gate, "QUIET", 0.0)
    monkeypatch.setattr(gate, "LEAST_GAIN", 0.0)
    result = render(method="auto")
    assert result.stats["next_event_pixels"] == 0.0
    np.testing.assert_array_equal(result.image, render().image)


@pytest.mark.parametrize(("quiet", "strides"), [(1e30, [2]), (0.0, [2, 1])])
def test_a_noisy_picture_has_a_second_pilot_in_more_pixels(
    monkeypatch: pytest.MonkeyPatch, quiet: float, strides: list[int]
) -> None:
    monkeypatch.setattr(gate, "QUIET", quiet)
    monkeypatch.setattr(gate, "QUIET_PIXELS", 64)
    made: list[int] = []
    rounds = guided.pilot_rounds
    monkeypatch.setattr(guided, "pilot_rounds", lambda stride: (made.append(stride), rounds(stride))[1])
    render(method="auto")
    assert sorted(set(made), reverse=True) == strides


def test_small_rounds_are_left_out() -> None:
    """Of 64 samples a pixel of 16 x 16: the first 4; the trial's 8 and 8, and 8 more are kept."""
    assert described(256, 64) == [(1, 4, False), (1, 8, True), (1, 8, True), (1, 8, True)]
    assert (render().samples == 60).all()


@pytest.mark.parametrize("size", [(1, 1), (7, 5), (2, 3), (16, 9)])
@pytest.mark.parametrize("spp", [1, 3, 48])
def test_every_pixel_takes_as_many_samples(size: tuple[int, int], spp: int) -> None:
    reports: list[warpmis.Progress] = []
    scene = dataclasses.replace(scenes.room(), resolution=size)
    result = warpmis.render(scene, spp=spp, progress=reports.append)
    assert (result.samples == result.samples[0, 0]).all() and 0.5 * spp <= result.samples[0, 0] <= spp
    assert np.isfinite(result.image).all()
    assert result.image.min() >= 0.0 and result.image.any()
    assert max(report.done for report in reports) <= reports[-1].total


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
        if report.detail == "round 4/4":
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
    result = render(spp=None, time_limit=400.0, threads=1, progress=lambda report: seen.append(report.detail))
    assert result.stats["stopping"]["reason"] == "time limit"
    assert 0.0 < result.stats["seconds"]["learn"] < 300.0 and result.stats["seconds"]["render"] > 0.0
    assert result.samples.min() >= 1
    assert "round 1/6" in seen and "round 6/6" not in seen


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
