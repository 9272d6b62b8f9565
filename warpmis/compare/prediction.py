"""How long until it is good enough: a method's error as a function of time, within what was measured and beyond.

Errors here are relMSE (squared), with the reference's own noise taken out.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

Kind = Literal["measured", "predicted", "sooner", "never"]


@dataclass(frozen=True)
class Curve:
    """What was measured of one method.

    Attributes:
        seconds: of the runs, growing [s].
        errors: their relMSE.
        bias: relMSE that stays however long one waits.
    """

    seconds: tuple[float, ...]
    errors: tuple[float, ...]
    bias: float = 0.0


@dataclass(frozen=True)
class Arrival:
    """When a method reaches an error.

    Attributes:
        seconds: the time [s]; infinite if never.
        kind: "measured": between two runs; "predicted": past the longest; "sooner": the shortest run is already
            better, and took `seconds`; "never": the bias is larger.
    """

    seconds: float
    kind: Kind


def slope(seconds: Sequence[float], errors: Sequence[float]) -> float:
    """Exponent s of the power law error ~ seconds^s: least squares in logarithms; NaN for fewer than two points."""
    points = [(t, e) for t, e in zip(seconds, errors, strict=True) if t > 0.0 and e > 0.0]
    if len(points) < 2:
        return math.nan
    log_seconds, log_errors = np.log(np.array(points)).T
    return float(np.polyfit(log_seconds, log_errors, 1)[0])


def time_to(curve: Curve, target: float) -> Arrival:
    """When the curve falls to the relMSE `target`.

    Between two runs it is a power law through both. Past the longest, at (t_n, e_n),

        error(t) = bias + (e_n - bias) t_n / t

    since the squared error of a mean falls in inverse proportion to the number of its samples. The slope of the short
    runs is no better guide: without outliers they look better than they are, and learning makes them worse
    (docs/report.md).
    """
    if curve.errors[0] <= target:
        return Arrival(curve.seconds[0], "sooner")
    runs = list(zip(curve.seconds, curve.errors, strict=True))
    for (t0, e0), (t1, e1) in itertools.pairwise(runs):
        if e1 <= target:
            part = math.log(e0 / target) / math.log(e0 / max(e1, 1e-30))
            return Arrival(t0 * (t1 / t0) ** part, "measured")
    if target <= curve.bias:
        return Arrival(math.inf, "never")
    last_seconds, last_error = runs[-1]
    return Arrival(last_seconds * (last_error - curve.bias) / (target - curve.bias), "predicted")
