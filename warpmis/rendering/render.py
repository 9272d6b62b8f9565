"""What callers call: settings and a stage to a RenderResult."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from warpmis.config import LearnConfig, RenderConfig
from warpmis.device.upload import Uploads as Uploads  # for callers, too
from warpmis.errors import ConfigError
from warpmis.rendering.checkpoint import INTERVAL as CHECKPOINT_INTERVAL
from warpmis.rendering.checkpoint import Checkpoint, CheckpointPart, asked_of
from warpmis.rendering.cluster import Farm, farm_of
from warpmis.rendering.halves import render_halves
from warpmis.rendering.preview import INTERVAL as PREVIEW_INTERVAL
from warpmis.rendering.preview import Preview, PreviewCallback
from warpmis.rendering.reporter import ProgressCallback, Reporter
from warpmis.rendering.result import RenderResult
from warpmis.rendering.rounds import render_scene
from warpmis.rendering.shutter import render_shutter
from warpmis.scene import Scene
from warpmis.scene.features import Features
from warpmis.whole_numbers import MAX_PIXELS, checked_integer


class UsdStage(Protocol):
    """A pxr.Usd.Stage, for type checkers: a Scene can be rendered without pxr."""

    def GetRootLayer(self) -> Any: ...


def render(
    stage: str | os.PathLike[str] | UsdStage | Scene,
    *,
    camera: str | None = None,
    time: float | None = None,
    purposes: Sequence[str] | None = None,
    render_settings: str | None = None,
    product: str | None = None,
    complexity: str | None = None,
    variants: Sequence[str] | None = None,
    mask: Sequence[str] | None = None,
    session_layer: str | os.PathLike[str] | None = None,
    height: int | None = None,
    disable_depth_of_field: bool | None = None,
    disable_motion_blur: bool | None = None,
    pixel_aspect_ratio: float | None = None,
    aspect_ratio_conform_policy: str | None = None,
    data_window_ndc: Sequence[float] | None = None,
    material_binding_purposes: Sequence[str] | None = None,
    shutter_samples: int = 1,
    denoise: bool = False,
    width: int | None = None,
    spp: int | None = None,
    target_error: float | None = None,
    time_limit: float | None = None,
    method: str | None = None,
    strategies: Sequence[str] | None = None,
    allocation: NDArray[np.floating] | Sequence[float] | None = None,
    strategy_choice: str | None = None,
    sampler: str | None = None,
    mis_compensation: bool | None = None,
    max_depth: int | None = None,
    seed: int | None = None,
    ids: bool | None = None,
    aov: Sequence[str] | None = None,
    cryptomatte: bool | None = None,
    device: str | None = None,
    threads: int | None = None,
    learn_rounds: int | None = None,
    learn_spp: int | None = None,
    initial_allocation: Sequence[float] | None = None,
    keep_maps: bool | None = None,
    learn: LearnConfig | None = None,
    config: RenderConfig | None = None,
    progress: ProgressCallback | None = None,
    preview: PreviewCallback | None = None,
    preview_interval: float = PREVIEW_INTERVAL,
    checkpoint: str | os.PathLike[str] | Checkpoint | None = None,
    checkpoint_interval: float = CHECKPOINT_INTERVAL,
    resume: bool = False,
    cluster: Any = None,
    ship_stage: bool = False,
    features: Features | None = None,
    uploads: Uploads | None = None,
) -> RenderResult:
    """Render a stage.

    A setting that is None comes from the stage's RenderSettings if they author it, and else from the default.

    The arguments from `camera` to `material_binding_purposes` say how to read the stage, as in `load_stage`. They are
    not for a Scene, which has been read already. `learn_rounds`, `learn_spp`, `initial_allocation` and `keep_maps` are
    the fields of LearnConfig, one at a time.

    Args:
        stage: path of a USD file, a Usd.Stage, or a Scene.
        shutter_samples: motion blur: average this many times within the camera's shutter interval; 1 for none.
        denoise: also make a denoised picture, from two independent halves of the render (extra `denoise`).
        width: image width [pixel].
        spp: samples per pixel, learning included (256); at most this many with a target error or a time limit (262144).
        target_error: render until the relative error is below this with 95 % confidence; 0.01 is 1 %.
        time_limit: stop learning and rendering after this time [s].
        method: how samples are shared between the strategies ("auto"); `warpmis render --help` lists them.
        strategies: the sampling strategies (("bsdf", "light")).
        allocation: share of each strategy for method "fixed", shape (S,) or (H, W, S).
        strategy_choice: "stratified" (the default) or "random".
        sampler: "lattice" (the default) or "independent".
        mis_compensation: sample a dome's picture only where it is brighter than its mean (False).
        max_depth: bounces after the camera ray's hit (8): 0 is emission alone, 1 direct light.
        seed: the same seed gives the same picture (0).
        ids: also find the prim, the instance and the face that each pixel sees (False).
        aov: further pictures, such as ("direct", "indirect", "lights", "key=C.*<L.'key'>"); docs/aovs.md has the names.
        cryptomatte: also find which prims and materials each pixel shows, and how much of each (False).
        device: "cpu" (the default) or "cuda:0".
        threads: CPU threads; None for all that this process may use.
        learn: all learn settings at once.
        config: all settings at once, instead of the arguments from `width` to `learn`.
        progress: called with a Progress about ten times a second, and once at the end.
        preview: called with the picture so far, linear Rec.709, shape (H, W, 3) float32, and with the whole one.
        preview_interval: `preview` is called at most this often [s].
        checkpoint: a file that the render's state is written to, from which a later call goes on to the same bits; it
            is removed when the picture is whole.
        checkpoint_interval: how often it is written [s]; also when the render is interrupted.
        resume: go on from the checkpoint, if there is one.
        cluster: "local:2" for so many processes of this machine, the address of a Dask scheduler such as
            "tcp://host:8786", or a distributed.Client: their workers render, to the bits of one machine (extra
            `distributed`).
        ship_stage: send the scene to the workers, textures included; without it they read the stage by its path.
        features: the effects to compile; None for those of the scene, Features.all() for every one.
        uploads: data of an earlier render on the device, which is reused where it is the same.

    Raises:
        ConfigError: a setting is impossible, or the checkpoint is of another picture.
        StageError: the stage cannot be rendered.
        Interrupted: Ctrl-C after the first samples; it holds the result so far.
    """
    learning = _given(rounds=learn_rounds, spp=learn_spp, initial_allocation=initial_allocation, keep_maps=keep_maps)
    settings = _given(
        width=width, spp=spp, target_error=target_error, time_limit=time_limit, method=method, strategies=strategies,
        allocation=allocation, strategy_choice=strategy_choice, sampler=sampler, mis_compensation=mis_compensation,
        max_depth=max_depth, seed=seed, ids=ids, aov=aov, cryptomatte=cryptomatte, device=device, threads=threads,
    )  # fmt: skip
    options = _given(
        camera=camera, time=time, purposes=purposes, render_settings=render_settings, product=product,
        complexity=complexity, variants=variants, mask=mask, session_layer=session_layer, height=height,
        disable_depth_of_field=disable_depth_of_field, disable_motion_blur=disable_motion_blur,
        pixel_aspect_ratio=pixel_aspect_ratio, aspect_ratio_conform_policy=aspect_ratio_conform_policy,
        data_window_ndc=data_window_ndc, material_binding_purposes=material_binding_purposes,
    )  # fmt: skip
    config = _config(config, learn, settings, learning)
    shutter_samples = checked_integer("shutter_samples", shutter_samples)
    if isinstance(stage, Scene) and shutter_samples > 1:
        options["shutter_samples"] = shutter_samples

    file = _checkpoint_of(checkpoint, checkpoint_interval, resume)
    if file is not None:
        more = {"shutter_samples": shutter_samples, "denoise": denoise}
        file.begin_picture(asked_of(stage, options, config, **more), config)
    look = None if preview is None else Preview(preview, preview_interval)
    uploads = uploads or (Uploads() if denoise else None)  # the second half finds the first one's trees

    def render_one(
        config: RenderConfig, progress: ProgressCallback | None, part: CheckpointPart | None
    ) -> RenderResult:
        reporter = Reporter(progress, preview=look)
        if not isinstance(stage, Scene):
            return _render_stage(stage, options, config, shutter_samples, features, reporter, uploads, part, farm)
        reporter.phase("load")
        return render_scene(_scene_as_read(stage, config, options), config, features, reporter, uploads, part, farm)

    part = None if file is None else CheckpointPart(file)
    with farm_of(cluster, config, ship_stage=ship_stage) as farm:
        result = render_halves(render_one, config, progress, part) if denoise else render_one(config, progress, part)
    if look is not None:
        look.show(result.shown)
    return result if file is None else _finished(result, file, is_own=file is not checkpoint)


def _checkpoint_of(
    checkpoint: str | os.PathLike[str] | Checkpoint | None, interval: float, resume: bool
) -> Checkpoint | None:
    if checkpoint is None and resume:
        raise ConfigError("nothing to resume: name the checkpoint")
    if checkpoint is None or isinstance(checkpoint, Checkpoint):
        return checkpoint
    return Checkpoint(checkpoint, interval, resume)


def _finished(result: RenderResult, file: Checkpoint, *, is_own: bool) -> RenderResult:
    """The picture is whole: its checkpoint has served."""
    if is_own:
        file.remove()
    if not file.trouble:
        return result
    return dataclasses.replace(result, notes=(*result.notes, f"no checkpoint at the end: {file.trouble}"))


def _render_stage(
    stage: str | os.PathLike[str] | UsdStage,
    options: dict[str, Any],
    config: RenderConfig,
    shutter_samples: int,
    features: Features | None,
    reporter: Reporter,
    uploads: Uploads | None,
    part: CheckpointPart | None,
    farm: Farm | None,
) -> RenderResult:
    """Read the stage at one time or at several, and render it."""
    if config.target_error is not None and shutter_samples > 1:
        raise ConfigError("a target error works with one shutter sample only: drop the shutter samples, or set spp")
    from warpmis.usd import load_stage  # here, so that a Scene can be rendered without pxr

    reporter.phase("load")
    if farm is not None and isinstance(stage, str | os.PathLike) and os.path.exists(stage):
        farm.source = os.path.abspath(stage), {**options, "width": config.width}

    def scene_at(code: float | None) -> Scene:
        at = options if code is None else {**options, "time": code}
        scene = load_stage(stage, width=config.width, **at)
        if "motion" not in config.aov:
            return scene
        later = load_stage(stage, width=config.width, **{**options, "time": scene.time + 1.0})
        return dataclasses.replace(scene, next_frame=later)

    scene = scene_at(None)
    opens, closes = scene.camera.shutter
    if opens < closes and shutter_samples > 1:
        shown = reporter.progress, uploads or Uploads(), reporter.preview, part, farm
        return render_shutter(scene, scene_at, config, shutter_samples, features, *shown)
    if opens < closes:
        note = "the camera's shutter is open, but one shutter sample gives no motion blur: ask for more"
        scene = dataclasses.replace(scene, notes=(*scene.notes, note))
    return render_scene(scene, config, features, reporter, uploads, part, farm)


def _scene_as_read(scene: Scene, config: RenderConfig, options: dict[str, Any]) -> Scene:
    """The scene at the width asked for, its picture's aspect kept.

    Raises:
        ConfigError: there are options that only a stage can honour.
    """
    if options:
        names = ", ".join(options)
        raise ConfigError(f"a Scene has been read already: give {names} to load_stage, or render the stage itself")
    width = config.width
    if width is None or width == scene.resolution[0]:
        return scene
    height = max(1, round(scene.resolution[1] * width / scene.resolution[0]))
    if width * height > MAX_PIXELS:
        raise ConfigError(f"a picture of {width} x {height} pixels is too large: {MAX_PIXELS} pixels are the limit")
    return dataclasses.replace(scene, resolution=(width, height))


def _config(
    config: RenderConfig | None, learn: LearnConfig | None, settings: dict[str, Any], learning: dict[str, Any]
) -> RenderConfig:
    """All settings as one RenderConfig.

    Raises:
        TypeError: the same setting could be meant in two ways.
    """
    if learn is not None and learning:
        names = ", ".join(sorted(learning))
        raise TypeError(f"render() takes either learn or single learn settings, got both: {names}")
    if learning:
        learn = LearnConfig(**learning)
    if learn is not None:
        settings = {**settings, "learn": learn}
    if config is None:
        return RenderConfig(**settings)
    if settings:
        names = ", ".join(sorted(settings))
        raise TypeError(f"render() takes either a config or single settings, got both: {names}")
    return config


def _given(**options: Any) -> dict[str, Any]:
    return {name: value for name, value in options.items() if value is not None}
