"""`warpmis render`: arguments to settings, settings to a render, and what is said about it."""

from __future__ import annotations

import argparse
import dataclasses
import json
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import warpmis
from warpmis.aovs import NAMES
from warpmis.cli.console import error_text, plain, progress_bar, say, speed_text, start_warp
from warpmis.cli.display import add_display_options, check_display, write_shown
from warpmis.cli.explain import explain
from warpmis.cli.frame_ranges import frame_list
from warpmis.cli.jobs import Job, jobs_of
from warpmis.cli.option_values import error_share, name_list, number_list, time_in_seconds, whole_number
from warpmis.cli.shot import Shot, add_shot_options
from warpmis.cli.stage_options import add_stage_options, given, stage_options
from warpmis.cli.streams import print_result
from warpmis.config import CEILING, SAMPLERS, STRATEGIES, STRATEGY_CHOICES, LearnConfig, RenderConfig
from warpmis.errors import Interrupted
from warpmis.methods import METHODS
from warpmis.output.balance_map import primaries
from warpmis.rendering.result import IDS, RenderResult

if TYPE_CHECKING:
    from warpmis.rendering.render import Uploads
    from warpmis.scene.features import Features

FEATURES = ("scene", "all")


# ---- arguments --------------------------------------------------------------------------------------------------


def add_parser(commands: Any) -> None:
    """Add the command to what `add_subparsers` returned, whose type argparse keeps private."""
    parser = commands.add_parser(
        "render",
        help="render an image or a sequence",
        description="Render a stage to an EXR file: one image, a sequence (--frames) or its products (--products).",
        epilog=methods_epilog(),
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("stage", metavar="STAGE", help="the USD file to render")
    parser.add_argument(
        "out", metavar="OUT.exr", nargs="?", help="the file to write (default: the stage's name with .exr)"
    )
    group = add_stage_options(parser)
    group.add_argument(
        "--frames", "-f", type=frame_list, metavar="A:BxC,D",
        help="render a sequence of time codes, such as 1:24 or 1:10x2,20; OUT must contain #### for the frame number",
    )  # fmt: skip
    _add_render_options(parser)
    add_shot_options(parser)
    _add_learn_options(parser)
    _add_output_options(parser)
    parser.set_defaults(run=run)


def methods_epilog() -> str:
    return "methods:\n" + "".join(f"  {name:<12}{method.summary}\n" for name, method in METHODS.items())


def _add_budget_options(group: Any) -> None:
    """How long to render: samples, an error, a time."""
    default = RenderConfig()
    group.add_argument(
        "--spp", type=whole_number, metavar="N",
        help=f"samples per pixel, learning included (default: {default.spp}); at most this many with --target-error or "
        f"--time-limit (default: {CEILING})",
    )  # fmt: skip
    group.add_argument(
        "--target-error", type=error_share, metavar="PERCENT",
        help="render until the relative error of the image is below this with 95%% confidence, such as 1%%",
    )  # fmt: skip
    group.add_argument(
        "--time-limit", type=time_in_seconds, metavar="SECONDS",
        help="stop learning and rendering after this time; loading and compiling do not count",
    )  # fmt: skip


def _add_render_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("how to render")
    _add_budget_options(group)
    add_kernel_options(group)
    group.add_argument(
        "--allocation",
        type=number_list,
        metavar="A,B",
        help="with --method fixed: the share of each strategy, such as 0.5,0.5",
    )
    group.add_argument(
        "--mis-compensation", action="store_true", default=None, help="sample domes only where they exceed their mean"
    )
    group.add_argument(
        "--shutter-samples",
        type=whole_number,
        metavar="N",
        help="motion blur: average this many times within the shutter (default: 1, no blur)",
    )
    group.add_argument(
        "--denoise",
        action="store_true",
        default=None,
        help="also write a denoised picture (denoised.R, .G, .B), which --png shows",
    )
    group.add_argument(
        "--seed",
        type=whole_number,
        metavar="N",
        help=f"random seed; the same seed gives the same image (default: {RenderConfig().seed})",
    )
    group.add_argument(
        "--threads", type=whole_number, metavar="N", help="CPU threads (default: all that this process may use)"
    )


def add_kernel_options(group: Any) -> None:
    """What decides, with the stage, which kernels are compiled."""
    default = RenderConfig()
    group.add_argument(
        "--method", metavar="NAME", help=f"how to sample, from the list below (default: {default.method})"
    )
    group.add_argument(
        "--strategies",
        type=name_list,
        metavar="A,B",
        help=f"strategies to mix, from {', '.join(STRATEGIES)}; by method cells also guide "
        f"(default: {','.join(default.strategies)})",
    )
    group.add_argument(
        "--strategy-choice",
        metavar="HOW",
        help=f"how samples choose a strategy: {' or '.join(STRATEGY_CHOICES)} (default: {default.strategy_choice})",
    )
    group.add_argument(
        "--sampler",
        metavar="NAME",
        help=f"where random numbers come from: {' or '.join(SAMPLERS)} (default: {default.sampler})",
    )
    group.add_argument(
        "--max-depth",
        type=whole_number,
        metavar="N",
        help=f"bounces after the camera ray's hit; 0 is emission, 1 direct light (default: {default.max_depth})",
    )
    group.add_argument("--device", metavar="NAME", help=f"cpu or cuda:0 (default: {default.device})")
    group.add_argument("--ids", action="store_true", default=None, help="also write primId, instanceId and elementId")
    group.add_argument(
        "--aov", type=name_list, metavar="NAME,...",
        help=f"also write these pictures: {', '.join(NAMES)}, or NAME=EXPRESSION by a light path expression",
    )  # fmt: skip
    group.add_argument(
        "--cryptomatte", action="store_true", default=None, help="also write Cryptomatte layers of prims and materials"
    )
    group.add_argument(
        "--features", choices=FEATURES, default=FEATURES[0],
        help="effects to compile: those of the scene, or all, which is slower and only for comparison (default: scene)",
    )  # fmt: skip


def kernel_options(arguments: argparse.Namespace) -> dict[str, Any]:
    """What `add_kernel_options` asked for, but the features, as RenderConfig names it."""
    names = ("method", "strategies", "strategy_choice", "sampler", "max_depth", "device", "ids", "aov", "cryptomatte")
    return given(**{name: getattr(arguments, name) for name in names})


def forced_features(arguments: argparse.Namespace) -> Features | None:
    from warpmis.scene.features import Features

    return Features.all() if arguments.features == "all" else None


def _add_learn_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("how to learn the allocation")
    group.add_argument(
        "--learn-rounds", type=whole_number, metavar="N", help="rounds of learning (default: from --spp)"
    )
    group.add_argument(
        "--learn-spp", type=whole_number, metavar="N", help="samples per pixel and round (default: from --spp)"
    )
    group.add_argument("--initial-allocation", type=number_list, metavar="A,B", help="first shares (default: equal)")


def _add_output_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("what to write")
    group.add_argument("--png", metavar="FILE.png", help="also write the image as a PNG")
    group.add_argument(
        "--products", metavar="DIR",
        help="write every RenderProduct of the RenderSettings into this folder, by its productName, instead of OUT",
    )  # fmt: skip
    add_display_options(group)
    group.add_argument("--balance-map", metavar="FILE.png", help="also write which strategy gets the samples")
    group.add_argument("--round-maps", metavar="DIR", help="also write the allocation after each learn round")
    group.add_argument(
        "--explain",
        action="store_true",
        help="report the effects in the kernels, and the time and memory used",
    )
    group.add_argument("--json", action="store_true", help="print one JSON object on standard output")
    group.add_argument("--quiet", action="store_true", help="print errors only")


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
            allocation=arguments.allocation,
            mis_compensation=arguments.mis_compensation,
            seed=arguments.seed,
            target_error=arguments.target_error,
            time_limit=arguments.time_limit,
            threads=arguments.threads,
        ),
        **kernel_options(arguments),
    )


# ---- the command ------------------------------------------------------------------------------------------------


def run(arguments: argparse.Namespace) -> None:
    config = _config(arguments)
    check_display(arguments)
    if arguments.balance_map or arguments.round_maps:
        _check_has_map(config)
    jobs = jobs_of(arguments, stage_options(arguments))
    start_warp()
    shot = Shot(arguments, jobs)
    from warpmis.rendering.render import Uploads  # here, for it loads Warp

    uploads = Uploads() if len(jobs) > 1 else None
    said: set[str] = set()
    reports: list[dict[str, Any]] = []
    try:
        with shot.workers(config):
            left = _left_to_do(jobs, config, shot, arguments)
            for job in left:
                with shot.passing_over_failures(job):
                    reports.append(_render(job, arguments, config, uploads, said, shot))
    except Interrupted as stop:
        reports.append(_finish(stop.result, shot.current, arguments, said))
        if not arguments.quiet:
            say(f"{shot.current.targets['output']}: written as far as it was rendered")
        raise
    finally:
        if arguments.json and (reports or shot.failed):
            print_result(json.dumps(plain(_json(arguments, reports, shot)), allow_nan=False))
    shot.end()


def _left_to_do(jobs: list[Job], config: RenderConfig, shot: Shot, arguments: argparse.Namespace) -> list[Job]:
    """The pictures to render; those that are rendered on a cluster as a whole are under way from now on."""
    left = [job for job in jobs if not shot.leaves_alone(job, config)]
    if shot.queue is not None:
        for job in left:
            shot.queue.add(job.targets["output"], _render_options(job, arguments, config))
    return left


def _render_options(job: Job, arguments: argparse.Namespace, config: RenderConfig) -> dict[str, Any]:
    """What of the arguments `warpmis.render` takes, beside what this process holds."""
    more = given(shutter_samples=arguments.shutter_samples, denoise=arguments.denoise)
    more |= given(features=forced_features(arguments))
    return {"config": config_of(job, config), **stage_options(arguments), **job.options, **more}


def _json(arguments: argparse.Namespace, reports: list[dict[str, Any]], shot: Shot) -> dict[str, Any]:
    many = "products" if arguments.products else "frames" if arguments.frames else None
    if many is None:
        return reports[0]
    return {many: reports, **given(failed=shot.failed or None)}


def _check_has_map(config: RenderConfig) -> None:
    """Refuse now, not after the render, what cannot be shown."""
    if config.how.has_strategies:
        primaries(config.strategies)


def _render(
    job: Job,
    arguments: argparse.Namespace,
    config: RenderConfig,
    uploads: Uploads | None,
    said: set[str],
    shot: Shot,
) -> dict[str, Any]:
    start = time.perf_counter()
    with progress_bar(quiet=arguments.quiet, label=job.label) as show:
        if shot.queue is not None:
            result = shot.queue.result(job.targets["output"])
        else:
            options = _render_options(job, arguments, config) | given(uploads=uploads) | shot.render_options()
            result = warpmis.render(arguments.stage, progress=show, **options)
    report = _finish(result, job, arguments, said)
    shot.finished(job, config)
    if arguments.explain:
        explain(result, arguments.stage, {**stage_options(arguments), **job.options})
    if not arguments.quiet:
        say(_summary(result, config, job.targets["output"], time.perf_counter() - start))
    return report


def config_of(job: Job, config: RenderConfig) -> RenderConfig:
    """The settings of one picture: ids and AOVs are found where a product asks for them."""
    ids = config.ids or bool(set(IDS) & set((job.channels or {}).values()))
    return dataclasses.replace(config, ids=ids, aov=tuple(dict.fromkeys((*config.aov, *job.aovs))))


def _finish(result: RenderResult, job: Job, arguments: argparse.Namespace, said: set[str]) -> dict[str, Any]:
    """Write a picture's files, say what has not been `said` of an earlier one, and return its part of --json."""
    _write(result, job, arguments)
    warnings, notes = _distinct((*job.warnings, *result.warnings)), _distinct(result.notes)
    if not arguments.quiet:
        for line in (*(f"warning: {line}" for line in warnings), *(f"note: {line}" for line in notes)):
            if line not in said:
                say(line)
            said.add(line)
    return {
        **job.targets,
        **job.options,
        "version": warpmis.__version__,
        "stage": result.name,
        "strategies": result.strategies,
        "settings": result.settings,
        "stats": result.stats,
        "warnings": warnings,
        "notes": notes,
    }


def _write(result: RenderResult, job: Job, arguments: argparse.Namespace) -> None:
    from warpmis.output.balance_map import balance_map, sample_shares
    from warpmis.output.legend import with_legend
    from warpmis.output.png import write_display_png

    targets = job.targets
    if targets["output"].lower().endswith(".png"):  # a product's
        write_shown(targets["output"], result.shown, arguments)
    else:
        channels = job.channels
        if channels is not None:
            channels = channels | {name: name for name in result.aov_channels(arguments.aov or ())}
        result.write(targets["output"], channels)
    if "png" in targets:
        write_shown(targets["png"], result.shown, arguments)
    if "balance_map" in targets:
        shares = sample_shares(result.allocation, result.strategies, result.next_event)
        picture = balance_map(result.allocation, result.strategies, result.next_event)
        write_display_png(targets["balance_map"], with_legend(picture, result.strategies, shares))
    if "round_maps" in targets:
        _write_round_maps(result, targets["round_maps"])


def _write_round_maps(result: RenderResult, folder: str) -> None:
    """One picture a round, numbered from 1, for a film of the convergence."""
    from warpmis.output.balance_map import balance_map
    from warpmis.output.png import write_display_png

    for number, allocation in enumerate(result.round_allocations, start=1):
        # A method that leaves pixels to next-event estimation has one learn round.
        picture = balance_map(allocation, result.strategies, result.next_event)
        write_display_png(f"{folder}/round_{number:04}.png", picture)


# ---- what is said -----------------------------------------------------------------------------------------------


def _distinct(lines: Sequence[str]) -> list[str]:
    return list(dict.fromkeys(lines))


def _summary(result: RenderResult, config: RenderConfig, out: str, seconds: float) -> str:
    height, width, _ = result.image.shape
    phases = result.stats["seconds"]
    tracing = phases.get("learn", 0.0) + phases.get("render", 0.0)
    speed = speed_text(result.stats["samples"], tracing)
    told = result.stats.get("stopping", {})
    line = f"{out}: {width} x {height}, {told.get('spp', config.spp)} spp, {seconds:.1f} s, {speed}"
    if "denoise" in result.stats:
        line += f", denoised to an error below {100.0 * result.stats['denoise']['relative_error_bound']:.2g} %"
    if "bound" not in told:
        return line
    error = error_text(told["relative_error"], told["standard_error"])
    bound, confidence = 100.0 * told["bound"], 100.0 * told["confidence"]
    return f"{line}, error {error}, below {bound:.3g} % with {confidence:.0f} % confidence"
