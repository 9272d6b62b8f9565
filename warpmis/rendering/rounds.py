"""One picture of one scene: compile, upload, then rounds of samples, with a step of learning after each learn round."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import suppress

from warpmis.config import RenderConfig
from warpmis.device.compilation import Compiler
from warpmis.device.trees import tree_kernels
from warpmis.device.upload import Uploads, upload
from warpmis.errors import Interrupted
from warpmis.learn.schedule import Round
from warpmis.rendering.checkpoint import CheckpointPart
from warpmis.rendering.cluster import Farm
from warpmis.rendering.held import interrupts_held
from warpmis.rendering.integrator import allocation_of
from warpmis.rendering.kinds import integrator_of
from warpmis.rendering.reporter import Reporter
from warpmis.rendering.result import RenderResult
from warpmis.rendering.run import Run
from warpmis.rendering.specialise import begin_compiling, features_of, kernels_of
from warpmis.rendering.stopping import Watch
from warpmis.scene import Scene
from warpmis.scene.features import Features


def render_scene(
    scene: Scene,
    config: RenderConfig,
    features: Features | None,
    reporter: Reporter,
    uploads: Uploads | None = None,
    checkpoint: CheckpointPart | None = None,
    farm: Farm | None = None,
) -> RenderResult:
    """Render a scene as it is, by the rounds of its schedule.

    Raises:
        ConfigError: the machine lacks the device, an allocation map is not of the picture's size, or the checkpoint is
            another picture's.
        Interrupted: Ctrl-C, after samples were taken; it holds the result so far.
    """
    features = features_of(scene, config, features)
    reporter.phase("compile")
    kernels = kernels_of(features, config)
    # A time limit is for tracing: all kernels are compiled before it begins.
    at_once = kernels.sure if config.time_limit is None else kernels.all
    with begin_compiling(at_once, config.device, reporter) as compiler:
        if config.time_limit is not None:
            compiler.wait(at_once)
        run = begin(scene, config, features, compiler, reporter, uploads)
        if checkpoint is not None:
            checkpoint.begin(run)
        if farm is not None:
            farm.join(run)
        return rendered(run, checkpoint)


def rendered(run: Run, checkpoint: CheckpointPart | None = None) -> RenderResult:
    """Trace the rounds, and make the result of all samples that they took."""
    reporter = run.reporter
    watch = reporter.watch
    try:
        trace_rounds(run)
        reporter.finish()
    except KeyboardInterrupt:
        if checkpoint is not None:
            checkpoint.interrupted(run)
        if reporter.done == 0:
            raise
        with suppress(KeyboardInterrupt):  # who is in a hurry gets the picture as it is
            run.integrator.fill()
        reporter.end_phase()
        if watch is not None:
            watch.reason = "interrupted"
        share = f"after {100.0 * reporter.done / reporter.total:.0f} % of the samples"
        raise Interrupted(run.result([f"interrupted {share}"], share)) from None
    reporter.end_phase()
    return run.result(watch.notes() if watch is not None else ())


def begin(
    scene: Scene,
    config: RenderConfig,
    features: Features,
    compiler: Compiler,
    reporter: Reporter,
    uploads: Uploads | None,
) -> Run:
    """Upload the scene, while kernels for the rounds are compiled."""
    reporter.phase("load")
    compiler.wait(tree_kernels(config.device))
    device_scene = upload(scene, config.device, config.mis_compensation, config.ids or config.cryptomatte, uploads)
    kind = integrator_of(config)
    integrator = kind(device_scene, features, config, allocation_of(config, *scene.resolution), compiler)
    reporter.total = config.spp * integrator.pixels
    if config.stops:
        reporter.watch = Watch(config, scene.resolution, reporter.tracing_seconds)
    return Run(scene, config, features, integrator, reporter)


def trace_rounds(run: Run) -> None:
    """Trace every round, or as many as the stopping rule wants. An allocation depends on earlier rounds alone."""
    integrator, reporter = run.integrator, run.reporter
    first, saved, run.saved = run.round, run.saved, None
    for number, part in enumerate(integrator.rounds()):
        if number < first:
            continue
        is_resumed = saved is not None and number == first and saved["has_begun"]
        if not is_resumed:
            if reporter.watch is not None and reporter.watch.leaves_out(part):
                continue
            run.round, run.has_begun, integrator.next_sample = number, True, part.first_sample
        elif saved is not None:
            integrator.resume_round(part, saved["integrator"])
        reporter.phase("learn" if part.learn else "render", part.label)
        trace(part, run, is_resumed=is_resumed)
        if reporter.watch is not None and reporter.watch.stopped:
            return
        if part.learn:
            solve(part, run)


def solve(part: Round, run: Run) -> None:
    """One step of learning. An interrupt comes before or after it: a checkpoint holds it whole or not at all."""
    integrator = run.integrator
    integrator.compiler.wait(integrator.solving_kernels(part))
    with interrupts_held():
        integrator.solve(part)
        if run.config.learn.keep_maps:
            run.round_allocations.append(integrator.allocation_map())
        run.round, run.has_begun = run.round + 1, False


def trace(part: Round, run: Run, *, is_resumed: bool = False) -> None:
    """Trace one round: all of it, or piece by piece as the stopping rule deals them out."""
    integrator, reporter, watch = run.integrator, run.reporter, run.reporter.watch
    if watch is None or not part.is_kept:
        whole = range(part.first_sample, part.first_sample + part.samples)
        trace_piece(part, whole, run, reporter.advance if watch is None else lambda samples: None)
        return
    for index, piece in watch.pieces(part, resumed=is_resumed):
        reporter.total = watch.needed_spp() * integrator.pixels
        trace_piece(part, piece, run, reporter.advance)
        with interrupts_held():
            watch.add(index, piece, integrator.color_sums())


def trace_piece(part: Round, piece: range, run: Run, advance: Callable[[int], None]) -> None:
    """Trace a piece of a round by passes over the whole picture, so that it is whole at any time but in the first."""
    for samples in passes(run, piece, in_one=not part.is_kept):
        run.integrator.trace(part, advance, piece, samples)
        run.between(part.is_kept)


def passes(run: Run, piece: range, *, in_one: bool) -> Iterator[range]:
    """The samples of each pass: some times as many as of the one before, until one takes Run.pass_seconds.

    in_one: all at once, where nobody looks at the picture.
    """
    if run.integrator.passing:
        yield run.integrator.passing
    start, count = max(piece.start, run.integrator.next_sample), run.first_pass
    while start < piece.stop:
        samples = piece[start - piece.start :] if in_one else piece[start - piece.start :][:count]
        begun = time.perf_counter()
        yield samples
        start = samples.stop
        pace = run.pass_seconds / max(time.perf_counter() - begun, 1e-6)
        count = max(1, min(run.growth * count, int(count * pace)))
