"""The host half of learn/pooling.py: one render's buffers, and the passes over rows and columns."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from warpmis.device.views import FilmView
from warpmis.kernels.moments import Layout
from warpmis.learn.pooling import FLOOR, PRIOR, Guide, make_pool, make_relative, make_row_sums
from warpmis.learn.solver import Launch


class Neighbours:
    """What each pixel learns from those around it.

    Attributes:
        pooled: relative moments, pooled, a row of the layout a pixel.
        brightness: each pixel's, to turn what was learned from relative moments into radiance.
    """

    def __init__(self, layout: Layout, radius: int, size: tuple[int, int], device: str) -> None:
        self.layout, self.radius = layout, radius
        self.width, self.height = size
        self.relative, self.row_sums, self.pool_line = make_relative(layout), make_row_sums(layout), make_pool(layout)
        pixels = self.width * self.height
        self.guides = wp.zeros(pixels, dtype=Guide, device=device)
        self.pooled, self.row_pooled = (wp.zeros(pixels, dtype=layout.relative_vec, device=device) for _ in range(2))
        self.weights, self.row_weights = (wp.zeros(pixels, dtype=wp.float32, device=device) for _ in range(2))
        self.brightness = wp.zeros(pixels, dtype=wp.float32, device=device)
        self.sums = wp.zeros(self.height, dtype=layout.relative_vec, device=device)
        self.counts = wp.zeros(self.height, dtype=wp.float32, device=device)

    @property
    def kernels(self) -> list[wp.Kernel]:
        return [self.relative, self.row_sums, self.pool_line]

    @property
    def buffers(self) -> list[wp.array]:
        lines = [self.sums, self.counts]
        own = [self.guides, self.pooled, self.weights, self.brightness]
        return [*own, self.row_pooled, self.row_weights, *lines]

    def pool(self, moments: wp.array, film: FilmView, launch: Launch) -> wp.array:
        """Fill `pooled`, and return it; `film` holds the samples of the moments."""
        total = moments.numpy()[:, self.layout.offset("mean")]
        usable = total[np.isfinite(total)]
        floor = FLOOR * float(usable.sum()) / max(int(film.accepted.numpy().sum()), 1)
        size = [self.width, self.height]
        own, rows = [self.pooled, self.weights], [self.row_pooled, self.row_weights]
        launch(self.relative, [moments, film, *size, floor, *own, self.guides, self.brightness])
        prior = self._prior(film)
        line = [self.guides, *size, self.radius]
        launch(self.pool_line, [*own, *line, 1, self.layout.relative_vec(), 0.0, *rows])
        launch(self.pool_line, [*rows, *line, 0, *prior, *own])
        return self.pooled

    def _prior(self, film: FilmView) -> tuple[Any, float]:
        """The picture's mean relative moments, and how many pixels' samples they count for.

        None where a pixel's own are wanted alone.
        """
        if self.radius == 0:
            return self.layout.relative_vec(), 0.0
        inputs = [self.pooled, self.weights, self.width, self.sums, self.counts]
        wp.launch(self.row_sums, dim=self.height, inputs=inputs, device=self.sums.device)
        lit = float(self.counts.numpy().sum())
        if lit == 0.0:
            return self.layout.relative_vec(), 0.0
        samples = max(int(film.accepted.numpy().max()), 1)
        return self.layout.relative_vec(*(self.sums.numpy().sum(axis=0) / lit)), PRIOR / samples
