"""Renders that stop by themselves: the same picture whatever the threads, and the beginning of a longer one."""

from __future__ import annotations

import itertools
import time

import numpy as np
import pytest
import scenes

import warpmis
from warpmis.errors import ConfigError
from warpmis.rendering.progress import Progress

SCENE = scenes.room(pixels=24)


def render(**settings: object) -> warpmis.RenderResult:
    return warpmis.render(SCENE, **settings)


# Those by the other sampler take kernels of their own, four seconds each.
LONG = [(method, "independent") for method in ("pooled", "variance_aware", "optimal")]
QUICK = [
    *((method, "lattice") for method in ("guided", "pooled", "nee", "variance_aware", "optimal")),
    *((method, "independent") for method in ("guided", "nee")),
]


@pytest.mark.parametrize(("method", "sampler"), [*QUICK, *(pytest.param(*one, marks=pytest.mark.slow) for one in LONG)])
def test_every_pixel_has_as_many_samples(method: str, sampler: str) -> None:
    stopped = render(method=method, seed=3, sampler=sampler, target_error=0.2)
    assert (stopped.samples == stopped.stats["stopping"]["spp"]).all()


@pytest.mark.parametrize("method", ["murray20", "nee"])
def test_the_picture_is_that_of_as_many_samples(method: str) -> None:
    """Piece by piece the samples are those of a plain render, where none are spread evenly: each piece would be by
    itself."""
    limits = {"target_error": 0.1} if method == "nee" else {"target_error": 1e-4, "spp": 100}
    independent = {"sampler": "independent", "strategy_choice": "random"}
    stopped = render(method=method, seed=3, **limits, **independent)
    told = stopped.stats["stopping"]
    assert (stopped.samples == told["spp"]).all()
    plain = render(method=method, spp=told["spp"], seed=3, **independent)
    for name, picture in plain.channels().items():
        np.testing.assert_allclose(stopped.channels()[name], picture, rtol=1e-5, atol=1e-6, err_msg=name)
    bounds = [result.stats.get("excess_variance_bound", 0.0) for result in (stopped, plain)]
    assert bounds[0] == pytest.approx(bounds[1], rel=1e-4)


@pytest.mark.parametrize("method", ["nee", "guided"])
def test_any_number_of_threads_stops_at_the_same_sample(method: str) -> None:
    one, two = (render(method=method, target_error=0.1, threads=threads) for threads in (1, 2))
    assert one.stats["stopping"] == two.stats["stopping"]
    np.testing.assert_array_equal(one.image, two.image)


def test_a_time_limit_ends_a_render_with_a_whole_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    """By a clock that ticks a second whenever it is read."""
    ticks = itertools.count()
    monkeypatch.setattr(time, "perf_counter", lambda: float(next(ticks)))
    result = render(time_limit=300.0, threads=1)
    told = result.stats["stopping"]
    assert told["reason"] == "time limit"
    assert np.ptp(result.samples) == 0 and result.samples[0, 0] == told["spp"] < result.settings["spp"]


def test_the_result_tells_its_error_and_progress_how_long_it_takes() -> None:
    seen: list[Progress] = []
    result = render(target_error=0.1, progress=seen.append)
    told = result.stats["stopping"]
    assert result.relative_error() == told["relative_error"] < told["bound"] <= 0.1
    assert told["reason"] == "target error"
    assert repr(result).endswith(f"auto, {told['spp']} spp)")
    watched = [report for report in seen if report.relative_error is not None]
    assert watched and all(report.total <= result.stats["samples"] * 4 for report in watched)


def test_an_interrupt_is_the_reason() -> None:
    def progress(report: Progress) -> None:
        if report.done:
            raise KeyboardInterrupt

    with pytest.raises(warpmis.Interrupted) as stop:
        render(time_limit=300.0, threads=1, progress=progress)
    assert stop.value.result.stats["stopping"]["reason"] == "interrupted"


def test_a_target_is_for_one_time_within_the_shutter() -> None:
    with pytest.raises(ConfigError, match="drop the shutter samples"):
        warpmis.render("any.usda", target_error=0.1, shutter_samples=2)
