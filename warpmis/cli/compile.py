"""`warpmis compile`: a stage's kernels into Warp's cache, ahead of the render."""

from __future__ import annotations

import argparse
import json
import sys
from typing import Any

import warpmis
from warpmis.cli.console import plain, progress_bar, say, start_warp
from warpmis.cli.render import (
    add_kernel_options,
    forced_features,
    kernel_options,
    methods_epilog,
)
from warpmis.cli.stage_options import add_stage_options, stage_options
from warpmis.cli.streams import print_result
from warpmis.config import DEFAULT_STRATEGIES, RenderConfig

DESCRIPTION = """Compile the kernels that `render` needs with the same options, without rendering. Use it to fill Warp's
cache (WARP_CACHE_PATH) before the first render, or in an image on a build machine. Kernels for a CPU are made for the
kind of CPU that compiles them."""


def add_parser(commands: Any) -> None:
    """Add the command to what `add_subparsers` returned, whose type argparse keeps private."""
    parser = commands.add_parser(
        "compile",
        help="compile a stage's kernels before the first render",
        description=DESCRIPTION,
        epilog=methods_epilog(),
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("stage", metavar="STAGE", help="the USD file to read")
    add_stage_options(parser)
    add_kernel_options(parser.add_argument_group("how it will be rendered"))
    group = parser.add_argument_group("what to print")
    group.add_argument("--json", action="store_true", help="print one JSON object on standard output")
    group.add_argument("--quiet", action="store_true", help="print errors only")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    options = kernel_options(arguments)
    if options.get("method") == "fixed":  # whatever the shares will be
        count = len(options.get("strategies", DEFAULT_STRATEGIES))
        options["allocation"] = (1.0 / max(count, 1),) * count
    config = RenderConfig(**options)
    start_warp()
    from warpmis.device.kernel_cache import check_cache
    from warpmis.rendering.specialise import compile_scene

    check_cache()
    scene = warpmis.load_stage(arguments.stage, width=arguments.image_width, **stage_options(arguments))
    with progress_bar(quiet=arguments.quiet or not sys.stderr.isatty()) as show:
        done = compile_scene(scene, config, forced_features(arguments), show)
    if not arguments.quiet:
        say(f"{scene.name}: {done.compiled} kernels compiled in {done.seconds:.1f} s, {done.cached} were in the cache")
    if arguments.json:
        print_result(
            json.dumps(plain({"version": warpmis.__version__, "stage": scene.name, **vars(done)}), allow_nan=False)
        )
