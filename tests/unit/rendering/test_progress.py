"""What a progress function is told: never less than before, and in the end that all is done."""

from __future__ import annotations

import itertools
from typing import Any

import pytest
import scenes
from pxr import Usd

import warpmis

# The sky is a little brighter at each time; the shutter is open for two.
SKY = """#usda 1.0
def DomeLight "Sky" {
    float inputs:intensity.timeSamples = { 0: 1, 100: 101 }
}
def Camera "Camera" {
    double shutter:open = 0
    double shutter:close = 2
}
"""


def reports_of(stage: Any, **settings: Any) -> list[warpmis.Progress]:
    reports: list[warpmis.Progress] = []
    warpmis.render(stage, progress=reports.append, **settings)
    return reports


def sky() -> Usd.Stage:
    stage = Usd.Stage.CreateInMemory()
    assert stage.GetRootLayer().ImportFromString(SKY)
    return stage


def test_phases_come_in_order_and_the_total_is_reached() -> None:
    reports = reports_of(scenes.room(), method="murray20", spp=48, learn_rounds=2)
    assert list(dict.fromkeys(report.phase for report in reports)) == ["load", "compile", "learn", "render"]
    assert all(a.done <= b.done for a, b in itertools.pairwise(reports))
    assert reports[-1].done == reports[-1].total == 16 * 16 * 48


@pytest.mark.parametrize("limits", [{"spp": 7}, {"target_error": 0.1}, {"time_limit": 0.05}])
def test_the_last_report_is_that_all_is_done(limits: dict[str, Any]) -> None:
    last = reports_of(scenes.room(), method="nee", **limits)[-1]
    assert (last.phase, last.detail) == ("render", "")
    assert last.done == last.total > 0


@pytest.mark.parametrize("limits", [{"spp": 7}, {"time_limit": 0.1}])
def test_times_within_the_shutter_count_as_one_render(limits: dict[str, Any]) -> None:
    """7 samples over 2 times are 3 and 4: the total is known from the first one on."""
    reports = reports_of(sky(), method="nee", width=8, shutter_samples=2, **limits)
    assert all(a.done <= b.done for a, b in itertools.pairwise(reports))
    assert {report.detail for report in reports if report.phase == "load"} >= {"time 0.5", "time 1.5"}
    last = reports[-1]
    assert last.done == last.total > 0
    if "spp" in limits:
        assert {report.total for report in reports if report.total} == {last.done}


def test_the_last_report_may_interrupt() -> None:
    """Nothing of the picture is lost."""

    def progress(report: warpmis.Progress) -> None:
        if report.done and report.done == report.total:
            raise KeyboardInterrupt

    with pytest.raises(warpmis.Interrupted) as stop:
        warpmis.render(scenes.room(), method="nee", spp=4, threads=1, progress=progress)
    assert (stop.value.result.samples == 4).all()
