"""Motion blur: a picture as the mean of pictures at several times within the shutter's interval."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpmis.config import RenderConfig
from warpmis.errors import ConfigError
from warpmis.rendering.result import RenderResult

# 2^32 over the golden ratio: each time has random numbers of its own.
SEED_STEP = 2654435769


def shutter_times(time: float, shutter: tuple[float, float], count: int) -> list[float]:
    """The middles of `count` equal parts of the shutter's interval about `time` [time code]."""
    opens, closes = shutter
    return [time + opens + (index + 0.5) / count * (closes - opens) for index in range(count)]


def divided(config: RenderConfig, count: int) -> list[RenderConfig]:
    """The settings for each time: the samples per pixel are shared out.

    Raises:
        ConfigError: there are fewer samples than times, or a time's are too few for the learn rounds.
    """
    if config.spp < count:
        raise ConfigError(f"{count} times within the shutter need as many samples per pixel, got {config.spp}")
    limit = None if config.time_limit is None else config.time_limit / count
    shares = [config.spp * (index + 1) // count - config.spp * index // count for index in range(count)]
    return [
        dataclasses.replace(config, spp=spp, time_limit=limit, seed=(config.seed + index * SEED_STEP) % 2**32)
        for index, spp in enumerate(shares)
    ]


def averaged(results: list[RenderResult], config: RenderConfig) -> RenderResult:
    """One result of all samples: each picture counts by its number of them, pixel by pixel.

    The times are strata: what one sample varies by is the mean of the variances within each.
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

    first = results[0]
    pictures: dict[str, Any] = {name: mean(name) for name in ("image", "alpha", "albedo", "variance", "allocation")}
    pictures |= {name: mean(name, hit_weights) for name in ("normal", "depth")}
    return dataclasses.replace(
        first,
        **pictures,
        samples=total.astype(first.samples.dtype),
        round_allocations=(),
        stats=_stats(results),
        settings={**first.settings, "spp": config.spp, "seed": config.seed, "shutter_samples": len(results)},
        warnings=tuple(dict.fromkeys(line for result in results for line in result.warnings)),
        notes=tuple(dict.fromkeys(line for result in results for line in result.notes)),
    )


def _stats(results: list[RenderResult]) -> dict[str, object]:
    """Counts and times are summed up, what is no sum is of the last time."""
    every = [result.stats for result in results]
    seconds = {name: sum(stats["seconds"][name] for stats in every) for name in every[0]["seconds"]}
    summed = ("samples", "rejected_samples", "rays", "compile_seconds", "kernels_compiled")
    sums = {name: sum(stats[name] for stats in every) for name in summed}
    traced = seconds["learn"] + seconds["render"]
    speed = sums["rays"] / traced if traced > 0.0 else 0.0
    last = every[-1]
    if "stopping" in last:  # the error of one time is not the picture's
        watched = [stats["stopping"] for stats in every]
        reason = next((told["reason"] for told in reversed(watched) if told["reason"] != "samples"), "samples")
        last = {**last, "stopping": {"reason": reason, "spp": sum(told["spp"] for told in watched)}}
    return {**last, **sums, "seconds": seconds, "rays_per_second": speed}
