"""The comparison's folder: report.html, report.json, and every picture as EXR and PNG."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import warpmis
from warpmis.compare.flip import Flip, flip
from warpmis.compare.measure import Experiment, Measurement
from warpmis.compare.summary import efficiency_map, summarize
from warpmis.errors import WarpmisError
from warpmis.output.atomic import check_target, replacing
from warpmis.output.exr import write_exr
from warpmis.output.png import write_display_png, write_png
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
    for number, measurement in enumerate(experiment.measurements):
        shown, mean = _pictures(measurement, experiment, is_baseline=number == 0)
        summary["methods"][number] |= {"flip": mean, "files": _write_pictures(measurement, shown, folder)}
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
) -> tuple[MethodPictures, float | None]:
    """What the report shows of a method, and its mean FLIP at equal time."""
    assert measurement.in_equal_time is not None and measurement.longest is not None
    first, longest = measurement.in_equal_time.first, measurement.longest.first
    truth = experiment.reference.image
    # A sweep shows its pictures of equal time alone: a file of some megabytes should stay one.
    images = [first.image] if measurement.variant.knob else [first.image, longest.image]
    flips: list[Flip | None] = [flip(image, truth) for image in images] + [None]
    shown = MethodPictures(
        label=measurement.variant.label,
        equal_time=first.image,
        equal_samples=None if measurement.variant.knob else longest.image,
        flip=(_colors(flips[0]), _colors(flips[1])),
        efficiency=None if is_baseline else efficiency_map(measurement, experiment.measurements[0]),
        allocation=first.allocation if first.stats["seconds"]["learn"] > 0.0 else None,
        strategies=first.strategies,
        next_event=first.next_event,
    )
    return shown, None if flips[0] is None else flips[0].mean


def _colors(verdict: Flip | None) -> Any:
    return None if verdict is None else verdict.colors


def _write_pictures(measurement: Measurement, shown: MethodPictures, folder: Path) -> dict[str, str]:
    """The files of one method, named after it: at equal time, at equal samples (-samples), and the maps."""
    assert measurement.in_equal_time is not None and measurement.longest is not None
    stem = re.sub(r"[^a-z0-9]+", "-", shown.label.lower()).strip("-")
    files = {"equal_time": f"{stem}.exr", "equal_samples": f"{stem}-samples.exr"}
    measurement.in_equal_time.first.write(folder / files["equal_time"])
    measurement.longest.first.write(folder / files["equal_samples"])
    for kind in ("equal_time", "equal_samples"):
        result = measurement.in_equal_time.first if kind == "equal_time" else measurement.longest.first
        files[f"{kind}_png"] = files[kind].replace(".exr", ".png")
        write_png(folder / files[f"{kind}_png"], result.image)
    if shown.efficiency is not None:
        files["efficiency"] = f"{stem}-efficiency.png"
        write_display_png(folder / files["efficiency"], ratio_map(shown.efficiency))
    if shown.allocation is not None and shown.allocation.shape[-1] <= MOST_COLORS:
        files["allocation"] = f"{stem}-allocation.png"
        write_display_png(folder / files["allocation"], shown.balance_map())
    return files


def _write_text(path: Path, text: str) -> None:
    with replacing(path) as temporary:
        Path(temporary).write_text(text, encoding="utf-8")
