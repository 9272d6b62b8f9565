"""A renderer whose noise and speed are known, to measure with."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np

from warpmis.config import RenderConfig
from warpmis.methods import METHODS
from warpmis.rendering.progress import Progress
from warpmis.rendering.result import RenderResult

WIDTH, HEIGHT = 48, 32
SCENE: Any = SimpleNamespace(resolution=(WIDTH, HEIGHT), camera=SimpleNamespace(path="/World/Cam"))

# A picture that is bright everywhere, so that squared_scale is about its squared luminance.
TRUTH = np.linspace(1.0, 2.0, HEIGHT * WIDTH * 3).reshape(HEIGHT, WIDTH, 3)


@dataclass
class FakeRender:
    """Stands in for warpmis.render: truth + bias + noise / sqrt(spp), after spp * cost seconds.

    Attributes:
        noise: relative standard deviation of one sample, by method.
        cost: seconds of one sample per pixel, by method.
        bias: relative, by max_depth.
        rejected: samples of every call that are not finite.
        denoised_noise: what denoising leaves of the noise of 1 / sqrt(spp).
        denoise_seconds: what it takes, beside the samples.
        slow_after: calls after which everything takes 16 times as long.
    """

    noise: dict[str, float] = field(default_factory=lambda: dict.fromkeys(METHODS, 1.0))
    cost: dict[str, float] = field(default_factory=lambda: dict.fromkeys(METHODS, 0.1))
    bias: dict[int, float] = field(default_factory=dict)
    jitter: float = 0.0
    slow_after: int = 10**9
    calls: int = 0
    rejected: int = 0
    denoised_noise: float = 0.25
    denoise_seconds: float = 0.5

    def __call__(
        self, scene: Any, *, config: RenderConfig, progress: Any = None, denoise: bool = False
    ) -> RenderResult:
        if progress is not None:
            progress(Progress("render", config.spp * WIDTH * HEIGHT, config.spp * WIDTH * HEIGHT, 0, 0.0))
        rng = np.random.default_rng(config.seed)
        noise = rng.standard_normal(TRUTH.shape) * self.noise[config.method] / np.sqrt(config.spp)
        right = 1.0 + self.bias.get(config.max_depth, 0.0)
        image = (TRUTH * (right + noise)).astype(np.float32)
        self.calls += 1
        seconds = config.spp * self.cost[config.method] * (1.0 + self.jitter * rng.random())
        seconds *= 16.0 if self.calls > self.slow_after else 1.0
        learn = 0.5 * seconds if config.method == "murray20" else 0.0
        flat = np.zeros((HEIGHT, WIDTH), np.float32)
        stats: Any = {
            "seconds": {"load": 9.0, "compile": 7.0, "learn": learn, "render": seconds - learn}, "threads": 2,
            "rejected_samples": self.rejected, **({"denoise": {"seconds": self.denoise_seconds}} if denoise else {}),
        }  # fmt: skip
        return RenderResult(
            image=image, alpha=flat, albedo=image, normal=image, depth=flat, samples=flat + config.spp, variance=flat,
            allocation=np.full((HEIGHT, WIDTH, len(config.strategies)), 1.0 / len(config.strategies), np.float32),
            strategies=config.strategies, name="fake.usda", settings=config.to_dict(),
            stats=stats,
            denoised=(TRUTH * (right + self.denoised_noise * noise)).astype(np.float32) if denoise else None,
        )  # fmt: skip
