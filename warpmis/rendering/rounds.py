"""One picture of one scene: compile, upload, then rounds of samples, with a step of learning after each learn round."""

from __future__ import annotations

from warpmis.config import RenderConfig
from warpmis.device.compilation import Compiler
from warpmis.device.trees import tree_kernels
from warpmis.device.upload import Uploads, upload
from warpmis.errors import Interrupted
from warpmis.learn.schedule import Round
from warpmis.rendering.guided import GuidedIntegrator
from warpmis.rendering.integrator import Integrator, allocation_of
from warpmis.rendering.reporter import Reporter
from warpmis.rendering.result import RenderResult
from warpmis.rendering.run import Run
from warpmis.rendering.specialise import begin_compiling, features_of, kernels_of
from warpmis.rendering.stopping import Watch
from warpmis.scene import Scene
from warpmis.scene.features import Features


def render_scene(
    scene: Scene, config: RenderConfig, features: Features | None, reporter: Reporter, uploads: Uploads | None = None
) -> RenderResult:
    """Render a scene as it is, by the rounds of its schedule.

    Raises:
        ConfigError: the machine lacks the device, or an allocation map is not of the picture's size.
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
        return rendered(run)


def rendered(run: Run) -> RenderResult:
    """Trace the rounds, and make the result of all samples that they took."""
    reporter = run.reporter
    watch = reporter.watch
    try:
        trace_rounds(run)
        reporter.finish()
    except KeyboardInterrupt:
        if reporter.done == 0:
            raise
        reporter.end_phase()
        if watch is not None:
            watch.reason = "interrupted"
        share = 100.0 * reporter.done / reporter.total
        raise Interrupted(run.result([f"interrupted after {share:.0f} % of the samples"])) from None
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
    device_scene = upload(scene, config.device, config.mis_compensation, config.ids, uploads)
    kind = GuidedIntegrator if config.how.cache else Integrator
    integrator = kind(device_scene, features, config, allocation_of(config, *scene.resolution), compiler)
    reporter.total = config.spp * integrator.pixels
    if config.stops:
        reporter.watch = Watch(config, scene.resolution, reporter.tracing_seconds)
    return Run(scene, config, features, integrator, reporter)


def trace_rounds(run: Run) -> None:
    """Trace every round, or as many as the stopping rule wants. An allocation depends on earlier rounds alone."""
    integrator, reporter = run.integrator, run.reporter
    for part in integrator.rounds():
        if reporter.watch is not None and reporter.watch.leaves_out(part):
            continue
        reporter.phase("learn" if part.learn else "render", part.label)
        trace(part, integrator, reporter)
        if reporter.watch is not None and reporter.watch.stopped:
            return
        if part.learn:
            integrator.solve(part)
            if run.config.learn.keep_maps:
                run.round_allocations.append(integrator.allocation_map())


def trace(part: Round, integrator: Integrator, reporter: Reporter) -> None:
    """Trace one round: at once, or piece by piece as the stopping rule deals them out."""
    watch = reporter.watch
    if watch is None or not part.is_kept:
        integrator.trace(part, reporter.advance if watch is None else lambda samples: None)
        return
    for index, piece in watch.pieces(part):
        reporter.total = watch.needed_spp() * integrator.pixels
        integrator.trace(part, reporter.advance, piece)
        watch.add(index, piece, integrator.color_sums())
