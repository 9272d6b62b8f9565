"""What the measurements say: report.json, and all the numbers of the report."""

from __future__ import annotations

import math
import platform
import statistics
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

import warpmis
from warpmis.compare.bias import bias_of
from warpmis.compare.measure import Experiment, Measurement, Pictures, Run
from warpmis.compare.prediction import Curve, slope, time_to
from warpmis.compare.reference import Reference
from warpmis.film.metrics import OUTLIERS, without_outliers

# Relative errors that the time to is told of.
TARGETS = (0.1, 0.05, 0.02, 0.01, 0.005)

# A run whose error is not this many times the reference's own (both squared) says more about the reference.
ABOVE_REFERENCE = 2.0

# Repetitions of one run that differ by this factor tell of another program on the machine.
BUSY = 1.3


def summarize(experiment: Experiment, stage: str) -> dict[str, Any]:
    """Everything but the pictures, as plain JSON values; NaN and infinity are None. `stage` is what it is called."""
    baseline = experiment.measurements[0]
    first = baseline.equal_time[0]
    result = _pictures(baseline).first
    return {
        "version": warpmis.__version__,
        "stage": stage,
        "camera": experiment.scene.camera.path,
        "resolution": list(experiment.scene.resolution),
        "baseline": baseline.variant.label,
        "spp": experiment.spp,
        "repeats": len(baseline.equal_time),
        "equal_seconds": _spread([run.seconds for run in baseline.equal_time]),
        "seed": experiment.settings.seed,
        "max_depth": result.settings["max_depth"],
        "device": result.settings["device"],
        "threads": result.stats["threads"],
        "machine": platform.platform(),
        "outliers": OUTLIERS,
        "reference": {
            "source": experiment.reference.source,
            "relative_error": experiment.reference.relative_error(),
            "seconds": experiment.reference.seconds,
        },
        "targets": list(TARGETS),
        "methods": [_method(measurement, experiment) for measurement in experiment.measurements],
        "warnings": _distinct([*result.warnings, *experiment.left_out, *_doubts(experiment, first)]),
        "notes": _distinct([note for one in experiment.measurements for note in _pictures(one).first.notes]),
    }


def efficiency_map(measurement: Measurement, baseline: Measurement) -> NDArray[np.float64]:
    """Per pixel 1 / (squared error x time) over the baseline's, from the runs of equal time, shape (H, W).

    The squared errors of all repetitions are averaged over 17 x 17 pixels first, the worst percent cut to what is left:
    one pixel's error is mere chance. Where both are next to nothing, as on a lamp, the ratio is 1.
    """
    ours, theirs = (
        _box_mean(_without_fireflies(_pictures(one).mean_error())) * _median(run.seconds for run in one.equal_time)
        for one in (measurement, baseline)
    )
    nothing = 1e-6 * float(np.median(theirs)) + 1e-30
    return (theirs + nothing) / (ours + nothing)


def _without_fireflies(errors: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.minimum(errors, np.quantile(errors, 0.99))


def _method(measurement: Measurement, experiment: Experiment) -> dict[str, Any]:
    variant = measurement.variant
    noise = _reference_noise(experiment.reference)
    bias = bias_of(_longest(measurement), experiment.reference)
    curve = _curve(measurement, noise, bias.squared)
    share = _median(run.learn_seconds / run.seconds for run in measurement.equal_time)
    first = _pictures(measurement).first
    return {
        "label": variant.label,
        "knob": variant.knob or None,
        "value": variant.value if variant.knob else None,
        "settings": first.settings,
        "strategies": list(first.strategies) if first.settings["method"] != "nee" else [],
        "compile_seconds": measurement.compile_seconds,
        "runs": [_point(runs, noise) for _, runs in sorted(measurement.runs.items())],
        "equal_time": _point(measurement.equal_time, noise),
        "slope": _finite(slope(curve.seconds, [math.sqrt(error) for error in curve.errors])),
        "bias": {"relative_error": math.sqrt(bias.squared), "limit": bias.limit and math.sqrt(bias.limit)},
        "efficiency": _efficiency(measurement, experiment.measurements[0], noise),
        "learning": {
            "share_of_time": share,
            "per_sample": _cost(measurement) / _cost(experiment.measurements[0]),
        },
        "rejected_samples": sum(run.rejected_samples for run in _all_runs(measurement)),
        "time_to": [_arrival(curve, target, share, _scatter(measurement, noise)) for target in TARGETS],
    }


def _arrival(curve: Curve, target: float, learn_share: float, scatter: dict[str, float]) -> dict[str, Any]:
    arrival = time_to(curve, target**2)
    seconds = _finite(arrival.seconds)
    if seconds is None:
        return {"relative_error": target, "kind": arrival.kind, "seconds": None, "learn_seconds": None}
    return {
        "relative_error": target,
        "kind": arrival.kind,
        "seconds": {end: seconds * factor for end, factor in scatter.items()},
        "learn_seconds": seconds * learn_share,
    }


def _scatter(measurement: Measurement, noise: float) -> dict[str, float]:
    """relMSE x time of the longer runs over its median: as much scatters a time to an error."""
    _, runs = max(measurement.runs.items())
    costs = [_without(run, noise) * run.seconds for run in _long_runs(measurement, runs)]
    return _spread([cost / _median(costs) for cost in costs])


def _point(runs: Sequence[Run], noise: float) -> dict[str, Any]:
    """The repetitions of one budget: medians with their range."""
    return {
        "spp": runs[0].spp,
        "seeds": [run.seed for run in runs],
        "seconds": _spread([run.seconds for run in runs]),
        "relative_error": _spread([math.sqrt(_without(run, noise)) for run in runs]),
        "mean_squared_error": _spread([run.mean_squared_error for run in runs]),
    }


def _curve(measurement: Measurement, noise: float, bias: float) -> Curve:
    """Medians of the runs that are clear of the reference's noise.

    The longest run's time, on which all predictions rest, is taken from twice as many runs, those of equal time too:
    relMSE x time is the same for all runs of some length.
    """
    budgets = [runs for _, runs in sorted(measurement.runs.items())]
    clear = [runs for runs in budgets if _median(run.relative_mse for run in runs) > ABOVE_REFERENCE * noise]
    budgets = clear or budgets[:1]
    seconds = [_median(run.seconds for run in runs) for runs in budgets]
    errors = [_median(_without(run, noise) for run in runs) for runs in budgets]
    bias = min(bias, 0.999 * min(errors))  # never above what was measured: they come from different trimmings
    costs = [max(_without(run, noise) - bias, 0.0) * run.seconds for run in _long_runs(measurement, budgets[-1])]
    steady = _median(costs) / (errors[-1] - bias)
    if not seconds[:-1] or steady > seconds[-2]:  # else the machine was too busy to tell
        seconds[-1] = steady
    return Curve(tuple(seconds), tuple(errors), bias)


def _all_runs(measurement: Measurement) -> list[Run]:
    return [*(run for runs in measurement.runs.values() for run in runs), *measurement.equal_time]


def _long_runs(measurement: Measurement, longest: Sequence[Run]) -> list[Run]:
    """The runs that are at least about as long as `longest`, one budget's repetitions."""
    return [*longest, *(run for run in measurement.equal_time if run.spp >= 0.5 * longest[0].spp)]


def _efficiency(measurement: Measurement, baseline: Measurement, noise: float) -> dict[str, float]:
    """1 / (relMSE x time) over the baseline's, each repetition with the baseline's of the same turn."""
    pairs = zip(measurement.equal_time, baseline.equal_time, strict=True)
    ratios = [
        _without(theirs, noise) * theirs.seconds / (_without(ours, noise) * ours.seconds) for ours, theirs in pairs
    ]
    return _spread(ratios)


def _doubts(experiment: Experiment, first: Run) -> list[str]:
    """What makes the numbers less than they look."""
    doubts = []
    if experiment.reference.squared_standard_error is None:
        unknown = "its own noise is not known; it is part of every error and hides any bias"
        doubts.append(f"{experiment.reference.source}: {unknown}")
    elif first.relative_mse < 4.0 * _reference_noise(experiment.reference):
        doubts.append("the reference is hardly better than the longest runs: raise --reference-spp")
    for measurement in experiment.measurements:
        rejected = sum(run.rejected_samples for run in _all_runs(measurement))
        if rejected:
            doubts.append(f"{measurement.variant.label}: {rejected} samples were not finite and are in no picture")
    times = [_spread([run.seconds for run in measurement.equal_time]) for measurement in experiment.measurements]
    worst = max(time["high"] / time["low"] for time in times)
    if worst > BUSY:
        doubts.append(
            f"the same run took up to {worst:.1f} times as long as before: stop other programs, or raise --repeats"
        )
    return doubts


def _reference_noise(reference: Reference) -> float:
    """What the reference's own noise adds to every relMSE."""
    return float(without_outliers(reference.relative_noise()).mean())


def _without(run: Run, noise: float) -> float:
    """relMSE without the reference's part; at least a thousandth of what was measured."""
    return max(run.relative_mse - noise, 1e-3 * run.relative_mse, 1e-30)


def _cost(measurement: Measurement) -> float:
    """Seconds of one sample per pixel."""
    return _median(run.seconds / run.spp for run in measurement.equal_time)


def _pictures(measurement: Measurement) -> Pictures:
    assert measurement.in_equal_time is not None, "every variant that is kept has run"
    return measurement.in_equal_time


def _longest(measurement: Measurement) -> Pictures:
    assert measurement.longest is not None, "every variant that is kept has run"
    return measurement.longest


def _box_mean(picture: NDArray[np.float64], radius: int = 8) -> NDArray[np.float64]:
    """Mean over the square about each pixel, smaller at the border, by a table of sums."""
    height, width = picture.shape
    table = np.zeros((height + 1, width + 1))
    table[1:, 1:] = picture.cumsum(axis=0).cumsum(axis=1)
    top, bottom = (np.clip(np.arange(height) + shift, 0, height) for shift in (-radius, radius + 1))
    left, right = (np.clip(np.arange(width) + shift, 0, width) for shift in (-radius, radius + 1))
    sums = (
        table[np.ix_(bottom, right)]
        - table[np.ix_(top, right)]
        - table[np.ix_(bottom, left)]
        + table[np.ix_(top, left)]
    )
    return np.maximum(sums, 0.0) / np.outer(bottom - top, right - left)


def _median(values: Any) -> float:
    return float(statistics.median(values))


def _spread(values: Sequence[float]) -> dict[str, float]:
    return {"median": _median(values), "low": float(min(values)), "high": float(max(values))}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _distinct(lines: Sequence[str]) -> list[str]:
    return list(dict.fromkeys(lines))
