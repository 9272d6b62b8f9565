"""An experiment that was interrupted: what was measured of it, made comparable."""

from __future__ import annotations

from collections.abc import Sequence

from warpmis.compare.measure import Measurement, with_denoised

INTERRUPTED = "interrupted: there are fewer repetitions than were asked for"
NO_EQUAL_TIME = "interrupted before the runs of equal time: the longest runs stand for them"


def keep_measured(measurements: list[Measurement]) -> list[str]:
    """Leave out what has not been up the ladder once, and give all methods as many repetitions.

    Returns what a reader has to know, a line each; nothing where the baseline itself has no picture.
    """
    if not measurements or measurements[0].longest is None:
        return []
    lines = [INTERRUPTED]
    for measurement in list(measurements):
        if measurement.longest is None:
            measurements.remove(measurement)
            lines.append(f"{measurement.variant.label} was not measured before the interrupt")
        elif measurement.denoised is not None and measurement.denoised.longest is None:
            lines.append(f"{measurement.denoised.variant.label} was not measured before the interrupt")
            measurement.denoised = None
    every = with_denoised(measurements)
    if any(not measurement.equal_time for measurement in every):
        lines.append(NO_EQUAL_TIME)
        for measurement in every:
            _, longest = max(measurement.runs.items())
            measurement.equal_time, measurement.in_equal_time = list(longest), measurement.longest
    _cut_to_common(every)
    return lines


def _cut_to_common(measurements: Sequence[Measurement]) -> None:
    common = min(len(measurement.equal_time) for measurement in measurements)
    for measurement in measurements:
        measurement.equal_time = measurement.equal_time[:common]
