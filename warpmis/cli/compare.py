"""`warpmis compare`: which methods, how long, and the short table of what came out."""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Mapping, Sequence
from typing import Any

import warpmis
from warpmis.cli.console import progress_bar, say, start_warp
from warpmis.cli.option_values import time_in_seconds, whole_number
from warpmis.cli.stage_options import add_stage_options, given, stage_options
from warpmis.cli.streams import print_result
from warpmis.compare.variants import KNOBS, Variant, chosen_variants, default_variants, swept
from warpmis.config import RenderConfig
from warpmis.errors import ConfigError

# Wide enough to look at, small enough to be through within minutes.
DEFAULT_WIDTH = 256
DEFAULT_SECONDS = 200.0
DEFAULT_REPEATS = 3

DESCRIPTION = """Render a stage by several methods and report how long each takes to reach a given accuracy. Writes
DIR/report.html, report.json and all pictures."""


def add_parser(commands: Any) -> None:
    """Add the command to what `add_subparsers` returned, whose type argparse keeps private."""
    parser = commands.add_parser(
        "compare", help="find the method that is accurate first", description=DESCRIPTION, allow_abbrev=False
    )
    parser.add_argument("stage", metavar="STAGE", help="the USD file to render")
    parser.add_argument("-o", "--out", metavar="DIR", required=True, help="the folder to write; created if missing")
    add_stage_options(parser)
    _add_comparison_options(parser)
    _add_common_options(parser)
    group = parser.add_argument_group("what to print")
    group.add_argument("--json", action="store_true", help="print report.json instead of the table")
    group.add_argument("--quiet", action="store_true", help="print errors only")
    parser.set_defaults(run=run)


def _add_comparison_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("what to compare")
    group.add_argument(
        "--method", action="append", metavar="NAME", dest="methods",
        help='a method, or one with its strategies such as "murray20 bsdf,light" (repeatable); always with balance '
        f"(default: {'; '.join(one.label for one in default_variants())})",
    )  # fmt: skip
    group.add_argument(
        "--sweep", action="append", type=_sweep, metavar="NAME=A,B", default=[],
        help=f"also run the default method with each value of one setting: {', '.join(KNOBS)} (repeatable)",
    )  # fmt: skip
    group.add_argument(
        "--denoise", action="store_true", help="also measure every method with denoising (needs Open Image Denoise)"
    )
    group.add_argument("--reference", metavar="FILE.exr", help="the reference picture (default: rendered by balance)")
    group.add_argument(
        "--reference-spp",
        type=whole_number,
        metavar="N",
        help="samples per pixel of a rendered reference (default: 16 x --spp)",
    )
    group.add_argument(
        "--spp",
        type=whole_number,
        metavar="N",
        help="samples per pixel of the longest runs (default: from --time-limit)",
    )
    group.add_argument(
        "--time-limit",
        type=time_in_seconds,
        metavar="SECONDS",
        help=f"approximate time for the whole comparison (default: {DEFAULT_SECONDS:g})",
    )
    group.add_argument("--repeats", type=whole_number, metavar="N", help=f"repetitions (default: {DEFAULT_REPEATS})")


def _add_common_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("settings of all renders")
    default = RenderConfig()
    group.add_argument(
        "--max-depth",
        type=whole_number,
        metavar="N",
        help=f"bounces (default: {default.max_depth})",
    )
    group.add_argument("--seed", type=whole_number, metavar="N", help=f"random seed (default: {default.seed})")
    group.add_argument("--device", metavar="NAME", help=f"cpu or cuda:0 (default: {default.device})")
    group.add_argument(
        "--threads", type=whole_number, metavar="N", help="CPU threads (default: all that this process may use)"
    )


def _sweep(text: str) -> list[Variant]:
    knob, _, values = text.partition("=")
    try:
        return swept(knob.strip(), [int(value) for value in values.split(",")])
    except ConfigError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    except ValueError:
        raise argparse.ArgumentTypeError(f"'{text}' is not NAME=A,B such as max-depth=2,4,8") from None


def run(arguments: argparse.Namespace) -> None:
    variants = chosen_variants(arguments.methods) if arguments.methods else default_variants()
    variants += [variant for sweep in arguments.sweep for variant in sweep]
    settings = _settings(arguments)
    from warpmis.compare.write import REPORT, make_folder, write_comparison

    folder = make_folder(arguments.out)
    start_warp()
    from warpmis.compare.measure import Settings, run_experiment
    from warpmis.compare.partial import keep_measured

    sized = arguments.image_width is not None or arguments.image_height is not None
    width = arguments.image_width if sized else DEFAULT_WIDTH
    asked = Settings(**settings)
    with progress_bar(quiet=arguments.quiet) as show:
        scene = warpmis.load_stage(arguments.stage, width=width, **stage_options(arguments))
        experiment = run_experiment(scene, variants, asked, show)
    if experiment.is_interrupted:
        lines = keep_measured(experiment.measurements)
        if not lines:
            raise KeyboardInterrupt
        experiment.left_out += lines
    summary = write_comparison(experiment, arguments.stage, folder)
    if not arguments.quiet:
        for kind in ("warnings", "notes"):
            for line in summary[kind]:
                say(f"{kind[:-1]}: {line}")
    if arguments.json:
        print_result(json.dumps(summary, allow_nan=False))
    elif not arguments.quiet:
        _print_table(summary)
        say(f"{os.path.join(arguments.out, REPORT)}")
    if experiment.is_interrupted:
        raise KeyboardInterrupt


def _settings(arguments: argparse.Namespace) -> dict[str, Any]:
    """What Settings is built of; --time-limit and --spp exclude each other."""
    if arguments.time_limit is not None and arguments.spp is not None:
        raise ConfigError("--time-limit finds the samples per pixel, --spp sets them; give one of the two")
    if arguments.reference is not None and arguments.reference_spp is not None:
        raise ConfigError("--reference names a finished picture, --reference-spp renders one; give one of the two")
    common = given(max_depth=arguments.max_depth, device=arguments.device, threads=arguments.threads)
    return {
        "common": common,
        "denoise": arguments.denoise,
        **given(
            seed=arguments.seed,
            repeats=arguments.repeats,
            spp=arguments.spp,
            seconds=arguments.time_limit,
            reference=arguments.reference,
            reference_spp=arguments.reference_spp,
        ),
    }


def _print_table(summary: Mapping[str, Any]) -> None:
    """Efficiency, error at equal time, and the time to each error; predictions with a sign of approximation."""
    from rich.console import Console
    from rich.table import Table

    from warpmis.output.report.text import error_text, percent, ratio_text, seconds_text

    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column("method")
    for heading in ("efficiency", "error", *(f"to {percent(target)}" for target in summary["targets"])):
        table.add_column(heading, justify="right", no_wrap=True)
    rows = [(method, method["label"]) for method in summary["methods"]]
    rows = [both for one, label in rows for both in ((one, label), (one["denoised"], "  denoised"))]
    for row, label in rows:
        if row is not None:
            efficiency, error = ratio_text(row["efficiency"]["median"]), error_text(row["equal_time"])
            table.add_row(label, efficiency, error, *_arrivals(row["time_to"], seconds_text))
    Console().print(table)


def _arrivals(arrivals: Sequence[Mapping[str, Any]], text: Any) -> list[str]:
    sign = {"measured": "", "predicted": "~", "sooner": "<", "later": ">"}
    return ["never" if a["kind"] == "never" else f"{sign[a['kind']]}{text(a['seconds']['median'])}" for a in arrivals]
