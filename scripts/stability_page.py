"""The page docs/stability.md: every hard case, what breaks in the naive form, what is done about it, what was measured:

    python scripts/bench/hard_cases.py --json hard.json
    python scripts/stability_page.py hard.json -o docs/stability.md

Each case is rendered by several methods here; hard.json adds how learning fares on it.
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

import warpmis
from warpmis.config import DEFAULT_STRATEGIES

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from hard import naive
from hard.case import HardCase
from hard.checks import luminance, scene_of, spread, standard_error
from hard.every import effects_of
from hard.learning_cases import REFUSED_MAPS, lit_floor
from hard.naive_forms import NAIVE_FORMS
from hard.test_accumulation import accumulated, hard_samples, reference
from usd.stages import stage_of

SECTIONS = {
    "light_cases": ("Light", "LIGHT_CASES"),
    "material_cases": ("Material", "MATERIAL_CASES"),
    "glass_cases": ("Glass", "GLASS_CASES"),
    "geometry_cases": ("Geometry", "GEOMETRY_CASES"),
    "learning_cases": ("Learning", "LEARNING_CASES"),
}
METHODS = ("nee", "balance", "murray20", "auto")
HEAD = """# Stability

Hard cases render right: no value of a picture, its variance, its shares or its AOVs is NaN or infinite, and no sample
was rejected, except where a table says otherwise. Every case is a stage of `tests/hard/`, made by code, with the
picture that it must give. {device}

The columns:

- *naive*: what a first version does wrong.
- *instead*: what warpmis does, and its source.
- *measured*: the mean luminance against the closed form, in standard errors (z). Where there is no closed form, the
  methods are compared with each other. Methods are `nee`, `balance`, `murray20` and `auto` unless named.
- *variance*: the variance of `murray20` and of `auto`, over that with `balance`. Below 1, learning wins. Each has 256
  samples per pixel in all, learning included (`scripts/bench/hard_cases.py`, which also states how sure that is).

`scripts/stability_page.py` makes this page from the same lists as the tests.
"""
LIMITS = """## Limits

- The variance of a pixel is stored in float32: it ends at 3.4e38, and is 0 below 1e-45. So radiances beyond 1e19 or
  below 1e-22 have no meaningful `variance`, `relative_error()` or `excess_variance_bound`. The picture and the shares
  are still right, bit for bit (`tests/hard/test_learning.py`).
- One light is found by one sample in ten thousand, and another one by every sample. No learner can know of the first
  from a few hundred samples. Shares given to the other cost up to 0.5 / 0.1 of the variance. The case is in the table.
- For three strategies and more, `murray20` keeps 0.01 of each share and then scales their sum to at most 0.9, as
  published. So a share may end a little below 0.01.
"""


# ---- one case -------------------------------------------------------------------------------------------------------


def methods_of(case: HardCase) -> tuple[str, ...]:
    if "method" in case.settings:
        return (case.settings["method"],)
    if case.settings.get("strategies", DEFAULT_STRATEGIES) != DEFAULT_STRATEGIES:
        return ("balance", "murray20")
    return ("murray20",) if "learn_rounds" in case.settings else METHODS


def flaws(result: warpmis.RenderResult) -> list[str]:
    """What the page promises not to be there."""
    found = [f"{name} not finite" for name, picture in result.channels().items() if not np.isfinite(picture).all()]
    if result.stats["rejected_samples"]:
        found.append(f"{result.stats['rejected_samples']} samples rejected")
    return found


def measured(case: HardCase, results: Mapping[str, warpmis.RenderResult]) -> str:
    """The means in standard errors, and whatever is not as it should be."""
    means = {name: float(luminance(result.image).mean()) for name, result in results.items()}
    error = standard_error if case.mean is None else spread
    errors = {name: error(result) for name, result in results.items()}
    wrong = sorted({flaw for result in results.values() for flaw in flaws(result)})
    refused = [line.partition(": ")[2] for line in next(iter(results.values())).warnings if "left out" in line]
    names = "" if tuple(results) == METHODS else f" ({', '.join(f'`{name}`' for name in results)})"
    if case.mean is None:
        pairs = itertools.combinations(results, 2)
        apart = [z(means[a] - means[b], np.hypot(errors[a], errors[b]), means[a]) for a, b in pairs]
        said = f"mean {np.mean(list(means.values())):.4g}, methods apart by z = {max(apart, default=0.0):.1f} at most"
    else:
        expected = float(luminance(np.array(case.mean)))
        worst = max(z(means[name] - expected, errors[name], expected) for name in results)
        said = f"{expected:.4g} within z = {worst:.1f}" if expected else f"{max(means.values()):g}"
    return "; ".join([said + names, *(f"refused: {line}" for line in refused), *wrong])


def z(apart: float, error: float, scale: float) -> float:
    """Rounding of float32, 2e-5 of the mean, counts as one standard error, as in the tests."""
    return abs(apart) / max(float(np.hypot(error, 2e-5 * abs(scale))), 1e-300)


def row(case: HardCase, features: Any, learning: Mapping[tuple[str, str], Mapping[str, Any]]) -> str:
    settings = {"spp": 64, "max_depth": 2, **case.settings}
    settings.pop("method", None)
    results = {
        method: warpmis.render(scene_of(case), method=method, features=features, **settings)
        for method in methods_of(case)
    }
    trouble = case.trouble
    if case.name in naive.SAMPLES:
        trouble += f": {naive.outcome(case.name, naive=True)}"
    return table_row(case.name, trouble, case.remedy, measured(case, results), variance_text(case.name, learning))


def variance_text(name: str, learning: Mapping[tuple[str, str], Mapping[str, Any]]) -> str:
    found = [learning.get((name, method)) for method in ("murray20", "auto")]
    return ", ".join("–" if one is None else ratio_text(one) for one in found) if any(found) else ""


def ratio_text(one: Mapping[str, Any]) -> str:
    text = f"{one['ratio']:.2f}"
    return {"loses": f"**{text}**", "open": f"{text}?"}.get(one["verdict"], text)


def table_row(*cells: str) -> str:
    return "| " + " | ".join(" ".join(cell.split()).replace("|", "\\|") for cell in cells) + " |"


# ---- sections -------------------------------------------------------------------------------------------------------


def section(title: str, found: Sequence[HardCase], features: Any, learning: Mapping[Any, Any]) -> list[str]:
    lines = [f"## {title}", "", table_row("case", "naive", "instead", "measured", "variance"), "|---|---|---|---|---|"]
    return [*lines, *(row(case, features, learning) for case in found), ""]


def accumulation() -> list[str]:
    """Four million samples of one pixel."""
    lines = ["## Accumulation", ""]
    lines += [
        "Relative errors of mean and variance after 4,000,000 samples in six rounds, against two passes in float64.",
        "",
    ]
    lines += [table_row("samples", "naive: E[x^2] - E[x]^2, in float64", "instead: Welford (1962), Chan et al. (1983)")]
    lines += ["|---|---|---|"]
    for name, samples in hard_samples().items():
        ours, theirs = (
            np.abs(accumulated(samples[None], naive=form) / reference(samples[None]) - 1.0)[0] for form in (False, True)
        )
        texts = (f"mean {mean:.0e}, variance {variance:.0e}" for mean, variance in (theirs, ours))
        lines.append(table_row(name, *texts))
    return [*lines, "", "Films merge in any order and grouping to 1e-9 (`tests/hard/test_properties.py`).", ""]


def naive_forms() -> list[str]:
    """Formulas in float32, beside the forms that the kernels have."""
    lines = ["## Formulas", "", "Largest relative errors in float32.", "", table_row("formula", "naive", "instead")]
    lines.append("|---|---|---|")
    for name, errors in NAIVE_FORMS.items():
        lines.append(table_row(name, *(f"{error:.0e}" for error in errors())))
    return [*lines, ""]


def refusals() -> list[str]:
    """Allocation maps that no render takes."""
    lines = ["## Refused", "", table_row("allocation map", "message"), "|---|---|"]
    for name, (allocation, _) in REFUSED_MAPS.items():
        try:
            warpmis.render(stage_of(lit_floor()), method="fixed", allocation=allocation)
            said = "**taken**"
        except warpmis.WarpmisError as error:
            said = str(error)
        lines.append(table_row(name, said))
    return [*lines, ""]


def learning_line(rows: Sequence[Mapping[str, Any]]) -> str:
    """How often each method that learns never loses, and why one of them does."""
    lines = []
    for method in dict.fromkeys(row["method"] for row in rows):
        own = [row for row in rows if row["method"] == method]
        count = {word: sum(row["verdict"] == word for row in own) for word in ("never loses", "open", "loses")}
        lines.append(
            f"- `{method}` has at most 1.1 times the variance of `balance` in {count['never loses']} of {len(own)} "
            f"cases, at 99 % confidence. {count['loses']} have more (bold), {count['open']} could not be decided (?).\n"
        )
    reason = """
As published, `murray20` spends half of the samples in rounds of their own. Each round has a lattice of its own, and
short lattices leave more noise than a long one. Where equal shares are near the best, that is a loss.
"""
    return "".join(lines) + reason


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("learning", type=Path, help="what scripts/bench/hard_cases.py --json wrote")
    parser.add_argument("-o", dest="out", type=Path, required=True, help="the page")
    parser.add_argument("--device", default="CPU; not yet seen on a GPU", help="what to say of the machine")
    arguments = parser.parse_args()
    rows = json.loads(arguments.learning.read_text())
    learning = {(one["case"], one["method"]): one for one in rows}
    lines = [HEAD.format(device=f"Measured on a {arguments.device}."), learning_line(rows)]
    for module, (title, name) in SECTIONS.items():
        if any(path.stem == module for path in Path(naive.__file__).parent.glob("*_cases.py")):
            found = vars(import_module(f"hard.{module}"))[name]
            lines += section(title, found, effects_of(map(scene_of, found)), learning)
    page = "\n".join([*lines, *naive_forms(), *accumulation(), *refusals(), LIMITS])
    arguments.out.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
