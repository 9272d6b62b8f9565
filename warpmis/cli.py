"""The command line: arguments to settings, settings to a render, and what is said about it.

The only module that prints or exits. Standard output carries results alone (--json); everything else goes to
standard error. What takes long to import is imported once it is needed, so that --help answers at once.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import warpmis
from warpmis.config import DEFAULT_STRATEGIES, STRATEGIES, LearnConfig, RenderConfig
from warpmis.errors import ConfigError, WarpmisError
from warpmis.methods import METHODS

if TYPE_CHECKING:
    from warpmis.progress import Progress
    from warpmis.result import RenderResult

EXIT_DONE = 0
EXIT_ERROR = 1
EXIT_USAGE = 2
EXIT_INTERRUPTED = 130  # 128 + SIGINT, as a shell reports it

PURPOSES = ("default", "render", "proxy", "guide")
COMPLEXITIES = ("low", "medium", "high", "veryhigh")


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return the exit status; never raises but argparse's SystemExit."""
    arguments = _parser().parse_args(argv)
    try:
        _render(arguments)
    except ConfigError as error:
        return _fail(str(error), EXIT_USAGE)
    except WarpmisError as error:
        return _fail(str(error), EXIT_ERROR)
    except KeyboardInterrupt:
        return _fail("interrupted", EXIT_INTERRUPTED)
    except Exception as error:
        if os.environ.get("WARPMIS_TRACEBACK") == "1":
            traceback.print_exc()
        hint = "run with WARPMIS_TRACEBACK=1 for the traceback"
        return _fail(f"internal error: {type(error).__name__}: {error} ({hint})", EXIT_ERROR)
    return EXIT_DONE


# ---- arguments --------------------------------------------------------------------------------------------------


def _parser() -> argparse.ArgumentParser:
    # No abbreviations: a script must not break when an option is added.
    parser = argparse.ArgumentParser(prog="warpmis", description="Render OpenUSD stages.", allow_abbrev=False)
    parser.add_argument("--version", action="version", version=f"warpmis {warpmis.__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    render = commands.add_parser("render", help="render one image", description="Render one image.", allow_abbrev=False)
    render.add_argument("stage", metavar="STAGE", help="a USD file")
    render.add_argument("out", metavar="OUT.exr", nargs="?", help="default: the stage's name + .exr in this folder")
    _add_stage_options(render)
    _add_render_options(render)
    _add_learn_options(render)
    _add_output_options(render)
    return parser


def _add_stage_options(parser: argparse.ArgumentParser) -> None:
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
    group.add_argument("--method", metavar="NAME", help=f"of {', '.join(METHODS)} ({default.method})")
    group.add_argument(
        "--strategies", type=_names, metavar="A,B", help=f"of {', '.join(STRATEGIES)} ({','.join(default.strategies)})"
    )
    group.add_argument(
        "--allocation", type=_shares, metavar="A,B", help="for --method fixed: each strategy's share, such as 0.5,0.5"
    )
    group.add_argument(
        "--max-depth", type=int, metavar="N", help=f"bounces: 0 emission alone, 1 direct light ({default.max_depth})"
    )
    group.add_argument("--seed", type=int, metavar="N", help=f"the same seed gives the same image ({default.seed})")
    group.add_argument("--device", metavar="NAME", help=f"cpu or cuda:0 ({default.device})")
    group.add_argument("--threads", type=int, metavar="N", help="CPU threads (as many as this process may use)")


def _add_learn_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("how to learn the allocation (--method murray20)")
    group.add_argument("--learn-rounds", type=int, metavar="N", help="rounds, one step each (from --spp)")
    group.add_argument("--learn-spp", type=int, metavar="N", help="samples per pixel a round (half of --spp in all)")
    group.add_argument("--initial-allocation", type=_shares, metavar="A,B", help="shares at the start (equal)")


def _add_output_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("what to write")
    group.add_argument("--png", metavar="FILE.png", help="also write the image as a PNG, to look at")
    group.add_argument("--balance-map", metavar="FILE.png", help="also write the allocation: red BSDF, blue lights")
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


def _given(**options: Any) -> dict[str, Any]:
    """The options that were given: what was not is left to the stage and the defaults."""
    return {name: value for name, value in options.items() if value is not None}


def _config(arguments: argparse.Namespace) -> RenderConfig:
    learn = LearnConfig(
        **_given(
            rounds=arguments.learn_rounds,
            spp=arguments.learn_spp,
            initial_allocation=arguments.initial_allocation,
        )
    )
    return RenderConfig(
        learn=learn,
        **_given(
            width=arguments.image_width,
            spp=arguments.spp,
            method=arguments.method,
            strategies=arguments.strategies,
            allocation=arguments.allocation,
            max_depth=arguments.max_depth,
            seed=arguments.seed,
            device=arguments.device,
            threads=arguments.threads,
        ),
    )


def _targets(arguments: argparse.Namespace) -> dict[str, str]:
    """The files to write, by what they are, every one of which can be written."""
    from warpmis.output.atomic import check_target

    out = arguments.out or f"{Path(arguments.stage).stem}.exr"
    targets = _given(output=out, png=arguments.png, balance_map=arguments.balance_map)
    for kind, path in targets.items():
        suffix = ".exr" if kind == "output" else ".png"
        if Path(path).suffix.lower() != suffix:
            remedy = "; use --png for a picture" if kind == "output" else ""
            raise ConfigError(f"{path}: the file's name must end in {suffix}{remedy}")
    if len({os.path.realpath(path) for path in targets.values()}) < len(targets):
        raise ConfigError("--png and --balance-map name the same file; name two")
    for path in targets.values():
        check_target(path)
    return targets


# ---- the command ------------------------------------------------------------------------------------------------


def _render(arguments: argparse.Namespace) -> None:
    config = _config(arguments)
    targets = _targets(arguments)
    stage_options = _given(
        camera=arguments.camera,
        purposes=arguments.purposes,
        render_settings=arguments.render_settings_prim_path,
        complexity=arguments.complexity,
        variants=arguments.variant,
        mask=arguments.mask,
        session_layer=arguments.session_layer,
    )
    _start_warp()
    start = time.perf_counter()
    with _progress_bar(quiet=arguments.quiet) as show:
        result = warpmis.render(arguments.stage, config=config, progress=show, **stage_options)
    _write(result, targets)
    if not arguments.quiet:
        _say_messages(result)
        _say(_summary(result, config, targets["output"], time.perf_counter() - start))
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
        print(json.dumps(_plain(report), allow_nan=False))


def _start_warp() -> None:
    """Initialise Warp without its chatter.

    It tells of its devices and of every kernel it loads on standard output, which is for --json alone, and its native
    half warns of a missing CUDA driver, which most machines have no use for, on the process's standard error.
    """
    import warp as wp

    wp.config.log_level = wp.LOG_ERROR
    stderr = os.dup(2)
    with tempfile.TemporaryFile() as heard:
        os.dup2(heard.fileno(), 2)
        try:
            wp.init()
        finally:
            os.dup2(stderr, 2)
            os.close(stderr)
        heard.seek(0)
        for line in heard.read().decode(errors="replace").splitlines():
            if "Could not find or load the NVIDIA CUDA driver" not in line:
                _say(line)


def _write(result: RenderResult, targets: Mapping[str, str]) -> None:
    from warpmis.output.balance_map import balance_map, with_legend
    from warpmis.output.png import write_display_png, write_png

    result.write(targets["output"])
    if "png" in targets:
        write_png(targets["png"], result.image)
    if "balance_map" in targets:
        picture = balance_map(result.allocation, result.strategies)
        write_display_png(targets["balance_map"], with_legend(picture, result.strategies))


def _plain(value: Any) -> Any:
    """`value` as JSON can say it: NumPy numbers as Python's, infinite ones and NaN, which JSON lacks, as null."""
    if isinstance(value, Mapping):
        return {str(name): _plain(item) for name, item in value.items()}
    if hasattr(value, "tolist"):  # NumPy arrays and scalars
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


# ---- what is said -----------------------------------------------------------------------------------------------


def _say(line: str) -> None:
    print(f"warpmis: {' '.join(line.split())}", file=sys.stderr)  # one line, whatever a library put in its message


def _fail(message: str, status: int) -> int:
    _say(f"error: {message}")
    return status


def _distinct(lines: Sequence[str]) -> list[str]:
    return list(dict.fromkeys(lines))


def _say_messages(result: RenderResult) -> None:
    for line in _distinct(result.warnings):
        _say(f"warning: {line}")
    for line in _distinct(result.notes):
        _say(f"note: {line}")


def _summary(result: RenderResult, config: RenderConfig, out: str, seconds: float) -> str:
    height, width, _ = result.image.shape
    phases = result.stats["seconds"]
    tracing = phases.get("learn", 0.0) + phases.get("render", 0.0)
    speed = _speed(result.stats["samples"], tracing)
    return f"{out}: {width} x {height}, {config.spp} spp, {seconds:.1f} s, {speed}"


def _speed(samples: int, seconds: float) -> str:
    return f"{samples / max(seconds, 1e-9) / 1e6:.2f} Msamples/s"


@contextmanager
def _progress_bar(*, quiet: bool) -> Iterator[Callable[[Progress], None] | None]:
    """A bar on a terminal; None, so that nothing is shown, anywhere else."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TextColumn("{task.fields[speed]}"),
        TimeRemainingColumn(),
    )
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("load", total=None, speed="")

        def show(progress: Progress) -> None:
            bar.update(
                task,
                description=f"{progress.phase} {progress.detail}".strip(),
                completed=progress.done,
                total=progress.total or None,  # unknown: the bar swings
                speed=_speed(progress.samples, progress.seconds) if progress.samples else "",
            )

        yield show
