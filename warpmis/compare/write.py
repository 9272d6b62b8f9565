"""The comparison's folder: report.html, report.json, and every picture as EXR and PNG."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import warpmis
from warpmis.compare.flip import Flip, flip
from warpmis.compare.measure import Experiment, Measurement
from warpmis.compare.reference import Reference
from warpmis.compare.summary import efficiency_map, summarize
from warpmis.errors import WarpmisError
from warpmis.output.atomic import check_target, replacing
from warpmis.output.exr import write_exr
from warpmis.output.png import write_display_png
from warpmis.output.report.page import MethodPictures, report_page
from warpmis.output.report.pixels import ratio_map

REPORT, NUMBERS, REFERENCE = "report.html", "report.json", "reference.exr"

# A balance map mixes three colours at most.
MOST_COLORS = 3


def make_folder(path: str) -> Path:
    """The folder, made if it is not there, writable: found out before hours of measuring."""
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise WarpmisError(f"{path}: cannot be made a folder: {error.strerror}") from error
    check_target(folder / REPORT)
    return folder


def write_comparison(experiment: Experiment, stage: str, folder: Path) -> dict[str, Any]:
    """Write everything, and return what report.json says; `stage` is what the stage is called."""
    summary = summarize(experiment, stage)
    pictures = []
    for number, (measurement, method) in enumerate(zip(experiment.measurements, summary["methods"], strict=True)):
        shown, flips = _pictures(measurement, experiment, is_baseline=number == 0)
        method |= {"files": _write_pictures(measurement, shown, folder), **flips}
        if measurement.denoised is not None:
            shown, flips = _with_denoised(shown, measurement.denoised, experiment.reference)
            method["denoised"] |= {"files": _write_renders(measurement.denoised, folder), **flips}
        pictures.append(shown)
    reference = experiment.reference
    header = {"version": warpmis.__version__, "stage": summary["stage"], "source": reference.source}
    write_exr(folder / REFERENCE, reference.channels(), header)
    summary["files"] = {"report": REPORT, "numbers": NUMBERS, "reference": REFERENCE}
    _write_text(folder / NUMBERS, json.dumps(summary, indent=1, allow_nan=False))
    _write_text(folder / REPORT, report_page(summary, reference.image, pictures))
    return summary


def _pictures(
    measurement: Measurement, experiment: Experiment, *, is_baseline: bool
) -> tuple[MethodPictures, dict[str, float | None]]:
    """What the report shows of a method, and its mean FLIP."""
    first, longest = _results(measurement)
    # A sweep shows its pictures of equal time alone: a file of some megabytes should stay one.
    is_sweep = bool(measurement.variant.knob)
    flips = _flips([first] if is_sweep else [first, longest], experiment.reference)
    shown = MethodPictures(
        label=measurement.variant.label,
        equal_time=first.image,
        equal_samples=None if is_sweep else longest.image,
        flip=(_colors(flips[0]), _colors(flips[1])),
        efficiency=None if is_baseline else efficiency_map(measurement, experiment.measurements[0]),
        allocation=first.allocation if first.stats["seconds"]["learn"] > 0.0 else None,
        strategies=first.strategies,
        next_event=first.next_event,
    )
    return shown, _means(flips)


def _with_denoised(
    shown: MethodPictures, denoised: Measurement, reference: Reference
) -> tuple[MethodPictures, dict[str, float | None]]:
    """The method's pictures and those that were denoised, and the mean FLIP of the latter."""
    first, longest = _results(denoised)
    flips = _flips([first, longest], reference)
    return replace(shown, denoised=first.shown, denoised_flip=_colors(flips[0])), _means(flips)


def _results(measurement: Measurement) -> tuple[warpmis.RenderResult, warpmis.RenderResult]:
    """The first repetitions at equal time and at equal samples."""
    assert measurement.in_equal_time is not None and measurement.longest is not None
    return measurement.in_equal_time.first, measurement.longest.first


def _flips(results: Sequence[warpmis.RenderResult], reference: Reference) -> list[Flip | None]:
    """Of two pictures, None for one that is not there."""
    verdicts = [flip(result.shown, reference.image) for result in results]
    return verdicts + [None] * (2 - len(verdicts))


def _means(flips: Sequence[Flip | None]) -> dict[str, float | None]:
    at_time, at_samples = (None if verdict is None else verdict.mean for verdict in flips)
    return {"flip": at_time, "flip_equal_samples": at_samples}


def _colors(verdict: Flip | None) -> Any:
    return None if verdict is None else verdict.colors


def _stem(label: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", label.lower()).strip("-")


def _write_pictures(measurement: Measurement, shown: MethodPictures, folder: Path) -> dict[str, str]:
    """The files of one method, named after it: its renders and the maps."""
    files = _write_renders(measurement, folder)
    stem = _stem(shown.label)
    if shown.efficiency is not None:
        files["efficiency"] = f"{stem}-efficiency.png"
        write_display_png(folder / files["efficiency"], ratio_map(shown.efficiency))
    if shown.allocation is not None and shown.allocation.shape[-1] <= MOST_COLORS:
        files["allocation"] = f"{stem}-allocation.png"
        write_display_png(folder / files["allocation"], shown.balance_map())
    return files


def _write_renders(measurement: Measurement, folder: Path) -> dict[str, str]:
    """At equal time, and at equal samples (-samples), as EXR and PNG."""
    stem = _stem(measurement.variant.label)
    files = {"equal_time": f"{stem}.exr", "equal_samples": f"{stem}-samples.exr"}
    for kind, result in zip(tuple(files), _results(measurement), strict=True):
        files[f"{kind}_png"] = files[kind].replace(".exr", ".png")
        result.write(folder / files[kind])
        result.write(folder / files[f"{kind}_png"])
    return files


def _write_text(path: Path, text: str) -> None:
    with replacing(path) as temporary:
        Path(temporary).write_text(text, encoding="utf-8")
