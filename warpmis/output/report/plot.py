"""Error against time on logarithmic axes, as SVG that takes its colours from the page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

from warpmis.output.report.text import error_text, percent, seconds_text

WIDTH, HEIGHT = 900, 470
LEFT, RIGHT, TOP, BOTTOM = 74, 58, 16, 52

# How far beyond the longest run the plot follows a prediction.
FORESIGHT = 64.0

# The least that an axis spans: a factor that has two labelled ticks in it at least.
LEAST_SPAN = 6.0

# Series are told apart by shape as well as by colour; paths within a box from -1 to 1.
MARKERS = (
    "M-1,0A1,1 0 1 1 1,0A1,1 0 1 1 -1,0Z",
    "M-.9,-.9H.9V.9H-.9Z",
    "M0,-1.2L1.1,.8H-1.1Z",
    "M0,-1.25L1.25,0L0,1.25L-1.25,0Z",
    "M0,1.2L1.1,-.8H-1.1Z",
    "M-.4,-1.1H.4V-.4H1.1V.4H.4V1.1H-.4V.4H-1.1V-.4H-.4Z",
    "M-1.2,0L-.6,-1H.6L1.2,0L.6,1H-.6Z",
)


@dataclass(frozen=True)
class Axes:
    """Logarithmic axes: seconds to the right, relative error up."""

    seconds: tuple[float, float]
    errors: tuple[float, float]

    def x(self, seconds: float) -> float:
        low, high = self.seconds
        return LEFT + (WIDTH - LEFT - RIGHT) * math.log(seconds / low) / math.log(high / low)

    def y(self, error: float) -> float:
        low, high = self.errors
        return TOP + (HEIGHT - TOP - BOTTOM) * math.log(high / error) / math.log(high / low)


def error_plot(methods: Sequence[dict[str, Any]], targets: Sequence[float], reference_error: float | None) -> str:
    """Measured runs as points with their range, predictions dashed, and the targets as lines across."""
    denoised = [method["denoised"] for method in methods]
    axes = _axes([*methods, *(one for one in denoised if one is not None)])
    parts = [
        f'<svg class="plot" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" '
        'aria-label="Relative error against time, both logarithmic">',
        *_time_axis(axes),
        *_error_axis(axes),
        *_targets(axes, targets),
        *_reference(axes, reference_error, targets),
        '<g clip-path="inset(0)">',
        *(line for number, method in enumerate(methods) for line in _series(axes, method, number)),
        *(
            line
            for number, one in enumerate(denoised)
            if one is not None
            for line in _series(axes, one, number, "denoised")
        ),
        "</g></svg>",
    ]
    return "\n".join(parts)


def marker(number: int) -> str:
    """A series' point on its own, for legends and tables."""
    shape = MARKERS[number % len(MARKERS)]
    return f'<svg class="key s{number % 8}" viewBox="-2 -2 4 4" aria-hidden="true"><path d="{shape}"/></svg>'


def range_bar(low: float, median: float, high: float, limits: tuple[float, float]) -> str:
    """A ratio with its range on a small logarithmic scale, a line at 1."""
    start, end = (math.log(limit) for limit in limits)

    def x(ratio: float) -> float:
        return 4 + 112 * (math.log(ratio) - start) / (end - start)

    return (
        '<svg class="range" viewBox="0 0 120 14" aria-hidden="true">'
        f'<path class="one" d="M{x(1.0):.1f},0V14"/><path class="whisker" d="M{x(low):.1f},7H{x(high):.1f}"/>'
        f'<circle cx="{x(median):.1f}" cy="7" r="3.6"/></svg>'
    )


def _axes(methods: Sequence[dict[str, Any]]) -> Axes:
    points = [point for method in methods for point in method["runs"]]
    times = [point["seconds"]["median"] for point in points]
    errors = [point["relative_error"][end] for point in points for end in ("low", "high")]
    horizon = FORESIGHT * max(times)
    arrivals = [arrival for method in methods for arrival in method["time_to"]]
    reached = [a for a in arrivals if a["kind"] in ("measured", "predicted") and a["seconds"]["median"] <= horizon]
    times += [arrival["seconds"]["median"] for arrival in reached]
    errors += [arrival["relative_error"] for arrival in reached]
    return Axes(_roomy(0.8 * min(times), 1.25 * max(times)), _roomy(0.85 * min(errors), 1.15 * max(errors)))


def _roomy(low: float, high: float) -> tuple[float, float]:
    """Limits so far apart that ticks fall between them."""
    apart = math.sqrt(max(1.0, LEAST_SPAN / (high / low)))
    return low / apart, high * apart


def _series(axes: Axes, method: dict[str, Any], number: int, kind: str = "") -> list[str]:
    points = [(point["seconds"]["median"], point["relative_error"]) for point in method["runs"]]
    path = "L".join(f"{axes.x(t):.1f},{axes.y(e['median']):.1f}" for t, e in points)
    lines = [f'<g class="series {kind} s{number % 8}">', f'<path class="line" d="M{path}"/>']
    predicted = [a for a in method["time_to"] if a["kind"] == "predicted"]
    future = [a for a in predicted if a["seconds"]["median"] <= axes.seconds[1]]
    if future:
        start = (points[-1][0], points[-1][1]["median"])
        ahead = [start, *((a["seconds"]["median"], a["relative_error"]) for a in future)]
        path = "L".join(f"{axes.x(t):.1f},{axes.y(e):.1f}" for t, e in ahead)
        lines.append(f'<path class="line predicted" d="M{path}"/>')
    shape = MARKERS[number % len(MARKERS)]
    for point, (seconds, error) in zip(method["runs"], points, strict=True):
        x, y = axes.x(seconds), axes.y(error["median"])
        told = f"{method['label']}, {point['spp']} spp: {error_text(point)} after {seconds_text(seconds)}"
        lines.append(f'<path class="whisker" d="M{x:.1f},{axes.y(error["high"]):.1f}V{axes.y(error["low"]):.1f}"/>')
        lines.append(
            f'<path class="point" transform="translate({x:.1f} {y:.1f}) scale(4.6)" d="{shape}">'
            f"<title>{escape(told)}</title></path>"
        )
    return [*lines, "</g>"]


def _time_axis(axes: Axes) -> list[str]:
    bottom = HEIGHT - BOTTOM
    lines = []
    for value, major in _ticks(*axes.seconds):
        x = axes.x(value)
        lines.append(f'<path class="grid{"" if major else " minor"}" d="M{x:.1f},{TOP}V{bottom}"/>')
        if major:
            lines.append(f'<text x="{x:.1f}" y="{bottom + 18}" text-anchor="middle">{value:g}</text>')
    middle = (LEFT + WIDTH - RIGHT) / 2
    lines.append(
        f'<text class="title" x="{middle}" y="{HEIGHT - 10}" text-anchor="middle">'
        "time to learn and render [s], compilation excluded</text>"
    )
    return lines


def _error_axis(axes: Axes) -> list[str]:
    lines = []
    for value, major in _ticks(*axes.errors):
        y = axes.y(value)
        lines.append(f'<path class="grid{"" if major else " minor"}" d="M{LEFT},{y:.1f}H{WIDTH - RIGHT}"/>')
        if major:
            lines.append(f'<text x="{LEFT - 8}" y="{y + 4:.1f}" text-anchor="end">{percent(value)}</text>')
    middle = (TOP + HEIGHT - BOTTOM) / 2
    lines.append(
        f'<text class="title" transform="translate(18 {middle}) rotate(-90)" text-anchor="middle">relative error</text>'
    )
    return lines


def _targets(axes: Axes, targets: Sequence[float]) -> list[str]:
    lines = []
    for target in targets:
        if axes.errors[0] <= target <= axes.errors[1]:
            y = axes.y(target)
            lines.append(f'<path class="target" d="M{LEFT},{y:.1f}H{WIDTH - RIGHT}"/>')
            lines.append(f'<text class="target" x="{WIDTH - RIGHT + 6}" y="{y + 4:.1f}">{percent(target)}</text>')
    return lines


def _reference(axes: Axes, error: float | None, targets: Sequence[float]) -> list[str]:
    if error is None or not axes.errors[0] <= error <= axes.errors[1]:
        return []
    y = axes.y(error)
    crowded = any(-4.0 < axes.y(target) - y < 20.0 for target in targets)
    words = y - 6.0 if crowded else y + 15.0
    return [
        f'<path class="reference" d="M{LEFT},{y:.1f}H{WIDTH - RIGHT}"/>',
        f'<text class="reference" x="{LEFT + 6}" y="{words:.1f}">the reference\'s own noise, {percent(error)}</text>',
    ]


def _ticks(low: float, high: float) -> list[tuple[float, bool]]:
    """Decades (True: labelled) and 2 to 9 between them; 2 and 5 labelled too where there are few decades."""
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    labelled = (1, 2, 5) if math.log10(high / low) < 2.5 else (1,)
    ticks = [(digit * 10.0**power, digit in labelled) for power in range(first, last + 1) for digit in range(1, 10)]
    return [(value, major) for value, major in ticks if low <= value <= high]
