"""`warpmis render`: arguments to settings, settings to a render, and what is said about it."""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import warpmis
from warpmis.cli.console import plain, progress_bar, say, speed_text, start_warp
from warpmis.config import STRATEGIES, STRATEGY_CHOICES, LearnConfig, RenderConfig
from warpmis.errors import ConfigError
from warpmis.methods import METHODS

if TYPE_CHECKING:
    from warpmis.result import RenderResult

PURPOSES = ("default", "render", "proxy", "guide")
COMPLEXITIES = ("low", "medium", "high", "veryhigh")


# ---- arguments --------------------------------------------------------------------------------------------------


def add_parser(commands: Any) -> None:
    """Add the command to what `add_subparsers` returned, whose type argparse keeps private."""
    methods = "".join(f"  {name:<12}{method.summary}\n" for name, method in METHODS.items())
    parser = commands.add_parser(
        "render",
        help="render one image",
        description="Render one image.",
        epilog=f"methods:\n{methods}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("stage", metavar="STAGE", help="a USD file")
    parser.add_argument("out", metavar="OUT.exr", nargs="?", help="default: the stage's name + .exr in this folder")
    add_stage_options(parser)
    _add_render_options(parser)
    _add_learn_options(parser)
    _add_output_options(parser)
    parser.set_defaults(run=run)


def add_stage_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("what to render (as in usdrecord)")
    group.add_argument("--camera", "-cam", metavar="PRIM", help="camera prim: its path, or its name if that is unique")
    group.add_argument(
        "--image-width", "--imageWidth", "-w", type=int, metavar="PIXELS", help="height follows from the aspect"
    )
    group.add_argument(
        "--purposes", type=_purposes, metavar="A,B", help=f"of {', '.join(PURPOSES)}; default is always included"
    )
    group.add_argument(
        "--render-settings-prim-path", "--renderSettingsPrimPath", "-rs", metavar="PRIM", help="RenderSettings prim"
    )
    group.add_argument(
        "--complexity", "-c", choices=COMPLEXITIES, help="refine subdivision surfaces 0, 1, 2 or 3 times (high)"
    )
    group.add_argument(
        "--variant", action="append", metavar="/PRIM{SET=VARIANT}", help="select a variant; may be given several times"
    )
    group.add_argument("--mask", type=_names, metavar="/A,/B", help="load these prims alone, and what they refer to")
    group.add_argument("--session-layer", "--sessionLayer", metavar="FILE", help="a layer stronger than the stage")


def _add_render_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("how to render")
    default = RenderConfig()
    group.add_argument("--spp", type=int, metavar="N", help=f"samples per pixel, learning included ({default.spp})")
    group.add_argument("--method", metavar="NAME", help=f"of those below ({default.method})")
    group.add_argument(
        "--strategies", type=_names, metavar="A,B", help=f"of {', '.join(STRATEGIES)} ({','.join(default.strategies)})"
    )
    group.add_argument(
        "--allocation", type=_shares, metavar="A,B", help="for --method fixed: each strategy's share, such as 0.5,0.5"
    )
    group.add_argument(
        "--strategy-choice", metavar="HOW", help=f"{' or '.join(STRATEGY_CHOICES)} ({default.strategy_choice})"
    )
    group.add_argument(
        "--mis-compensation", action="store_true", default=None, help="sample a dome by what it has above its mean"
    )
    group.add_argument(
        "--max-depth", type=int, metavar="N", help=f"bounces: 0 emission alone, 1 direct light ({default.max_depth})"
    )
    group.add_argument("--seed", type=int, metavar="N", help=f"the same seed gives the same image ({default.seed})")
    group.add_argument("--device", metavar="NAME", help=f"cpu or cuda:0 ({default.device})")
    group.add_argument("--threads", type=int, metavar="N", help="CPU threads (as many as this process may use)")


def _add_learn_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("how to learn the allocation")
    group.add_argument("--learn-rounds", type=int, metavar="N", help="rounds, one step each (from --spp)")
    group.add_argument("--learn-spp", type=int, metavar="N", help="samples per pixel a round (from --spp)")
    group.add_argument("--initial-allocation", type=_shares, metavar="A,B", help="shares at the start (equal)")


def _add_output_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("what to write")
    group.add_argument("--png", metavar="FILE.png", help="also write the image as a PNG, to look at")
    group.add_argument("--balance-map", metavar="FILE.png", help="also write the allocation: red BSDF, blue lights")
    group.add_argument("--round-maps", metavar="DIR", help="also write the allocation after each learn round, as PNGs")
    group.add_argument("--json", action="store_true", help="print one JSON object on standard output")
    group.add_argument("--quiet", action="store_true", help="say nothing but errors")


def _names(text: str) -> tuple[str, ...]:
    return tuple(name.strip() for name in text.split(",") if name.strip())


def _purposes(text: str) -> tuple[str, ...]:
    names = _names(text)
    for name in names:
        if name not in PURPOSES:
            raise argparse.ArgumentTypeError(f"unknown purpose '{name}'; choose from {', '.join(PURPOSES)}")
    return names


def _shares(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(share) for share in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"'{text}' is not a list of numbers such as 0.5,0.5") from None


def given(**options: Any) -> dict[str, Any]:
    """The options that were given: what was not is left to the stage and the defaults."""
    return {name: value for name, value in options.items() if value is not None}


def _config(arguments: argparse.Namespace) -> RenderConfig:
    learn = LearnConfig(
        **given(
            rounds=arguments.learn_rounds,
            spp=arguments.learn_spp,
            initial_allocation=arguments.initial_allocation,
            keep_maps=True if arguments.round_maps else None,
        )
    )
    return RenderConfig(
        learn=learn,
        **given(
            width=arguments.image_width,
            spp=arguments.spp,
            method=arguments.method,
            strategies=arguments.strategies,
            allocation=arguments.allocation,
            strategy_choice=arguments.strategy_choice,
            mis_compensation=arguments.mis_compensation,
            max_depth=arguments.max_depth,
            seed=arguments.seed,
            device=arguments.device,
            threads=arguments.threads,
        ),
    )


def stage_options(arguments: argparse.Namespace) -> dict[str, Any]:
    """What `add_stage_options` asked for, but the width, as `warpmis.render` and `load_stage` name it."""
    return given(
        camera=arguments.camera,
        purposes=arguments.purposes,
        render_settings=arguments.render_settings_prim_path,
        complexity=arguments.complexity,
        variants=arguments.variant,
        mask=arguments.mask,
        session_layer=arguments.session_layer,
    )


def _targets(arguments: argparse.Namespace) -> dict[str, str]:
    """The files to write, by what they are, every one of which can be written."""
    from warpmis.output.atomic import check_target

    out = arguments.out or f"{Path(arguments.stage).stem}.exr"
    targets = given(output=out, png=arguments.png, balance_map=arguments.balance_map)
    for kind, path in targets.items():
        suffix = ".exr" if kind == "output" else ".png"
        if Path(path).suffix.lower() != suffix:
            remedy = "; use --png for a picture" if kind == "output" else ""
            raise ConfigError(f"{path}: the file's name must end in {suffix}{remedy}")
    if len({os.path.realpath(path) for path in targets.values()}) < len(targets):
        raise ConfigError("--png and --balance-map name the same file; name two")
    for path in targets.values():
        check_target(path)
    if arguments.round_maps:
        check_target(f"{arguments.round_maps}/round.png")
    return targets


# ---- the command ------------------------------------------------------------------------------------------------


def run(arguments: argparse.Namespace) -> None:
    config = _config(arguments)
    targets = _targets(arguments)
    start_warp()
    start = time.perf_counter()
    with progress_bar(quiet=arguments.quiet) as show:
        result = warpmis.render(arguments.stage, config=config, progress=show, **stage_options(arguments))
    _write(result, targets)
    if arguments.round_maps:
        _write_round_maps(result, arguments.round_maps)
    if not arguments.quiet:
        _say_messages(result)
        say(_summary(result, config, targets["output"], time.perf_counter() - start))
    if arguments.json:
        report = {
            **targets,
            "version": warpmis.__version__,
            "stage": result.name,
            "strategies": result.strategies,
            "settings": result.settings,
            "stats": result.stats,
            "warnings": _distinct(result.warnings),
            "notes": _distinct(result.notes),
        }
        print(json.dumps(plain(report), allow_nan=False))


def _write(result: RenderResult, targets: Mapping[str, str]) -> None:
    from warpmis.output.balance_map import balance_map, with_legend
    from warpmis.output.png import write_display_png, write_png

    result.write(targets["output"])
    if "png" in targets:
        write_png(targets["png"], result.image)
    if "balance_map" in targets:
        picture = balance_map(result.allocation, result.strategies)
        write_display_png(targets["balance_map"], with_legend(picture, result.strategies))


def _write_round_maps(result: RenderResult, folder: str) -> None:
    """One picture a round, numbered from 1, for a film of the convergence."""
    from warpmis.output.balance_map import balance_map
    from warpmis.output.png import write_display_png

    for number, allocation in enumerate(result.round_allocations, start=1):
        write_display_png(f"{folder}/round_{number:04}.png", balance_map(allocation, result.strategies))


# ---- what is said -----------------------------------------------------------------------------------------------


def _distinct(lines: Sequence[str]) -> list[str]:
    return list(dict.fromkeys(lines))


def _say_messages(result: RenderResult) -> None:
    for line in _distinct(result.warnings):
        say(f"warning: {line}")
    for line in _distinct(result.notes):
        say(f"note: {line}")


def _summary(result: RenderResult, config: RenderConfig, out: str, seconds: float) -> str:
    height, width, _ = result.image.shape
    phases = result.stats["seconds"]
    tracing = phases.get("learn", 0.0) + phases.get("render", 0.0)
    speed = speed_text(result.stats["samples"], tracing)
    return f"{out}: {width} x {height}, {config.spp} spp, {seconds:.1f} s, {speed}"
