"""Motion blur: a picture as the mean of pictures at several times within the shutter's interval."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpmis.config import RenderConfig
from warpmis.device.upload import Uploads
from warpmis.errors import ConfigError, Interrupted
from warpmis.output.cryptomatte import mean_coverage
from warpmis.rendering.checkpoint import CheckpointPart, rendered_or_kept
from warpmis.rendering.cluster import Farm
from warpmis.rendering.preview import Preview
from warpmis.rendering.reporter import ProgressCallback, Reporter
from warpmis.rendering.result import RenderResult
from warpmis.rendering.rounds import render_scene
from warpmis.rendering.stats import RenderStats, StoppingStats
from warpmis.scene import Scene
from warpmis.scene.features import Features

# 2^32 over the golden ratio: each time has random numbers of its own.
SEED_STEP = 2654435769


def render_shutter(
    scene: Scene,
    scene_at: Callable[[float], Scene],
    config: RenderConfig,
    count: int,
    features: Features | None,
    progress: ProgressCallback | None,
    uploads: Uploads,
    preview: Preview | None = None,
    checkpoint: CheckpointPart | None = None,
    farm: Farm | None = None,
) -> RenderResult:
    """The mean of renders at `count` times within the shutter's interval of the scene's camera.

    `scene_at` reads the whole stage at a time code.

    Raises:
        ConfigError: there are fewer samples than times, or a time's are too few for the learn rounds.
        Interrupted: Ctrl-C, after samples were taken; it holds the mean of the times so far.
    """
    results: list[RenderResult] = []
    codes = shutter_times(scene.time, scene.camera.shutter, count)
    parts = divided(config, count)
    before = 0

    def render_time(code: float, part: RenderConfig, reporter: Reporter, own: CheckpointPart | None) -> RenderResult:
        reporter.phase("load", f"time {code:g}")
        return render_scene(scene_at(code), part, features, reporter, uploads, own, farm)

    for index, (code, part) in enumerate(zip(codes, parts, strict=True)):
        reporter = Reporter(progress, before, part.spp / sum(later.spp for later in parts[index:]), preview)

        own = checkpoint and checkpoint.named(f"time {index}")
        try:
            results.append(
                rendered_or_kept(own, partial(render_time, code, part, reporter), is_last=index == count - 1)
            )
        except KeyboardInterrupt as stop:
            results += [stop.result] if isinstance(stop, Interrupted) else []
            if not results:
                raise
            times = f"{len(results)} of {count} times within the shutter"
            result = _over_times(results, config)
            result.settings["interrupted"] = f"with {times}"
            notes = (*result.notes, f"interrupted at time {code:g}: {times} are in the picture")
            raise Interrupted(dataclasses.replace(result, notes=notes)) from None
        before += results[-1].stats["samples"]
    return _over_times(results, config)


def _over_times(results: list[RenderResult], config: RenderConfig) -> RenderResult:
    mean = averaged(results, config)
    settings = mean.settings.copy()
    settings["shutter_samples"] = len(results)
    return dataclasses.replace(mean, settings=settings)


def shutter_times(time: float, shutter: tuple[float, float], count: int) -> list[float]:
    """The middles of `count` equal parts of the shutter's interval about `time` [time code]."""
    opens, closes = shutter
    return [time + opens + (index + 0.5) / count * (closes - opens) for index in range(count)]


def divided(config: RenderConfig, count: int, seed_step: int = SEED_STEP) -> list[RenderConfig]:
    """The settings for each of several renders that make one picture: the samples per pixel are shared out.

    Raises:
        ConfigError: there are fewer samples than times, or a time's are too few for the learn rounds.
    """
    if config.spp < count:
        raise ConfigError(f"{count} times within the shutter need as many samples per pixel, got {config.spp}")
    limit = None if config.time_limit is None else config.time_limit / count
    shares = [config.spp * (index + 1) // count - config.spp * index // count for index in range(count)]
    return [
        dataclasses.replace(config, spp=spp, time_limit=limit, seed=(config.seed + index * seed_step) % 2**32)
        for index, spp in enumerate(shares)
    ]


def averaged(results: list[RenderResult], config: RenderConfig) -> RenderResult:
    """One result of all samples: each picture counts by its number of them, pixel by pixel.

    The renders are strata: what one sample varies by is the mean of the variances within each.
    """
    counts = np.stack([result.samples for result in results]).astype(np.float64)
    total = counts.sum(axis=0)
    weights = np.where(total > 0.0, counts / np.maximum(total, 1.0), 1.0 / len(results))
    # A light in view counts as covered, and where there is nothing else depth and normal are 0.
    hit = weights * np.stack([result.alpha * (result.depth > 0.0) for result in results])
    hit_weights = hit / np.maximum(hit.sum(axis=0), 1e-12)

    def mean(name: str, shares: NDArray[np.float64] = weights) -> NDArray[np.float32]:
        pictures = np.stack([getattr(result, name) for result in results])
        shares = shares.reshape(*shares.shape, *(1,) * (pictures.ndim - shares.ndim))
        return (shares * pictures).sum(axis=0).astype(np.float32)

    def mean_aov(name: str) -> NDArray[np.float32]:
        """Of light: ids and coordinates of surfaces have no mean."""
        if first.aovs[name].shape[2:] != (3,):
            return first.aovs[name]
        pictures = np.stack([result.aovs[name] for result in results])
        return (weights[..., None] * pictures).sum(axis=0).astype(np.float32)

    first = results[0]
    pictures: dict[str, Any] = {name: mean(name) for name in ("image", "alpha", "albedo", "variance", "allocation")}
    pictures |= {name: mean(name, hit_weights) for name in ("normal", "depth")}
    if first.next_event is not None:
        pictures["next_event"] = mean("next_event")
    return dataclasses.replace(
        first,
        **pictures,
        aovs={name: mean_aov(name) for name in first.aovs},
        cryptomatte=mean_coverage([result.cryptomatte for result in results]),
        samples=total.astype(first.samples.dtype),
        round_allocations=(),
        stats=_stats(results),
        settings={**first.settings, "spp": config.spp, "seed": config.seed},
        warnings=tuple(dict.fromkeys(line for result in results for line in result.warnings)),
        notes=tuple(dict.fromkeys(line for result in results for line in result.notes)),
    )


def _stats(results: list[RenderResult]) -> RenderStats:
    """Counts and times are sums; what is no sum is that of the last time."""
    every = [result.stats for result in results]
    seconds = every[-1]["seconds"].copy()
    seconds["load"] = sum(stats["seconds"]["load"] for stats in every)
    seconds["compile"] = sum(stats["seconds"]["compile"] for stats in every)
    seconds["learn"] = sum(stats["seconds"]["learn"] for stats in every)
    seconds["render"] = sum(stats["seconds"]["render"] for stats in every)
    rays = sum(stats["rays"] for stats in every)
    tracing = seconds["learn"] + seconds["render"]
    last = every[-1].copy()
    last["seconds"] = seconds
    last["samples"] = sum(stats["samples"] for stats in every)
    last["rejected_samples"] = sum(stats["rejected_samples"] for stats in every)
    last["rays"] = rays
    last["rays_per_second"] = rays / tracing if tracing > 0.0 else 0.0
    last["compile_seconds"] = sum(stats["compile_seconds"] for stats in every)
    last["kernels_compiled"] = sum(stats["kernels_compiled"] for stats in every)
    if "stopping" in last:
        last["stopping"] = _stopping([stats["stopping"] for stats in every])
    return last


def _stopping(every: list[StoppingStats]) -> StoppingStats:
    """Without an error: that of one time is not the picture's."""
    reasons = [one["reason"] for one in reversed(every) if one["reason"] != "samples"]
    return {"reason": reasons[0] if reasons else "samples", "spp": sum(one["spp"] for one in every)}
