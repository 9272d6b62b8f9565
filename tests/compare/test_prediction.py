"""The time to an error, on curves of which it is known."""

from __future__ import annotations

import math

import pytest

from warpmis.compare.prediction import Curve, slope, time_to


@pytest.mark.parametrize("exponent", [-1.0, -0.8, -0.5])
def test_slope_of_a_power_law(exponent: float) -> None:
    seconds = (0.5, 2.0, 8.0)
    assert slope(seconds, [3.0 * t**exponent for t in seconds]) == pytest.approx(exponent)
    assert math.isnan(slope((1.0,), (1.0,)))


def test_prediction_of_a_known_law() -> None:
    """relMSE = 0.04 / t: 2 % (0.0004) after 100 s."""
    curve = Curve((1.0, 4.0), (0.04, 0.01))
    arrival = time_to(curve, 0.0004)
    assert (arrival.kind, arrival.seconds) == ("predicted", pytest.approx(100.0))


def test_between_two_runs_it_is_measured() -> None:
    curve = Curve((1.0, 4.0, 16.0), (0.04, 0.01, 0.0025))
    arrival = time_to(curve, 0.005)
    assert (arrival.kind, arrival.seconds) == ("measured", pytest.approx(8.0))
    steep = time_to(Curve((1.0, 4.0), (0.16, 0.01)), 0.04)  # whatever the slope between them is
    assert (steep.kind, steep.seconds) == ("measured", pytest.approx(2.0))


def test_what_the_shortest_run_has_reached() -> None:
    arrival = time_to(Curve((1.0, 4.0), (0.04, 0.01)), 0.05)
    assert (arrival.kind, arrival.seconds) == ("sooner", 1.0)


def test_a_bias_slows_and_stops() -> None:
    """relMSE = 0.0001 + 0.04 / t."""
    curve = Curve((1.0, 4.0), (0.0401, 0.0101), bias=0.0001)
    assert time_to(curve, 0.0005).seconds == pytest.approx(100.0)
    never = time_to(curve, 0.0001)
    assert (never.kind, never.seconds) == ("never", math.inf)
