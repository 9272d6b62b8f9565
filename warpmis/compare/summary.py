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
from warpmis.compare.measure import Experiment, Measurement, Pictures, Run, with_denoised
from warpmis.compare.prediction import Curve, slope, time_to
from warpmis.compare.reference import Reference
from warpmis.film.metrics import OUTLIERS, without_outliers

# Relative errors that the time to is told of.
TARGETS = (0.1, 0.05, 0.02, 0.01, 0.005)

# A run whose error is not this many times the reference's own (both squared) says more about the reference.
ABOVE_REFERENCE = 2.0

# An error below this part of the reference's own (both squared) cannot be told from none.
RESOLVED = 0.25

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
    scatter = _scatter(measurement)
    first = _pictures(measurement).first
    return {
        **_figures(measurement, experiment),
        "knob": variant.knob or None,
        "value": variant.value if variant.knob else None,
        "settings": first.settings,
        "strategies": list(first.strategies) if first.settings["method"] != "nee" else [],
        "slope": _finite(slope(curve.seconds, [math.sqrt(error) for error in curve.errors])),
        "bias": {"relative_error": math.sqrt(bias.squared), "limit": bias.limit and math.sqrt(bias.limit)},
        "learning": {
            "share_of_time": _learn_share(measurement),
            "per_sample": _cost(measurement) / _cost(experiment.measurements[0]),
        },
        "time_to": [_arrival(curve, target, _learn_share(measurement), scatter) for target in TARGETS],
        "denoised": None if measurement.denoised is None else _denoised(measurement.denoised, experiment),
    }


def _denoised(measurement: Measurement, experiment: Experiment) -> dict[str, Any]:
    """A method's figures with denoising.

    Nothing is predicted: no law says how the error of a denoised picture falls. Beyond the longest run a time is
    "later" than that run's.
    """
    budgets = [runs for _, runs in sorted(measurement.runs.items())]
    curve = Curve(
        tuple(_median(run.seconds for run in runs) for runs in budgets),
        tuple(_median(map(_without, runs)) for runs in budgets),
    )
    longest = _median(run.seconds for run in budgets[-1])
    scatter = _spread([run.seconds / longest for run in budgets[-1]])
    arrivals = [_arrival(curve, target, _learn_share(measurement), scatter) for target in TARGETS]
    for arrival in arrivals:
        if arrival["kind"] == "predicted":
            times = {"low": longest, "median": longest, "high": longest}
            arrival |= {"kind": "later", "seconds": times, "learn_seconds": None}
    return {**_figures(measurement, experiment), "time_to": arrivals}


def _figures(measurement: Measurement, experiment: Experiment) -> dict[str, Any]:
    """What is told of a method without and with denoising."""
    return {
        "label": measurement.variant.label,
        "compile_seconds": measurement.compile_seconds,
        "runs": [_point(runs) for _, runs in sorted(measurement.runs.items())],
        "equal_time": _point(measurement.equal_time),
        "efficiency": _efficiency(measurement, experiment.measurements[0]),
        "rejected_samples": sum(run.rejected_samples for run in _all_runs(measurement)),
    }


def _learn_share(measurement: Measurement) -> float:
    return _median(run.learn_seconds / run.seconds for run in measurement.equal_time)


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


def _scatter(measurement: Measurement) -> dict[str, float]:
    """relMSE x time of the longer runs over its median: as much scatters a time to an error."""
    _, runs = max(measurement.runs.items())
    costs = [_without(run) * run.seconds for run in _long_runs(measurement, runs)]
    return _spread([cost / _median(costs) for cost in costs])


def _point(runs: Sequence[Run]) -> dict[str, Any]:
    """The repetitions of one budget: medians with their range; below_reference: the error is at most this."""
    return {
        "spp": runs[0].spp,
        "seeds": [run.seed for run in runs],
        "seconds": _spread([run.seconds for run in runs]),
        "denoise_seconds": _median(run.denoise_seconds for run in runs),
        "relative_error": _spread([math.sqrt(_without(run)) for run in runs]),
        "below_reference": 2 * sum(map(_is_below_reference, runs)) > len(runs),
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
    errors = [_median(map(_without, runs)) for runs in budgets]
    bias = min(bias, 0.999 * min(errors))  # never above what was measured: they come from different trimmings
    costs = [max(_without(run) - bias, 0.0) * run.seconds for run in _long_runs(measurement, budgets[-1])]
    steady = _median(costs) / (errors[-1] - bias)
    if not seconds[:-1] or steady > seconds[-2]:  # else the machine was too busy to tell
        seconds[-1] = steady
    return Curve(tuple(seconds), tuple(errors), bias)


def _all_runs(measurement: Measurement) -> list[Run]:
    return [*(run for runs in measurement.runs.values() for run in runs), *measurement.equal_time]


def _long_runs(measurement: Measurement, longest: Sequence[Run]) -> list[Run]:
    """The runs that are at least about as long as `longest`, one budget's repetitions."""
    return [*longest, *(run for run in measurement.equal_time if run.spp >= 0.5 * longest[0].spp)]


def _efficiency(measurement: Measurement, baseline: Measurement) -> dict[str, float]:
    """1 / (relMSE x time) over the baseline's, each repetition with the baseline's of the same turn."""
    pairs = zip(measurement.equal_time, baseline.equal_time, strict=True)
    return _spread([_without(theirs) * theirs.seconds / (_without(ours) * ours.seconds) for ours, theirs in pairs])


def _doubts(experiment: Experiment, first: Run) -> list[str]:
    """What makes the numbers less than they look."""
    doubts = []
    if experiment.reference.squared_standard_error is None:
        unknown = "its own noise is not known; it is part of every error and hides any bias"
        doubts.append(f"{experiment.reference.source}: {unknown}")
    elif first.relative_mse < 4.0 * _reference_noise(experiment.reference):
        doubts.append("the reference is hardly better than the longest runs: raise --reference-spp")
    every = with_denoised(experiment.measurements)
    for measurement in every:
        rejected = sum(run.rejected_samples for run in _all_runs(measurement))
        if rejected:
            doubts.append(f"{measurement.variant.label}: {rejected} samples were not finite and are in no picture")
    level = [one.variant.label for one in every if any(map(_is_below_reference, _all_runs(one)))]
    if level:
        noise = "runs with less error than can be told from the reference's own noise; raise --reference-spp"
        doubts.append(f"{'; '.join(level)}: {noise}")
    times = [_spread([run.seconds for run in measurement.equal_time]) for measurement in every]
    worst = max(time["high"] / time["low"] for time in times)
    if worst > BUSY:
        doubts.append(
            f"the same run took up to {worst:.1f} times as long as before: stop other programs, or raise --repeats"
        )
    return doubts


def _reference_noise(reference: Reference) -> float:
    """What the reference's own noise adds to every relMSE."""
    return float(without_outliers(reference.relative_noise()).mean())


def _without(run: Run) -> float:
    """relMSE without the reference's part; at least what can be told from none."""
    return max(run.relative_mse - run.reference_noise, RESOLVED * run.reference_noise, 1e-30)


def _is_below_reference(run: Run) -> bool:
    return run.relative_mse - run.reference_noise < RESOLVED * run.reference_noise


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
