"""Numbers as people read them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any


def percent(value: float) -> str:
    """0.02 as "2 %", two significant digits below 10 %."""
    scaled = 100.0 * value
    if scaled <= 0.0:
        return "0 %"
    digits = max(0, 1 - math.floor(math.log10(scaled) + 1e-9))
    text = f"{scaled:.{digits}f}"
    return f"{text.rstrip('0').rstrip('.') if '.' in text else text} %"


def error_text(point: Mapping[str, Any]) -> str:
    """A run's median relative error, with a sign where the reference's noise hides how small it is."""
    text = percent(point["relative_error"]["median"])
    return f"< {text}" if point["below_reference"] else text


def seconds_text(seconds: float) -> str:
    """Seconds with two significant digits, minutes from 100 s on, hours from 100 min on, then days."""
    for unit, length, limit in (("s", 1.0, 100.0), ("min", 60.0, 100.0), ("h", 3600.0, 48.0)):
        if seconds < length * limit:
            return f"{_short(seconds / length)} {unit}"
    return f"{_short(seconds / 86400.0)} days"


def ratio_text(ratio: float) -> str:
    """A factor with two decimals, fewer from 10 on."""
    return f"{ratio:.2f}" if ratio < 10.0 else f"{ratio:.1f}" if ratio < 100.0 else f"{ratio:.0f}"


def _short(value: float) -> str:
    """Two significant digits, and no fewer than stand before the point."""
    if value <= 0.0:
        return "0"
    rounded = float(f"{value:.1e}")
    return f"{rounded:.{max(0, 1 - math.floor(math.log10(rounded)))}f}" if value < 100.0 else f"{value:.0f}"
