"""One render in progress on one device: its rounds with learning between them, and what has come of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpmis.cache.maps import CacheMaps
from warpmis.config import RenderConfig
from warpmis.device.film_buffers import download_film
from warpmis.device.footprint import array_bytes, scene_bytes
from warpmis.device.views import FilmView
from warpmis.errors import ConfigError
from warpmis.film.film import Film
from warpmis.film.metrics import squared_scale
from warpmis.learn.certificate import excess_variance_bound
from warpmis.learn.schedule import Round, schedule
from warpmis.rendering.generating_vector import lattice_length
from warpmis.rendering.stats import CacheStats
from warpmis.rendering.tracer import RoundTracer, Target


def allocation_of(config: RenderConfig, width: int, height: int) -> NDArray[np.float32]:
    """The shares before the first round, shape (H * W, S); of a control the coefficients, shape (H * W, 3)."""
    if config.how.allocation == "control":
        return np.zeros((height * width, 3), dtype=np.float32)
    count = len(config.strategies)
    shares: NDArray[np.float32] = np.full(count, 1.0 / count, dtype=np.float32)
    if config.method == "fixed":
        assert config.allocation is not None
        shares = np.asarray(config.allocation, dtype=np.float32)
        if shares.ndim == 3 and shares.shape[:2] != (height, width):
            raise ConfigError(
                f"the allocation map is {shares.shape[1]} x {shares.shape[0]} pixels, the image {width} x {height}; "
                "make them equal"
            )
    elif config.learn.initial_allocation is not None:
        shares = np.asarray(config.learn.initial_allocation, dtype=np.float32)
    return np.ascontiguousarray(np.broadcast_to(shares, (height, width, count)).reshape(-1, count))


class Integrator(RoundTracer):
    """One render in progress on one device."""

    def rounds(self) -> Iterator[Round]:
        """Those of the render; each is traced before the next one is asked for."""
        yield from schedule(self.config)

    def solving_kernels(self, part: Round) -> Sequence[wp.Kernel]:
        """What `solve` launches after this round."""
        return self.learner.kernels

    def solve(self, part: Round) -> None:
        """One step of the method's solver from the moments of the rounds up to this one, for the round to come."""
        self.learner.step(self.shares, self.learn_film, self._launch_solver)
        samples = lattice_length(part.following) if part.following else 0
        self.learner.round_to_samples(self.shares, samples, self._launch_solver)

    def _launch_solver(self, kernel: wp.Kernel, inputs: list[Any]) -> None:
        self.launcher.run_over(kernel, self.pixels, inputs)

    def download(self) -> tuple[Film, ...]:
        """The samples of the learn rounds, where there are any, and then all others."""
        final = download_film(self.film, self.width, self.height)
        if not self.config.how.learns:
            return (final,)
        return download_film(self.learn_film, self.width, self.height), final

    def color_sums(self) -> NDArray[np.float64]:
        """Sum of all samples' radiance so far, shape (H, W, 3)."""
        shape = self.height, self.width, 3
        sums: NDArray[np.float64] = np.sum([film.color.numpy().reshape(shape) for film in self.films], axis=0)
        return sums

    @property
    def strategies(self) -> tuple[str, ...]:
        """Names of what the allocation shares the samples among."""
        return self.config.strategies

    def allocation_map(self) -> NDArray[np.float32]:
        """The present shares, shape (H, W, S)."""
        shares = self.shares.numpy() if self.count else self.start_allocation
        return shares.reshape(self.height, self.width, -1).copy()

    def next_event_map(self) -> NDArray[np.float32] | None:
        """Share of each pixel's samples that next-event estimation takes, shape (H, W); None for a mixture."""
        return None if self.count else np.ones((self.height, self.width), np.float32)

    def cache_maps(self) -> CacheMaps | None:
        """What the spatial cache has learned; None without one."""
        return None

    def cache_stats(self) -> CacheStats | None:
        """How the cache was decided on; None without one."""
        return None

    def certificate(self, variance: NDArray[np.float32], image: NDArray[np.float32]) -> dict[str, float]:
        """How much of the relative variance other shares could have saved at most, from 0 to 1. Empty where there was
        nothing to share, or no round after the last step to tell.
        """
        samples = self.film.accepted.numpy()
        if self.learner.layout.size == 0 or not samples.any():
            return {}
        excess = excess_variance_bound(self.learner.plain_moments.numpy(), self.shares.numpy(), samples)
        excess = np.minimum(excess.reshape(variance.shape), variance)  # none can save more than there is
        scale = np.maximum(squared_scale(image), 1e-30)
        return {"excess_variance_bound": float((excess / scale).sum()) / max(float((variance / scale).sum()), 1e-30)}

    def rays(self) -> int:
        """Rays traced so far: of paths, and for their light samples."""
        return sum(int(film.rays.numpy().sum() + film.shadow_rays.numpy().sum()) for film in self.films)

    @property
    def films(self) -> tuple[FilmView, ...]:
        """The samples of the learn rounds, where there are any, and then all others."""
        return (self.learn_film, self.film) if self.config.how.learns else (self.film,)

    def bytes(self) -> dict[str, Any]:
        """Device memory of the scene by what it is for, and of the picture: films, shares, and what learning keeps."""
        picture = array_bytes([*self.films, self.shares, *self.learner.buffers])
        if self.aovs is not None:
            picture += array_bytes([self.aov_view.sample, self.aov_view.on_ray])
        return {"scene": scene_bytes(self.scene), "picture": picture}

    def fill(self) -> None:
        """Take one sample of each pixel that has none, so that what an interrupted render leaves is a whole picture."""
        first = Round(0, 1, learn=False)
        self.passing = range(1)
        self.traced = self.samples_taken().reshape(-1) > 0
        if not self.traced.all():
            target = self.plain_target()
            self.compiler.wait([target.kernel])
            self._trace(target, self._view(first, range(1), range(1)), lambda samples: None)

    def plain_target(self) -> Target:
        """What an interrupted render's missing pixels are traced by."""
        return self.target_of(Round(0, 1, learn=False))

    def samples_taken(self) -> NDArray[np.int64]:
        """How many samples each pixel has taken, shape (H, W)."""
        taken: NDArray[np.int64] = np.sum([film.count + film.rejected for film in self.download()], axis=0)
        return taken
