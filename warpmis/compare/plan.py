"""How many samples each run gets, so that the whole comparison takes about the time it was given."""

from __future__ import annotations

from collections.abc import Sequence

# Each run of the ladder has a fourth of the samples of the next: half of its error.
LADDER = (64, 16, 4, 1)

# The reference has this many times the samples of the longest run: a fourth of its error.
REFERENCE_FACTOR = 16


def ladder(spp: int) -> list[int]:
    """Samples per pixel of the runs that show how the error falls, growing to `spp`; none below 2 but `spp` itself."""
    return [spp // part for part in LADDER if spp // part >= 2 or part == 1]


def affordable_spp(seconds: float, seconds_per_spp: Sequence[float], repeats: int, *, reference: bool) -> int:
    """The longest run's samples per pixel for which everything takes about `seconds`.

    Every method runs the ladder and once for as long as the first one's longest run, `repeats` times; then there is
    the reference, if it has to be made, with the first method.

    Args:
        seconds_per_spp: of each method, the baseline first [s].
    """
    baseline = seconds_per_spp[0]
    ladders = sum(1.0 / part for part in LADDER) * sum(seconds_per_spp)
    equal_time = baseline * len(seconds_per_spp)
    unit = repeats * (ladders + equal_time) + (REFERENCE_FACTOR * baseline if reference else 0.0)
    return _round_number(max(4.0, seconds / unit))


def _round_number(value: float) -> int:
    """The largest of 4, 6, 8, 12, 16, 24, 32, ... that is not above the value (and at least 4)."""
    power = 1 << (int(value).bit_length() - 1)
    return power + power // 2 if value >= 1.5 * power else power
