"""The picture so far: count, mean and spread per pixel, in float64."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]


def spread_out(cells: NDArray[Any], stride: int, width: int, height: int) -> NDArray[Any]:
    """Numbers of cells of stride x stride pixels as those of each one's first pixel, 0 elsewhere; shape (H, W, ...)."""
    pixels = np.zeros((height, width, *cells.shape[2:]), dtype=cells.dtype)
    pixels[::stride, ::stride] = cells
    return pixels


@dataclass(frozen=True, eq=False)
class Film:
    """Sums over the samples of each pixel, row 0 on top.

    Attributes:
        count, rejected: samples taken in, and left out for not being finite, shape (H, W) int64.
        hits: samples whose path met a surface, shape (H, W) int64.
        color, albedo, normal: sums, shape (H, W, 3).
        luminance_mean, luminance_m2: mean and sum of squared deviations of the luminance, shape (H, W).
        depth: sum over the samples that met a surface [scene units], alpha: number of samples that met a surface or a
            visible light, shape (H, W).
        aovs: sums of light that is kept apart, shape (H, W, rows, 3), or of another height and width of 1 for no rows.
    """

    count: NDArray[np.int64]
    rejected: NDArray[np.int64]
    hits: NDArray[np.int64]
    color: Float64Array
    luminance_mean: Float64Array
    luminance_m2: Float64Array
    albedo: Float64Array
    normal: Float64Array
    depth: Float64Array
    alpha: Float64Array
    aovs: Float64Array = field(default_factory=lambda: np.zeros((1, 1, 0, 3)))

    def merge(self, other: Film) -> Film:
        """Both films' samples as one film. Reference: Chan, Golub, LeVeque (1983), equation 2.1."""
        n, m = self.count.astype(np.float64), other.count.astype(np.float64)
        total = np.maximum(n + m, 1.0)
        apart = other.luminance_mean - self.luminance_mean
        return Film(
            count=self.count + other.count,
            rejected=self.rejected + other.rejected,
            hits=self.hits + other.hits,
            color=self.color + other.color,
            luminance_mean=self.luminance_mean + apart * m / total,
            luminance_m2=self.luminance_m2 + other.luminance_m2 + apart**2 * n * m / total,
            albedo=self.albedo + other.albedo,
            normal=self.normal + other.normal,
            depth=self.depth + other.depth,
            alpha=self.alpha + other.alpha,
            aovs=self.aovs + other.aovs,
        )

    def spread_out(self, stride: int, width: int, height: int) -> Film:
        """As samples of the first pixel alone of each cell of stride x stride, the film's pixels being the cells."""
        return Film(**{name: spread_out(sums, stride, width, height) for name, sums in vars(self).items()})

    def image(self) -> NDArray[np.float32]:
        """Mean linear Rec.709 radiance, shape (H, W, 3); black where no sample was taken in."""
        return self._mean(self.color, self.count)

    def variance(self, exposure: float = 1.0) -> NDArray[np.float32]:
        """Unbiased variance of one sample's luminance times `exposure`, shape (H, W); 0 for fewer than two samples.

        The square of a radiance that float32 holds need not fit there: what is beyond its largest number is that.
        """
        variance = self.luminance_m2 / np.maximum(self.count - 1, 1) * exposure**2
        return np.minimum(variance, np.finfo(np.float32).max).astype(np.float32)

    def mean_albedo(self) -> NDArray[np.float32]:
        """Over all samples, those that hit nothing counting as black, shape (H, W, 3)."""
        return self._mean(self.albedo, self.count)

    def mean_normal(self) -> NDArray[np.float32]:
        """World normal averaged over the samples that met a surface, shape (H, W, 3)."""
        return self._mean(self.normal, self.hits)

    def mean_depth(self) -> NDArray[np.float32]:
        """Distance along the viewing axis, over the samples that met a surface, shape (H, W); 0 where none did."""
        return self._mean(self.depth, self.hits)

    def coverage(self) -> NDArray[np.float32]:
        """Share of the samples that hit a surface or a visible light, shape (H, W)."""
        return self._mean(self.alpha, self.count)

    def mean_aov(self, rows: NDArray[np.bool_]) -> NDArray[np.float32]:
        """Mean radiance of the light in some of the rows together, shape (H, W, 3)."""
        return self._mean(self.aovs[:, :, rows].sum(axis=2), self.count)

    @staticmethod
    def _mean(sums: Float64Array, count: NDArray[Any]) -> NDArray[np.float32]:
        divisor = np.maximum(count, 1.0)
        return (sums / (divisor[..., None] if sums.ndim == 3 else divisor)).astype(np.float32)
