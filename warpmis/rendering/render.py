"""The whole story of a render: load, upload, specialise, then rounds of trace, learn, accumulate."""

from __future__ import annotations

import dataclasses
import os
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpmis.config import LearnConfig, RenderConfig, checked_integer
from warpmis.device.compilation import Compilation, load_kernels
from warpmis.device.upload import Uploads as Uploads  # for callers, too
from warpmis.device.upload import upload
from warpmis.errors import ConfigError, Interrupted
from warpmis.learn.schedule import Round, schedule
from warpmis.rendering.integrator import Integrator, allocation_of, kernels_of
from warpmis.rendering.motion import averaged, divided, shutter_times
from warpmis.rendering.progress import Progress
from warpmis.rendering.result import RenderResult
from warpmis.rendering.stopping import Watch
from warpmis.scene import Scene
from warpmis.scene.features import Features, detect

# At most so often is progress reported [s].
REPORT_SECONDS = 0.1

ProgressCallback = Callable[[Progress], None]


def render(
    stage: Any,
    *,
    config: RenderConfig | None = None,
    camera: str | None = None,
    purposes: tuple[str, ...] | None = None,
    render_settings: str | None = None,
    product: str | None = None,
    shutter_samples: int = 1,
    time: float | None = None,
    complexity: str = "high",
    variants: Sequence[str] = (),
    mask: Sequence[str] = (),
    session_layer: str | os.PathLike[str] | None = None,
    progress: ProgressCallback | None = None,
    features: Features | None = None,
    uploads: Uploads | None = None,
    **settings: Any,
) -> RenderResult:
    """Render a stage.

    Args:
        stage: path of a USD file, a Usd.Stage, or a Scene.
        config: all settings at once; or name the fields of RenderConfig and LearnConfig (learn_rounds, learn_spp,
            initial_allocation, keep_maps) one by one.
        camera: what to read of the stage, as in load_stage, like the next eight; a Scene has been read already.
        purposes: as in load_stage.
        render_settings: as in load_stage.
        product: as in load_stage.
        time: as in load_stage.
        complexity: as in load_stage.
        variants: as in load_stage.
        mask: as in load_stage.
        session_layer: as in load_stage.
        shutter_samples: at how many times within the camera's shutter interval the stage is read, for motion blur.
        progress: called about every tenth of a second with how far the render has come.
        features: the effects to compile, None for those that the scene calls for; Features.all() for all of them.
        uploads: what an earlier render put on the device, to be used again where it is the same.

    Raises:
        ConfigError: a setting cannot be honoured.
        StageError: the stage cannot be rendered.
        Interrupted: Ctrl-C, after samples were taken; it holds the result so far.
    """
    if config is not None and settings:
        raise TypeError(f"render() takes either a config or single settings, got both: {', '.join(sorted(settings))}")
    config = config or config_from(settings)
    shutter_samples = checked_integer("shutter samples", shutter_samples, low=1)
    reporter = Reporter(progress)
    reporter.phase("load")
    if isinstance(stage, Scene):
        return render_scene(resized(stage, config.width), config, features, reporter, uploads)

    def scene_at(code: float | None) -> Scene:
        return load(
            stage,
            width=config.width,
            camera=camera,
            purposes=purposes,
            render_settings=render_settings,
            product=product,
            time=code,
            complexity=complexity,
            variants=variants,
            mask=mask,
            session_layer=session_layer,
        )

    if config.target_error is not None and shutter_samples > 1:
        raise ConfigError("a target error is for one time within the shutter: drop the shutter samples, or set spp")
    scene = scene_at(time)
    opens, closes = scene.camera.shutter
    if shutter_samples > 1 and opens < closes:
        return render_shutter(scene, scene_at, config, features, progress, shutter_samples, uploads or Uploads())
    if opens < closes:
        note = "the camera's shutter stays open, but there is one time in it alone: ask for more shutter samples"
        scene = dataclasses.replace(scene, notes=(*scene.notes, note))
    return render_scene(scene, config, features, reporter, uploads)


def render_shutter(
    scene: Scene,
    scene_at: Callable[[float], Scene],
    config: RenderConfig,
    features: Features | None,
    progress: ProgressCallback | None,
    count: int,
    uploads: Uploads,
) -> RenderResult:
    """The mean of renders at `count` times within the shutter's interval; each reads the whole stage again."""
    results: list[RenderResult] = []
    codes = shutter_times(scene.time, scene.camera.shutter, count)
    for code, part in zip(codes, divided(config, count), strict=True):
        reporter = Reporter(progress)
        try:
            reporter.phase("load", f"time {code:g}")
            results.append(render_scene(scene_at(code), part, features, reporter, uploads))
        except KeyboardInterrupt as stop:
            results += [stop.result] if isinstance(stop, Interrupted) else []
            if not results:
                raise
            note = (
                f"interrupted at time {code:g}: {len(results)} of {count} times within the shutter are in the picture"
            )
            result = averaged(results, config)
            raise Interrupted(dataclasses.replace(result, notes=(*result.notes, note))) from None
    return averaged(results, config)


def config_from(settings: dict[str, Any]) -> RenderConfig:
    """A RenderConfig from the flat names that callers type."""
    learn_names = {
        "learn_rounds": "rounds",
        "learn_spp": "spp",
        "initial_allocation": "initial_allocation",
        "keep_maps": "keep_maps",
    }
    learn = {learn_names[name]: settings.pop(name) for name in list(settings) if name in learn_names}
    known = {field.name for field in dataclasses.fields(RenderConfig)}
    for name in settings:
        if name not in known:
            raise TypeError(f"render() has no setting '{name}'; there are {', '.join(sorted({*known, *learn_names}))}")
    if learn:
        settings["learn"] = LearnConfig(**learn)
    return RenderConfig(**settings)


def load(stage: Any, **options: Any) -> Scene:
    from warpmis.usd import load_stage  # here, so that a Scene can be rendered without pxr

    return load_stage(stage, **options)


def resized(scene: Scene, width: int | None) -> Scene:
    """The scene at another width, its picture's aspect kept."""
    if width is None or width == scene.resolution[0]:
        return scene
    height = max(1, round(scene.resolution[1] * width / scene.resolution[0]))
    return dataclasses.replace(scene, resolution=(width, height))


def features_of(scene: Scene, config: RenderConfig, features: Features | None = None) -> Features:
    """The effects to compile: those that are forced, else what scene and depth call for; and what the method needs."""
    strategies = config.strategies if config.method != "nee" else ()
    features = features or detect(scene).with_depth(config.max_depth)
    features = features.with_strategies(strategies, config.how.statistics).with_sampler(config.sampler)
    return features.with_tree("wide" if config.device == "cpu" else "warp")


def compile_scene(scene: Scene, config: RenderConfig, features: Features | None = None) -> Compilation:
    """Compile the kernels that `render` would launch for the scene, without rendering it.

    Raises:
        ConfigError: the machine lacks the device.
    """
    return load_kernels(kernels_of(features_of(scene, config, features), config), config.device)


def render_scene(
    scene: Scene, config: RenderConfig, features: Features | None, reporter: Reporter, uploads: Uploads | None = None
) -> RenderResult:
    """Trace the rounds of the schedule; each round's allocation depends on earlier rounds alone."""
    width, height = scene.resolution
    features = features_of(scene, config, features)
    reporter.phase("compile")

    def announce(count: int) -> None:
        reporter.phase("compile", f"{count} kernel{'s' if count > 1 else ''}, first use of these effects")

    compilation = load_kernels(kernels_of(features, config), config.device, announce)
    reporter.phase("load")
    device_scene = upload(scene, config.device, config.mis_compensation, config.ids, uploads)
    integrator = Integrator(device_scene, features, config, allocation_of(config, width, height))
    rounds = schedule(config)
    learn_rounds = sum(part.learn for part in rounds)
    reporter.total = config.spp * width * height
    watch = reporter.watch = Watch(config, scene.resolution, reporter.tracing_seconds) if config.stops else None
    maps = []
    try:
        for number, part in enumerate(rounds, start=1):
            reporter.phase("learn" if part.learn else "render", f"round {number}/{learn_rounds}" if part.learn else "")
            trace(part, integrator, reporter)
            if watch is not None and watch.stopped:
                break
            if part.learn:
                integrator.solve(rounds[number] if number < len(rounds) else None)
                if config.learn.keep_maps:
                    maps.append(integrator.allocation_map())
    except KeyboardInterrupt:
        if reporter.done == 0:
            raise
        reporter.phase("done")
        if watch is not None:
            watch.reason = "interrupted"
        share = 100.0 * reporter.done / reporter.total
        scene = dataclasses.replace(scene, notes=(*scene.notes, f"interrupted after {share:.0f} % of the samples"))
        raise Interrupted(result_of(scene, config, features, integrator, compilation, reporter, maps)) from None
    reporter.phase("done")
    if watch is not None:
        scene = dataclasses.replace(scene, notes=(*scene.notes, *watch.notes()))
    return result_of(scene, config, features, integrator, compilation, reporter, maps)


def trace(part: Round, integrator: Integrator, reporter: Reporter) -> None:
    """One round, at once or as far as it is watched."""
    watch = reporter.watch
    if watch is None:
        integrator.trace(part, reporter.advance)
        return
    for index, piece in watch.pieces(part):
        reporter.total = watch.needed_spp() * integrator.pixels
        integrator.trace(part, reporter.advance, piece)
        watch.add(index, piece, integrator.color_sums())


def result_of(
    scene: Scene,
    config: RenderConfig,
    features: Features,
    integrator: Integrator,
    compilation: Compilation,
    reporter: Reporter,
    maps: list[NDArray[np.float32]],
) -> RenderResult:
    """Merge the films: every sample is in the image, the variance is the last allocation's."""
    *learned, final = integrator.download()
    film = learned[0].merge(final) if learned else final
    # An interrupted last round has pixels without samples.
    spread = final if (final.count + final.rejected).min() > 1 else film
    seconds = {name: reporter.seconds.get(name, 0.0) for name in ("load", "compile", "learn", "render")}
    traced = seconds["learn"] + seconds["render"]
    rays = integrator.rays()
    stats = {
        "seconds": seconds,
        "samples": int(film.count.sum() + film.rejected.sum()),
        "rejected_samples": int(film.rejected.sum()),
        "rays": rays,
        "rays_per_second": rays / traced if traced > 0.0 else 0.0,
        "next_event_pixels": integrator.next_event_share(),
        **integrator.certificate(spread.variance(), film.image()),
        **({"stopping": reporter.watch.stats()} if reporter.watch is not None else {}),
        "triangles": scene.triangle_count,
        "lights": len(scene.lights),
        "features": [name for name, on in dataclasses.asdict(features).items() if on is True],
        "device": config.device,
        "threads": integrator.threads,
        "compile_seconds": compilation.seconds,
        "kernels_compiled": compilation.compiled,
        "kernels_cached": compilation.cached,
        "bytes": integrator.bytes(),
    }
    notes = scene.notes
    if stats["rejected_samples"]:
        left_out = f"{stats['rejected_samples']} of {stats['samples']} samples by method {config.method}"
        notes = (*notes, f"{left_out} were not finite and are left out of the picture")
    exposure = scene.camera.exposure
    return RenderResult(
        image=film.image() * np.float32(exposure),
        alpha=film.coverage(),
        albedo=film.mean_albedo(),
        normal=film.mean_normal(),
        depth=film.mean_depth(),
        samples=film.count,
        variance=spread.variance(exposure),
        allocation=integrator.allocation_map(),
        ids=integrator.ids() if config.ids else None,
        paths=tuple(prim.path for prim in scene.prims) if config.ids else (),
        round_allocations=tuple(maps),
        strategies=config.strategies,
        stats=stats,
        name=scene.name,
        settings={**config.to_dict(), "camera": scene.camera.path},
        warnings=scene.warnings,
        notes=notes,
    )


class Reporter:
    """Times the phases, and tells the caller's progress function about them at most ten times a second."""

    def __init__(self, progress: ProgressCallback | None) -> None:
        self.progress = progress
        self.seconds: dict[str, float] = {}
        self.total = 0
        self.done = 0
        self.watch: Watch | None = None
        self.current = ""
        self.detail = ""
        self.started = self.reported = time.perf_counter()
        self.tracing_since = 0.0

    def phase(self, name: str, detail: str = "") -> None:
        now = time.perf_counter()
        if self.current:
            self.seconds[self.current] = self.seconds.get(self.current, 0.0) + now - self.started
        if name in ("learn", "render") and not self.tracing_since:
            self.tracing_since = now
        self.current, self.detail, self.started = name, detail, now
        if name != "done":
            self.report(now)

    def advance(self, samples: int) -> None:
        self.done += samples
        now = time.perf_counter()
        if now - self.reported > REPORT_SECONDS:
            self.report(now)

    def tracing_seconds(self) -> float:
        """Time since the first round began [s]."""
        return time.perf_counter() - self.tracing_since if self.tracing_since else 0.0

    def report(self, now: float) -> None:
        self.reported = now
        if self.progress is not None:
            watched = self.watch.progress() if self.watch is not None else {}
            seconds = self.tracing_seconds()
            self.progress(Progress(self.current, self.done, self.total, self.done, seconds, self.detail, **watched))
