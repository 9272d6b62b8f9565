"""`warpmis compile`: a stage's kernels into Warp's cache, ahead of the render."""

from __future__ import annotations

import argparse
import json
from typing import Any

import warpmis
from warpmis.cli.console import plain, say, start_warp
from warpmis.cli.render import (
    add_kernel_options,
    forced_features,
    kernel_options,
    methods_epilog,
)
from warpmis.cli.stage_options import add_stage_options, stage_options
from warpmis.config import DEFAULT_STRATEGIES, RenderConfig

DESCRIPTION = """Compile the kernels that `render` would launch with the same options, and render nothing: for images
that a build machine makes, and for the first render of a session. They lie in Warp's cache (WARP_CACHE_PATH). Kernels
for a CPU are made for one like that which compiles them."""


def add_parser(commands: Any) -> None:
    """Add the command to what `add_subparsers` returned, whose type argparse keeps private."""
    parser = commands.add_parser(
        "compile",
        help="compile a stage's kernels without rendering it",
        description=DESCRIPTION,
        epilog=methods_epilog(),
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("stage", metavar="STAGE", help="a USD file")
    add_stage_options(parser)
    add_kernel_options(parser.add_argument_group("how it will be rendered"))
    group = parser.add_argument_group("what to say")
    group.add_argument("--json", action="store_true", help="print one JSON object on standard output")
    group.add_argument("--quiet", action="store_true", help="say nothing but errors")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    options = kernel_options(arguments)
    if options.get("method") == "fixed":  # whatever the shares will be
        count = len(options.get("strategies", DEFAULT_STRATEGIES))
        options["allocation"] = (1.0 / max(count, 1),) * count
    config = RenderConfig(**options)
    start_warp()
    from warpmis.rendering.specialise import compile_scene

    scene = warpmis.load_stage(arguments.stage, width=arguments.image_width, **stage_options(arguments))
    done = compile_scene(scene, config, forced_features(arguments))
    if not arguments.quiet:
        say(f"{scene.name}: {done.compiled} kernels compiled in {done.seconds:.1f} s, {done.cached} were in the cache")
    if arguments.json:
        print(json.dumps(plain({"version": warpmis.__version__, "stage": scene.name, **vars(done)}), allow_nan=False))
