"""The page: sentences, tables, plots and pictures put into one file."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from importlib import resources
from string import Template
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpmis.output.balance_map import balance_map, sample_shares
from warpmis.output.legend import with_legend
from warpmis.output.report.pixels import diverging_gradient, exposure_for, packed, png_uri, ratio_map
from warpmis.output.report.plot import error_plot, marker
from warpmis.output.report.tables import cost_table, denoised_table, glance_table, time_table
from warpmis.output.report.text import error_text, percent, ratio_text, seconds_text

# The viewer's button for the denoised pictures.
_DENOISED_SET = '<button\n type="button" data-set="denoised" aria-pressed="false">equal time, denoised</button>'

# The error that the report's first sentence speaks of.
GOOD_ENOUGH = 0.02


@dataclass(frozen=True, eq=False, kw_only=True)
class MethodPictures:
    """What there is to see of one method.

    Attributes:
        label: as in the summary.
        equal_time, equal_samples: linear Rec.709, shape (H, W, 3); the second None if it is not to be shown.
        flip: FLIP's false colours for both, sRGB, shape (H, W, 3) uint8; None without the package.
        efficiency: ratio to the baseline, shape (H, W); None for the baseline itself.
        allocation: shape (H, W, S); None where nothing was learned.
        strategies: the S names.
        next_event: as balance_map has it.
        denoised: the denoised picture at equal time, linear Rec.709, shape (H, W, 3); None without denoising.
        denoised_flip: FLIP's false colours for it, as in `flip`.
    """

    label: str
    equal_time: NDArray[np.floating]
    equal_samples: NDArray[np.floating] | None
    flip: tuple[NDArray[np.uint8] | None, NDArray[np.uint8] | None] = (None, None)
    efficiency: NDArray[np.floating] | None = None
    allocation: NDArray[np.floating] | None = None
    strategies: tuple[str, ...] = ()
    next_event: NDArray[np.floating] | None = None
    denoised: NDArray[np.floating] | None = None
    denoised_flip: NDArray[np.uint8] | None = None

    def balance_map(self) -> NDArray[np.uint8]:
        """The allocation as a picture with its legend, sRGB, shape (rows, columns, 3)."""
        assert self.allocation is not None
        picture = balance_map(self.allocation, self.strategies, self.next_event)
        shares = sample_shares(self.allocation, self.strategies, self.next_event)
        return with_legend(picture, self.strategies, shares)


def report_page(summary: Mapping[str, Any], reference: NDArray[np.floating], pictures: Sequence[MethodPictures]) -> str:
    """The whole HTML file.

    Args:
        summary: as in report.json.
        reference: linear Rec.709, shape (H, W, 3).
        pictures: of the summary's methods, in their order.
    """
    methods = [method for method in summary["methods"] if not method["knob"]]
    flip = any(method["flip"] is not None for method in methods)
    noise = summary["reference"]["relative_error"]
    denoised = any(method["denoised"] is not None for method in methods)
    compared = [shown for shown in pictures if shown.label in {method["label"] for method in methods}]
    return Template(_text("page.html")).substitute(
        style=_text("page.css"),
        script=_text("page.js"),
        gradient=diverging_gradient(),
        title=escape(f"What accuracy costs: {summary['stage']}"),
        stage=escape(summary["stage"]),
        about=escape(_about(summary)),
        verdict=_verdict(methods, summary["baseline"]),
        messages=_messages(summary),
        glance=glance_table(methods, flip),
        denoised=_denoised(methods, flip),
        plot_note=" Hollow points on dotted lines are denoised; nothing is predicted of them." if denoised else "",
        denoised_set=_DENOISED_SET if denoised else "",
        legend=_legend(methods),
        plot=error_plot(methods, summary["targets"], noise),
        times=time_table(methods, summary["targets"]),
        costs=cost_table(methods, escape(summary["baseline"])),
        flip_note="" if flip else "The FLIP view is left out: install the package flip-evaluator to have it.",
        maps="".join(map(_efficiency_map, compared)),
        allocations="".join(map(_allocation_map, compared)),
        sweeps="".join(_sweep(summary, knob, pictures) for knob in _knobs(summary)),
        method_notes=_method_notes(summary),
        # "</" would end the script element that holds the data.
        pixels=json.dumps(_pixels(summary, reference, pictures)).replace("</", "<\\/"),
    )


def _about(summary: Mapping[str, Any]) -> str:
    width, height = summary["resolution"]
    return f"{summary['camera']} · {width} × {height} · {summary['device']}, {summary['threads']} threads"


def _verdict(methods: Sequence[dict[str, Any]], baseline: str) -> str:
    """Who is good enough first, in a sentence or two; methods whose ranges overlap are level."""
    arrivals = {
        method["label"]: next(a for a in method["time_to"] if a["relative_error"] == GOOD_ENOUGH) for method in methods
    }
    times = {label: arrival["seconds"] for label, arrival in arrivals.items() if arrival["seconds"] is not None}
    if not times:
        return f"No method reaches {percent(GOOD_ENOUGH)} error."
    best = min(times, key=lambda label: times[label]["median"])
    level = [label for label in times if label != best and times[label]["low"] <= times[best]["high"]]
    guess = " (predicted)" if arrivals[best]["kind"] == "predicted" else ""
    sentence = (
        f"<b>{escape(best)}</b> is the first to {percent(GOOD_ENOUGH)} error, "
        f"in <b>{seconds_text(times[best]['median'])}</b>{guess}"
    )
    if level:
        sentence += f"; {_listed(level)} {'is' if len(level) == 1 else 'are'} level with it within the spread"
    if best == baseline or baseline in level or baseline not in times:
        return f"{sentence}."
    ratio = ratio_text(times[baseline]["median"] / times[best]["median"])
    theirs = seconds_text(times[baseline]["median"])
    return f"{sentence}. <b>{escape(baseline)}</b> takes {theirs}, {ratio} times as long."


def _listed(labels: Sequence[str]) -> str:
    names = [f"<b>{escape(label)}</b>" for label in labels]
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def _messages(summary: Mapping[str, Any]) -> str:
    lines = [("warning", line) for line in summary["warnings"]] + [("note", line) for line in summary["notes"]]
    return "".join(f'<p class="message {kind}"><b>{kind}</b> {escape(line)}</p>' for kind, line in lines)


def _denoised(methods: Sequence[dict[str, Any]], flip: bool) -> str:
    """The section on denoising; nothing where it was not asked for."""
    if all(method["denoised"] is None for method in methods):
        return ""
    return (
        f"<section><h2>With and without denoising</h2>{denoised_table(methods, flip)}"
        '<p class="hint">Equal time is as above. Denoising is a part of it, so there are fewer samples in the rest. '
        "Where denoising alone takes longer, so does the denoised run. Equal samples are those of the longest run. "
        "A &lt; says that the reference cannot tell a smaller error from none.</p>"
        "</section>"
    )


def _legend(methods: Sequence[dict[str, Any]]) -> str:
    items = "".join(f"<li>{marker(number)}{escape(method['label'])}</li>" for number, method in enumerate(methods))
    if any(method["denoised"] is not None for method in methods):
        items += f'<li class="hollow">{marker(0)}denoised, in each method\'s colour</li>'
    return f'<ul class="legend">{items}</ul>'


def _knobs(summary: Mapping[str, Any]) -> list[str]:
    return list(dict.fromkeys(method["knob"] for method in summary["methods"] if method["knob"]))


def _sweep(summary: Mapping[str, Any], knob: str, pictures: Sequence[MethodPictures]) -> str:
    methods = [method for method in summary["methods"] if method["knob"] == knob]
    labels = {method["label"] for method in methods}
    maps = "".join(_allocation_map(shown) + _efficiency_map(shown) for shown in pictures if shown.label in labels)
    targets = summary["targets"]
    return (
        f"<section><h2>What {escape(knob)} costs and buys</h2>{_legend(methods)}"
        f"<figure>{error_plot(methods, targets, summary['reference']['relative_error'])}</figure>"
        f"{glance_table(methods, flip=False)}{time_table(methods, targets)}"
        f"{cost_table(methods, escape(summary['baseline']))}"
        f'<div class="maps">{maps}</div></section>'
    )


def _allocation_map(method: MethodPictures) -> str:
    if method.allocation is None or method.allocation.shape[-1] > 3:
        return ""
    return _card(method.balance_map(), method, "learned share of the samples of each strategy")


def _efficiency_map(method: MethodPictures) -> str:
    if method.efficiency is None:
        return ""
    return _card(ratio_map(method.efficiency), method, "efficiency over the baseline's")


def _card(picture: NDArray[np.uint8], method: MethodPictures, text: str) -> str:
    caption = f"<b>{escape(method.label)}</b>: {text}"
    return f'<figure><img src="{png_uri(picture)}" alt=""><figcaption>{caption}</figcaption></figure>'


def _method_notes(summary: Mapping[str, Any]) -> str:
    reference = summary["reference"]
    noise = reference["relative_error"]
    trust = (
        "its own noise is not known"
        if noise is None
        else f"its own noise is {percent(noise)}, subtracted from all errors"
    )
    seconds = f" in {seconds_text(reference['seconds'])}" if reference["seconds"] else ""
    lines = [
        f"Reference: {escape(reference['source'])}{seconds}; {trust}.",
        f"{summary['repeats']} repetitions of every run with seeds from {summary['seed']} on, all methods in turns; "
        "medians with their range.",
        f"Equal time: as long as {escape(summary['baseline'])} takes for {summary['spp']} samples per pixel, "
        f"{seconds_text(summary['equal_seconds']['median'])}.",
        f"{escape(summary['machine'])}; warpmis {escape(summary['version'])}; up to {summary['max_depth']} bounces.",
    ]
    return "".join(f"<li>{line}</li>" for line in lines)


def _pixels(
    summary: Mapping[str, Any], reference: NDArray[np.floating], pictures: Sequence[MethodPictures]
) -> dict[str, Any]:
    """The pictures for the script, which exposes and subtracts them."""
    images: list[dict[str, Any]] = [{"label": "reference", "set": "all", "data": packed(reference), "flip": None}]
    told = {method["label"]: method for method in summary["methods"]}
    for method in pictures:
        numbers = told[method.label]
        versions = [
            ("time", method.equal_time, method.flip[0], numbers["equal_time"]),
            ("samples", method.equal_samples, method.flip[1], numbers["runs"][-1]),
        ]
        if numbers["denoised"] is not None:
            versions.append(("denoised", method.denoised, method.denoised_flip, numbers["denoised"]["equal_time"]))
        for name, image, flip, point in versions:
            if image is not None:
                seconds = point["seconds"]["median"]
                parts = (error_text(point), f"{point['spp']} spp", seconds_text(seconds))
                about = " · ".join(part.replace(" ", "\N{NO-BREAK SPACE}") for part in parts)
                uri = None if flip is None else png_uri(flip)
                images.append({"label": method.label, "set": name, "about": about, "data": packed(image), "flip": uri})
    width, height = summary["resolution"]
    return {"width": width, "height": height, "exposure": exposure_for(reference), "images": images}


def _text(name: str) -> str:
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")
