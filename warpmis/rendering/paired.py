"""A render whose pixels learn how next-event estimation's two samples are joined (kernels/path/weighted_pair.py).

What is learned comes from a pilot with random numbers of its own, and none of its samples are in the picture. So the
picture's samples lie on one lattice, as those of next-event estimation do: samples of several small lattices would add
more noise than they take off.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from warpmis.device.film_buffers import download_film
from warpmis.device.views import RoundView
from warpmis.film.film import Film
from warpmis.film.metrics import LUMINANCE
from warpmis.learn.schedule import Round, schedule
from warpmis.rendering.integrator import Integrator

PILOT_SEED = 0x5EC0DDA7


class PairIntegrator(Integrator):
    """One render in progress, with weights or coefficients of the two samples."""

    def rounds(self) -> Iterator[Round]:
        """The pilot, and the picture."""
        for part in schedule(self.config):
            if part.learn:
                yield replace(part, is_kept=False, label="pilot")
        yield Round(0, self.config.spp, learn=False)

    def trace(
        self, part: Round, advance: Callable[[int], None], piece: range | None = None, samples: range | None = None
    ) -> None:
        super().trace(part, advance if part.is_kept else lambda count: None, piece, samples)

    def _view(self, part: Round, piece: range, samples: range) -> RoundView:
        view = super()._view(part, piece, samples)
        if part.learn:
            view.seed = (self.config.seed + PILOT_SEED) % 2**32
        return view

    # ---- results ----------------------------------------------------------------------------------------------------

    def download(self) -> tuple[Film, ...]:
        """The samples of the picture."""
        return (download_film(self.film, self.width, self.height),)

    def color_sums(self) -> NDArray[np.float64]:
        """Sum of the picture's samples' radiance so far, shape (H, W, 3)."""
        sums: NDArray[np.float64] = self.film.color.numpy().reshape(self.height, self.width, 3)
        return sums.copy()  # a CPU's is the film itself

    def allocation_map(self) -> NDArray[np.float32]:
        """Each technique's part, shape (H, W, S), of sum 1: of the weights; or of the optimal coefficients, half the
        pixel's luminance with the control's coefficient taken from `bsdf` and added to `light`, from 0 to 1."""
        if self.config.how.allocation == "weights":
            return super().allocation_map()
        coefficient = self.shares.numpy().reshape(self.height, self.width, 3) @ LUMINANCE
        samples = np.maximum(self.samples_taken(), 1)
        luminance = np.maximum(self.color_sums() @ LUMINANCE / samples, 1e-30)
        of_light = np.clip(0.5 + coefficient / luminance, 0.0, 1.0)
        parts = {"light": of_light, "bsdf": 1.0 - of_light}
        found: NDArray[np.float32] = np.stack([parts[name] for name in self.strategies], axis=2, dtype=np.float32)
        return found

    def certificate(self, variance: NDArray[np.float32], image: NDArray[np.float32]) -> dict[str, float]:
        """There are no shares to be better ones."""
        return {}
