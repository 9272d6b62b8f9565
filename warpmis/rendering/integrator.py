"""One render in progress on one device: its rounds with learning between them, and what has come of them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpmis.config import RenderConfig
from warpmis.device.film_buffers import download_film
from warpmis.device.footprint import array_bytes, scene_bytes
from warpmis.device.views import FilmView
from warpmis.errors import ConfigError
from warpmis.film.film import Film, spread_out
from warpmis.film.metrics import squared_scale
from warpmis.learn.allocation import NEXT_EVENT
from warpmis.learn.certificate import excess_variance_bound
from warpmis.learn.schedule import Round, schedule
from warpmis.rendering.generating_vector import lattice_length
from warpmis.rendering.tracer import RoundTracer


def allocation_of(config: RenderConfig, width: int, height: int) -> NDArray[np.float32]:
    """The shares before the first round, shape (H * W, S)."""
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

    def solve(self, part: Round) -> None:
        """One step of the method's solver from the moments of the rounds up to this one, for the round to come."""
        self.compiler.wait(self.learner.kernels)
        self.learner.step(self.learned, self.learn_film, self._launch_solver)
        samples = lattice_length(part.following) if part.following else 0
        self.learner.round_to_samples(self.learned, samples, self._launch_solver)
        if self.stride > 1:
            self._spread()

    def _spread(self) -> None:
        """Give all pixels what their cells have learned. Those of the pilot go on with what they have begun with: their
        own samples must not decide."""
        shares = self._of_pixels(self.learned.shares.numpy())
        self.allocation.shares.assign(shares.reshape(self.pixels, -1))
        estimators = self._of_pixels(self.learned.estimators.numpy())
        estimators[:: self.stride, :: self.stride] = NEXT_EVENT
        self.allocation.estimators.assign(estimators.reshape(-1))

    def _of_pixels(self, of_cells: NDArray[Any]) -> NDArray[Any]:
        """An array over the pixels, shape (H, W, ...), from one over the cells, shape (cells, ...)."""
        cells = of_cells.reshape(self.learner.height, self.learner.width, *of_cells.shape[1:])
        pixels = cells.repeat(self.stride, axis=0).repeat(self.stride, axis=1)
        return np.ascontiguousarray(pixels[: self.height, : self.width])

    def _launch_solver(self, kernel: wp.Kernel, inputs: list[Any]) -> None:
        self.launcher.run_over(kernel, self.learner.cells, inputs)

    def download(self) -> tuple[Film, ...]:
        """The samples of the learn rounds, where there are any, and then all others."""
        final = download_film(self.film, self.width, self.height)
        if not self.config.how.learns:
            return (final,)
        learned = download_film(self.learn_film, self.learner.width, self.learner.height)
        return learned.spread_out(self.stride, self.width, self.height), final

    def color_sums(self) -> NDArray[np.float64]:
        """Sum of all samples' radiance so far, shape (H, W, 3)."""
        colors = [self.film.color.numpy().reshape(self.height, self.width, 3)]
        if self.config.how.learns:
            learned = self.learn_film.color.numpy().reshape(self.learner.height, self.learner.width, 3)
            colors.append(spread_out(learned, self.stride, self.width, self.height))
        sums: NDArray[np.float64] = np.sum(colors, axis=0)
        return sums

    def allocation_map(self) -> NDArray[np.float32]:
        """The present shares, shape (H, W, S). Next-event estimation gives every strategy its own equal part.

        Of a pilot's pixels, which go on with next-event estimation, those that their neighbours in the cell have.
        """
        if not self.count:
            return self.start_allocation.reshape(self.height, self.width, -1)
        shares = self._of_pixels(self.learned.shares.numpy())
        shares[self._of_pixels(self.learned.is_next_event())] = np.float32(1.0 / self.count)
        return shares

    def next_event_map(self) -> NDArray[np.bool_]:
        """Which pixels go by next-event estimation, shape (H, W): a pilot's as their neighbours in the cell do."""
        if not self.count:
            return np.ones((self.height, self.width), np.bool_)
        return self._of_pixels(self.learned.is_next_event())

    def next_event_share(self) -> float:
        """Share of the pixels that have next-event estimation: all of them in a render without strategies."""
        return float(self.allocation.is_next_event().mean()) if self.count else 1.0

    def certificate(self, variance: NDArray[np.float32], image: NDArray[np.float32]) -> dict[str, float]:
        """How much of the relative variance other shares could have saved at most, from 0 to 1.

        Of the pixels that share their samples: those that left for next-event estimation are not in it. Empty where
        there was nothing to share, or no round after the last step to tell.
        """
        samples = self.film.accepted.numpy()
        if self.learner.layout.size == 0 or not samples.any():
            return {}
        shares = self.allocation.shares.numpy()
        shared = ~self.allocation.is_next_event().reshape(variance.shape)
        if not shared.any():
            return {}
        excess = excess_variance_bound(self.learner.plain_moments.numpy(), shares, samples)
        excess = np.minimum(excess.reshape(variance.shape), variance)  # none can save more than there is
        scale = np.maximum(squared_scale(image), 1e-30)
        whole = float((variance / scale)[shared].sum())
        return {"excess_variance_bound": float((excess / scale)[shared].sum()) / max(whole, 1e-30)}

    def rays(self) -> int:
        """Rays traced so far: of paths, and for their light samples."""
        return sum(int(film.rays.numpy().sum() + film.shadow_rays.numpy().sum()) for film in self.films)

    @property
    def films(self) -> tuple[FilmView, ...]:
        """The samples of the learn rounds, where there are any, and then all others."""
        return (self.learn_film, self.film) if self.config.how.learns else (self.film,)

    def bytes(self) -> dict[str, Any]:
        """Device memory of the scene by what it is for, and of the picture: films, shares, and what learning keeps."""
        allocations = [self.allocation] if self.stride == 1 else [self.allocation, self.learned]
        decisions = [array for one in allocations for array in (one.shares, one.estimators)]
        picture = array_bytes([*self.films, *decisions, *self.learner.buffers])
        if self.aovs is not None:
            picture += array_bytes([self.aov_view.sample, self.aov_view.on_ray])
        return {"scene": scene_bytes(self.scene), "picture": picture}

    def fill(self) -> None:
        """Take one sample of each pixel that has none, so that what an interrupted render leaves is a whole picture."""
        self.settled = False
        first = Round(0, 1, learn=False)
        self.passing = range(1)
        self.traced = self.samples_taken().reshape(-1) > 0
        if not self.traced.all():
            self._trace_first(first)

    def _trace_first(self, part: Round) -> None:
        view = self._view(part, range(1), range(1), self.stride)
        for passes in self._waves(self._passes(False)):
            self.compiler.wait([one.kernel for one in passes])
            self._trace(passes, view, np.ones(self.pixels, np.int64), lambda samples: None)

    def samples_taken(self) -> NDArray[np.int64]:
        """How many samples each pixel has taken, shape (H, W)."""
        taken: NDArray[np.int64] = np.sum([film.count + film.rejected for film in self.download()], axis=0)
        return taken
