"""A denoised picture: two independent renders of half the samples each, which also tell the error of what comes out."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from functools import partial

from warpmis.config import RenderConfig
from warpmis.errors import ConfigError, Interrupted
from warpmis.film.denoise import Denoised, Half, denoise
from warpmis.film.oidn import filter_with_oidn, require_oidn
from warpmis.rendering.checkpoint import CheckpointPart, rendered_or_kept
from warpmis.rendering.progress import Progress
from warpmis.rendering.reporter import ProgressCallback
from warpmis.rendering.result import RenderResult
from warpmis.rendering.shutter import averaged, divided
from warpmis.rendering.stats import DenoiseStats

# The second half's seed is the first one's and this: as many bits differ as chance would have it.
SEED_STEP = 2246822519

# Which of the two pictures a target error is for.
TARGET_NOTE = "the target error is the noisy picture's, not the denoised one's, which has a bound of its own"

RenderOne = Callable[[RenderConfig, ProgressCallback | None, CheckpointPart | None], RenderResult]


def render_halves(
    render_one: RenderOne,
    config: RenderConfig,
    progress: ProgressCallback | None,
    checkpoint: CheckpointPart | None = None,
) -> RenderResult:
    """Render twice, and denoise. The noisy picture is the mean of both renders.

    A target error is the noisy picture's. Each half stops at sqrt(2) of it: their mean has half of their variance.

    Raises:
        ConfigError: Open Image Denoise is not installed, or there are too few samples for two renders.
        Interrupted: Ctrl-C, after samples were taken; it holds the noisy picture so far.
    """
    require_oidn()
    if config.spp < 2:
        raise ConfigError("denoising needs two samples per pixel or more: raise spp")
    results: list[RenderResult] = []
    before = 0
    for index, half in enumerate(_halves(config)):
        show = _shown_as_half(progress, index, before)
        own = checkpoint and checkpoint.named(f"half {index}")
        try:
            results.append(rendered_or_kept(own, partial(render_one, half, show), is_last=index == 1))
        except KeyboardInterrupt as stop:
            results += [stop.result] if isinstance(stop, Interrupted) else []
            if not results:
                raise
            result = _noisy(results, config)
            result.settings.setdefault("interrupted", f"with {len(results)} of 2 halves")
            notes = (*result.notes, "the render was interrupted, so the picture is not denoised")
            raise Interrupted(dataclasses.replace(result, notes=notes)) from None
        before += results[-1].stats["samples"]
    start = time.perf_counter()
    denoised = denoise(_half(results[0]), _half(results[1]), filter_with_oidn)
    seconds = time.perf_counter() - start
    result = _noisy(results, config)
    stats = result.stats.copy()
    stats["denoise"] = _stats(denoised, seconds)
    return dataclasses.replace(result, denoised=denoised.image, stats=stats)


def _halves(config: RenderConfig) -> list[RenderConfig]:
    """The settings of the two renders."""
    first, second = divided(config, 2, SEED_STEP)
    if config.target_error is None:
        return [first, second]
    error = min(config.target_error * 2.0**0.5, 1.0)
    return [dataclasses.replace(half, target_error=error) for half in (first, second)]


def _half(result: RenderResult) -> Half:
    return Half(result.image, result.albedo, result.normal)


def _noisy(results: list[RenderResult], config: RenderConfig) -> RenderResult:
    """The picture of all samples."""
    mean = averaged(results, config)
    settings = mean.settings.copy()
    settings["denoise"] = True
    settings["target_error"] = config.target_error
    notes = (*mean.notes, TARGET_NOTE) if config.target_error is not None else mean.notes
    return dataclasses.replace(mean, settings=settings, notes=notes)


def _stats(denoised: Denoised, seconds: float) -> DenoiseStats:
    error = denoised.error
    return {
        "seconds": seconds,
        "relative_error_bound": error.bound,
        "relative_mse": error.denoised,
        "standard_error": error.standard_error,
        "noisy_relative_mse": error.noisy,
    }


def _shown_as_half(progress: ProgressCallback | None, index: int, before: int) -> ProgressCallback | None:
    """The caller's progress function, told of one half as a part of the whole."""
    if progress is None:
        return None

    def show(report: Progress) -> None:
        total = before + report.total * (2 - index) if report.total else 0
        detail = ", ".join(filter(None, (f"half {index + 1}/2", report.detail)))
        # What is compiled is compiled for both, and without a detail there is nothing to compile.
        detail = report.detail if report.phase == "compile" else detail
        progress(dataclasses.replace(report, done=before + report.done, total=total, detail=detail))

    return show
