"""The report's tables, one row a method."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from html import escape
from typing import Any

from warpmis.output.report.plot import marker, range_bar
from warpmis.output.report.text import error_text, percent, ratio_text, seconds_text

Method = dict[str, Any]
Column = tuple[str, str, Callable[[Method], str]]  # heading, what it means, a method's cell


def glance_table(methods: Sequence[Method], flip: bool) -> str:
    """Who is better, and by how much."""
    ends = [method["efficiency"][end] for method in methods for end in ("low", "high")]
    limits = (min(0.5, *ends), max(2.0, *ends))

    def efficiency(method: Method) -> str:
        low, median, high = (method["efficiency"][end] for end in ("low", "median", "high"))
        return f"<b>{ratio_text(median)}</b> {_range(ratio_text(low), ratio_text(high))}" + range_bar(
            low, median, high, limits
        )

    columns: list[Column] = [
        ("efficiency", "1 / (relMSE × time) over the baseline's, at equal time; median and range", efficiency),
        ("error at equal time", "relative error, median and range", lambda m: _error(m["equal_time"])),
        ("spp", "samples per pixel in that time", lambda m: str(m["equal_time"]["spp"])),
        ("error at equal samples", "relative error of the longest run of the ladder", lambda m: _error(m["runs"][-1])),
        (
            "time",
            "of these samples, learning included",
            lambda m: seconds_text(m["runs"][-1]["seconds"]["median"]),
        ),
        ("slope", "of the error over time, both in logarithms; independent samples give −0.5", _slope),
        ("MSE", "mean squared error at equal time, fireflies and all", _mse),
        ("bias", "relative error that more samples do not remove; below it, how much could hide in the noise", _bias),
    ]
    if any(method["denoised"] is not None for method in methods):
        columns.insert(
            2, ("denoised, at equal time", "relative error with denoising, which is in that time", _denoised_error)
        )
    if flip:
        columns.append(("FLIP", "mean HDR-FLIP at equal time: 0 the same, 1 as different as can be", _flip))
    return _table(methods, columns)


def time_table(methods: Sequence[Method], targets: Sequence[float]) -> str:
    """When each method is good enough; the first to arrive stands out."""
    first = {}
    for index, target in enumerate(targets):
        arrivals = [method["time_to"][index]["seconds"] for method in methods]
        first[target] = min((seconds["median"] for seconds in arrivals if seconds is not None), default=None)

    def column(index: int, target: float) -> Column:
        def cell(method: Method) -> str:
            denoised = method["denoised"]
            with_it = "" if denoised is None else _denoised_arrival(denoised["time_to"][index])
            return _arrival(method["time_to"][index], method, first[target]) + with_it

        return percent(target), f"time until the relative error is {percent(target)}", cell

    return _table(methods, [column(index, target) for index, target in enumerate(targets)])


def denoised_table(methods: Sequence[Method], flip: bool) -> str:
    """Error and time of each method without and with denoising, at equal time and at equal samples."""

    def pair(cell: Callable[[Method], str]) -> Callable[[Method], str]:
        """Without denoising, and below it with."""

        def both(method: Method) -> str:
            with_it = method["denoised"]
            return f"{cell(method)}<br><b>{'–' if with_it is None else cell(with_it)}</b>"

        return both

    columns: list[Column] = [
        ("", "each method without denoising, and below it with", lambda m: "as sampled<br><b>denoised</b>"),
        ("efficiency", "1 / (relMSE × time) over the baseline's without denoising, at equal time", pair(_median_ratio)),
        ("error at equal time", "relative error, median", pair(lambda m: escape(error_text(m["equal_time"])))),
        ("time", "learning and denoising included", pair(lambda m: _seconds(m["equal_time"]))),
        ("denoising", "the part of it that denoising took", pair(lambda m: _denoise_seconds(m["equal_time"]))),
        ("spp", "samples per pixel in that time", pair(lambda m: str(m["equal_time"]["spp"]))),
        ("error at equal samples", "relative error, median", pair(lambda m: escape(error_text(m["runs"][-1])))),
        ("time", "of these samples, denoising included", pair(lambda m: _seconds(m["runs"][-1]))),
    ]
    if flip:
        columns.insert(3, ("FLIP", "mean HDR-FLIP at equal time", pair(_flip)))
        columns.append(("FLIP", "mean HDR-FLIP at equal samples", pair(_flip_equal_samples)))
    return _table(methods, columns)


def cost_table(methods: Sequence[Method], baseline: str) -> str:
    """What a method costs besides its error."""
    columns: list[Column] = [
        (
            f"time per sample, {baseline} = 1",
            "at equal time, learning included",
            lambda m: ratio_text(m["learning"]["per_sample"]),
        ),
        (
            "learn rounds",
            "part of the time; their samples are in the picture too",
            lambda m: percent(m["learning"]["share_of_time"]) if m["learning"]["share_of_time"] else "none",
        ),
        (
            "rejected samples",
            "of all runs: those that were not finite, and are in no picture",
            lambda m: str(m["rejected_samples"]) if m["rejected_samples"] else "none",
        ),
        (
            "compilation",
            "of its kernels, or loading them from the cache: in none of the times above",
            lambda m: seconds_text(m["compile_seconds"]),
        ),
    ]
    return _table(methods, columns)


def _table(methods: Sequence[Method], columns: Sequence[Column]) -> str:
    heads = "".join(f'<th scope="col" title="{escape(meaning)}">{heading}</th>' for heading, meaning, _ in columns)
    rows = []
    for number, method in enumerate(methods):
        cells = "".join(f"<td>{cell(method)}</td>" for _, _, cell in columns)
        name = f"{marker(number)}{escape(method['label'])}"
        rows.append(f'<tr><th scope="row">{name}</th>{cells}</tr>')
    return (
        f'<div class="scroll"><table><thead><tr><th scope="col">method</th>{heads}</tr></thead>'
        f"<tbody>{''.join(rows)}</tbody></table></div>"
    )


def _error(point: dict[str, Any]) -> str:
    low, high = (point["relative_error"][end] for end in ("low", "high"))
    return f"{escape(error_text(point))} {_range(percent(low), percent(high))}"


def _range(low: str, high: str) -> str:
    return f'<span class="spread">{low} – {high}</span>' if low != high else ""


def _arrival(arrival: dict[str, Any], method: Method, first: float | None) -> str:
    if arrival["kind"] == "never":
        return f'<span class="never">never: bias {percent(method["bias"]["relative_error"])}</span>'
    low, seconds, high = (arrival["seconds"][end] for end in ("low", "median", "high"))
    text = seconds_text(seconds)
    shown = {"measured": text, "predicted": f"<i>≈ {text}</i>", "sooner": f"&lt; {text}"}[arrival["kind"]]
    if seconds == first:
        shown = f"<mark>{shown}</mark>"
    learn = arrival["learn_seconds"]
    shown += _range(seconds_text(low), seconds_text(high))
    return shown + (f'<span class="spread">{seconds_text(learn)} of it learning</span>' if learn else "")


def _denoised_error(method: Method) -> str:
    return "–" if method["denoised"] is None else f"<b>{_error(method['denoised']['equal_time'])}</b>"


def _denoised_arrival(arrival: dict[str, Any]) -> str:
    sign = {"measured": "", "sooner": "&lt; ", "later": "&gt; "}[arrival["kind"]]
    return f'<span class="spread"><b>{sign}{seconds_text(arrival["seconds"]["median"])}</b> denoised</span>'


def _median_ratio(method: Method) -> str:
    return ratio_text(method["efficiency"]["median"])


def _seconds(point: dict[str, Any]) -> str:
    return seconds_text(point["seconds"]["median"])


def _denoise_seconds(point: dict[str, Any]) -> str:
    return seconds_text(point["denoise_seconds"]) if point["denoise_seconds"] else "–"


def _slope(method: Method) -> str:
    return "–" if method["slope"] is None else f"{method['slope']:.2f}".replace("-", "−")


def _bias(method: Method) -> str:
    error = method["bias"]["relative_error"]
    if error:
        return f"<b>{percent(error)}</b>"
    limit = method["bias"]["limit"]
    return "not known" if limit is None else f'none seen<span class="spread">&lt; {percent(limit)}</span>'


def _mse(method: Method) -> str:
    return f"{method['equal_time']['mean_squared_error']['median']:.2g}"


def _flip(method: Method) -> str:
    return "–" if method["flip"] is None else f"{method['flip']:.3f}"


def _flip_equal_samples(method: Method) -> str:
    return "–" if method["flip_equal_samples"] is None else f"{method['flip_equal_samples']:.3f}"
