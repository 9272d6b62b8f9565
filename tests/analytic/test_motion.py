"""Motion blur: means over the shutter's interval that are known."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Usd

import warpmis
from warpmis.errors import ConfigError

# The sky is as bright as the time code; the strip, 1 unit wide, moves by 1 unit a time code.
STAGE = """#usda 1.0
(
    startTimeCode = 5
    upAxis = "Y"
)
def DomeLight "Sky" {
    float inputs:intensity.timeSamples = { -100: %s, 100: 100 }
}
def Mesh "Strip" {
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-9, -9, -3), (-8, -9, -3), (-8, 9, -3), (-9, 9, -3)]
    color3f[] primvars:displayColor = [(0, 0, 0)]
    double3 xformOp:translate.timeSamples = { -100: (-100, 0, 0), 100: (100, 0, 0) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Camera "Camera" {
    token projection = "orthographic"
    float horizontalAperture = 80
    float verticalAperture = 80
    %s
}
"""


def render(shutter: str, brightness_at_minus_100: int = -100, **settings) -> warpmis.RenderResult:
    stage = Usd.Stage.CreateInMemory()
    assert stage.GetRootLayer().ImportFromString(STAGE % (brightness_at_minus_100, shutter))
    return warpmis.render(stage, width=8, method="nee", max_depth=0, **settings)


OPEN = "double shutter:open = 0\ndouble shutter:close = 2"


def test_brightness_is_the_mean_over_the_shutter() -> None:
    """From 5 to 7 in the mean 6, at whatever number of times, since it grows linearly."""
    for count in (2, 3):
        result = render(OPEN, shutter_samples=count, spp=6)
        np.testing.assert_allclose(result.image[:, 6], 6.0, rtol=1e-6)
        assert (result.samples == 6).all()
        assert result.stats["samples"] == 6 * 64
    assert render(OPEN, shutter_samples=1, spp=6).image[0, 6, 0] == pytest.approx(5.0)


def test_a_moving_strip_covers_each_pixel_for_its_share_of_the_time() -> None:
    """From -4..-3 to -2..-1 in 4 steps, at 0.25, 0.75, ...: shares of the columns -4 to -1, under a constant sky."""
    result = render(OPEN, 100, shutter_samples=4, spp=2048)
    expected = np.zeros(8)
    for moved in (0.25, 0.75, 1.25, 1.75):
        column = int(moved)
        expected[column] += (1 - moved % 1) / 4
        expected[column + 1] += (moved % 1) / 4
    assert expected[:3] == pytest.approx([0.25, 0.5, 0.25])
    np.testing.assert_allclose(result.alpha.mean(axis=0), expected, atol=0.02)  # standard error below 0.004
    np.testing.assert_allclose(result.image[..., 0].mean(axis=0), 100 * (1 - expected), atol=2.0)
    np.testing.assert_allclose(result.depth[:, :3], 3.0, rtol=1e-5)


def test_shut_or_unasked_shutters() -> None:
    note = "one shutter sample gives no motion blur"
    assert any(note in line for line in render(OPEN, spp=2).notes)
    shut = render("", shutter_samples=4, spp=2)
    assert not any(note in line for line in shut.notes)
    assert shut.image[0, 6, 0] == pytest.approx(5.0)
    backwards = render("double shutter:open = 1\ndouble shutter:close = -1", shutter_samples=4, spp=2)
    assert any("/Camera" in line and "shutter:open" in line for line in backwards.warnings)
    with pytest.raises(ConfigError, match="4 times within the shutter"):
        render(OPEN, shutter_samples=4, spp=3)
    for wrong in (0, 1.5):
        with pytest.raises(ConfigError, match="shutter samples must be"):
            render(OPEN, shutter_samples=wrong, spp=3)


def test_an_interrupt_keeps_the_times_that_are_done() -> None:
    """The first of two times, at 5.5, is done when the second is about to be read."""

    def progress(report: warpmis.Progress) -> None:
        if report.phase == "load" and report.detail == "time 6.5":
            raise KeyboardInterrupt

    with pytest.raises(warpmis.Interrupted) as stop:
        render(OPEN, shutter_samples=2, spp=4, progress=progress)
    np.testing.assert_allclose(stop.value.result.image[:, 6], 5.5, rtol=1e-6)
    assert "1 of 2 times" in stop.value.result.notes[-1]


def test_depth_is_that_of_surfaces_where_a_light_alone_is_seen_at_other_times() -> None:
    """The strip, at the depth 3, covers a column half of the time, and a light behind it is in view all the time."""
    stage = Usd.Stage.CreateInMemory()
    light = """def SphereLight "Lamp" {
    float inputs:radius = 1
    double3 xformOp:translate = (-3.5, 0, -9)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
    assert stage.GetRootLayer().ImportFromString(STAGE % (100, OPEN) + light)
    result = warpmis.render(stage, width=8, method="nee", max_depth=0, spp=32, shutter_samples=2)
    assert ((result.alpha == 1.0) & (result.depth > 0.0)).any()
    np.testing.assert_allclose(result.depth[result.depth > 0.0], 3.0, rtol=1e-5)


def test_a_time_limit_tells_the_samples_of_all_times() -> None:
    result = render(OPEN, shutter_samples=2, time_limit=1e-6)
    assert result.stats["stopping"] == {"reason": "time limit", "spp": 2}
    assert (result.samples == 2).all()
