"""A denoised picture from two independent halves of a render, and its error without a reference.

A neural denoiser sees each half alone. So the noise of one half is independent of what became of the other, and the two
tell how far the result is from the truth: no model of the noise is needed. By the same right the halves say, around
each pixel, how much of the noisy picture belongs into the result.

Sources: Lehtinen et al. (2018), "Noise2Noise": the error against an independent noisy picture is the error against the
truth plus that picture's noise. Rousselle, Manzi, Zwicker (2013), "Robust Denoising using Feature and Color
Information": two half buffers, filtered apart, tell the error. Afra (2025), "Intel Open Image Denoise".
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpmis.film.metrics import LUMINANCE, OUTLIERS, squared_scale

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]

# Standard deviations of the blurs by which pixels learn from their neighbours [pixel].
NOISE_SIGMA = 1.5
BLEND_SIGMA = 2.0
# So many standard errors are taken off the blend weight: noise in the weight must not cost what the blend gains.
CAUTION = 2.0
# Side of the tiles whose spread tells the standard error of the picture's error [pixel].
TILE = 8


@dataclass(frozen=True, eq=False)
class Half:
    """One of two independent renders of the same view, each with half of the samples.

    Attributes:
        image, albedo: linear Rec.709, shape (H, W, 3); normal: mean world normal, shape (H, W, 3). All float32.
    """

    image: Float32Array
    albedo: Float32Array
    normal: Float32Array


# Takes (image, albedo, normal) to a picture with less noise; must not look at anything else.
Filter = Callable[[Float32Array, Float32Array, Float32Array], Float32Array]


@dataclass(frozen=True)
class ErrorEstimate:
    """relMSE of a denoised picture and of the noisy one, as the two halves tell it, without the worst 0.1 % of pixels.

    The denoised picture's may come out below 0 by chance where it is much smaller than the noisy one's.

    Attributes:
        denoised, noisy: relMSE; standard_error: that of `denoised`.
    """

    denoised: float
    noisy: float
    standard_error: float

    @property
    def bound(self) -> float:
        """The relative error (root of relMSE) that the picture stays below with about 95 % confidence.

        Where rare bright pixels carry much of the light the estimate reads low, so this is for display as a bound.
        """
        return float(np.sqrt(max(self.denoised, 0.0) + CAUTION * self.standard_error))


@dataclass(frozen=True, eq=False)
class Denoised:
    """A denoised picture, linear Rec.709, shape (H, W, 3) float32, and the estimate of its error."""

    image: Float32Array
    error: ErrorEstimate


def denoise(first: Half, second: Half, apply: Filter) -> Denoised:
    """The denoised picture of both halves: their filtered mean, with as much of the noisy picture as pays.

    Where the halves say that filtering lost more than the noise was, over the whole picture and beyond doubt, the noisy
    picture itself is returned.
    """
    filtered = [np.asarray(apply(half.image, half.albedo, half.normal), np.float64) for half in (first, second)]
    halves = Halves(
        noisy=np.asarray(first.image, np.float64) / 2.0 + np.asarray(second.image, np.float64) / 2.0,
        noisy_apart=np.asarray(first.image, np.float64) / 2.0 - np.asarray(second.image, np.float64) / 2.0,
        mean=(filtered[0] + filtered[1]) / 2.0,
        mean_apart=(filtered[0] - filtered[1]) / 2.0,
    )
    weight = blend_weight(halves)[..., np.newaxis]
    image = halves.mean + weight * (halves.noisy - halves.mean)
    error = estimate(halves, image, halves.mean_apart + weight * (halves.noisy_apart - halves.mean_apart))
    if error.denoised - CAUTION * error.standard_error > error.noisy:
        return Denoised(halves.noisy.astype(np.float32), ErrorEstimate(error.noisy, error.noisy, error.standard_error))
    return Denoised(image.astype(np.float32), error)


@dataclass(frozen=True, eq=False)
class Halves:
    """Half of the sum and half of the difference of two pictures, noisy and filtered, shape (H, W, 3)."""

    noisy: Float64Array
    noisy_apart: Float64Array
    mean: Float64Array
    mean_apart: Float64Array


def blend_weight(halves: Halves) -> Float64Array:
    """How much of the noisy picture P each pixel of the filtered mean M takes, from 0 to 1, shape (H, W).

    With the halves' differences delta (noisy) and mu (filtered), the weight that minimises the expected error of
    M + v (P - M) around a pixel is

        v = H(|M - P|^2 - delta . (delta - mu)) / H(|M - P|^2)

    H a blur that leaves out the pixel itself: a weight may not depend on what it weighs. Pixels count by the inverse of
    the noise around them, and CAUTION standard errors of v are taken off.
    """
    moved = dot(halves.mean - halves.noisy, halves.mean - halves.noisy)
    noise = dot(halves.noisy_apart, halves.noisy_apart)
    precision = 1.0 / (blur_of_others(moved + noise, NOISE_SIGMA) + 1e-4 * squared_scale(halves.mean) + TINY)
    distance = precision * moved
    gain = distance - precision * dot(halves.noisy_apart, halves.noisy_apart - halves.mean_apart)
    mean_distance = blur_of_others(distance, BLEND_SIGMA) + TINY
    weight = blur_of_others(gain, BLEND_SIGMA) / mean_distance
    # The variance of a mean under Gaussian weights is the mean under their squares, a narrower Gaussian.
    spread = blur_of_others((gain - weight * distance) ** 2, BLEND_SIGMA / np.sqrt(2.0))
    error = np.sqrt(spread / (4.0 * np.pi * BLEND_SIGMA**2)) / mean_distance
    return np.clip(weight - CAUTION * error, 0.0, 1.0)


def estimate(halves: Halves, image: Float64Array, apart: Float64Array) -> ErrorEstimate:
    """relMSE of `image`, whose halves differ by 2 `apart`, from the halves alone.

    A pixel's is (|X - P|^2 + 2 delta . mu_X - |delta|^2) / s. Its mean is that of X's squared error as long as the
    noise of each half is independent of what became of the other.
    """
    scale = squared_scale(image) + TINY
    noise = dot(halves.noisy_apart, halves.noisy_apart) / scale
    error = (dot(image - halves.noisy, image - halves.noisy) + 2.0 * dot(halves.noisy_apart, apart)) / scale - noise
    outliers = np.argsort(noise, axis=None)[noise.size - int(OUTLIERS * noise.size) :]
    kept = np.ones(noise.size, dtype=bool)
    kept[outliers] = False
    tiles = tile_means(np.where(kept.reshape(noise.shape), error, 0.0))
    standard_error = float(tiles.std(ddof=1) / np.sqrt(tiles.size)) if tiles.size > 1 else float(noise.mean())
    return ErrorEstimate(float(error.ravel()[kept].mean()), float(noise.ravel()[kept].mean()), standard_error)


# Keeps a black picture's quotients finite; far below any squared radiance that a picture holds.
TINY = 1e-30


def dot(a: Float64Array, b: Float64Array) -> Float64Array:
    """Sum over the colours of a b, weighted as luminance is, shape (H, W)."""
    return (a * b) @ LUMINANCE


def tile_means(values: Float64Array) -> Float64Array:
    """Means over tiles of TILE x TILE pixels, those at the right and lower edge smaller; shape (tiles,)."""
    rows, columns = (np.arange(0, length, TILE) for length in values.shape)
    sums = np.add.reduceat(np.add.reduceat(values, rows, axis=0), columns, axis=1)
    heights, widths = (np.diff(np.append(at, n)) for at, n in zip((rows, columns), values.shape, strict=True))
    return (sums / np.outer(heights, widths)).ravel()


def blur_of_others(values: Float64Array, sigma: float) -> Float64Array:
    """A Gaussian mean of each pixel's neighbours without the pixel itself; the picture is mirrored at its edges."""
    radius = int(np.ceil(4.0 * sigma))
    kernel = np.exp(-0.5 * (np.arange(-radius, radius + 1) / sigma) ** 2)
    kernel /= kernel.sum()
    blurred = values
    for axis in (0, 1):
        padding = [(radius, radius) if axis == side else (0, 0) for side in (0, 1)]
        padded = np.pad(blurred, padding, mode="symmetric")
        length = values.shape[axis]
        blurred = np.zeros_like(values)
        for shift, share in enumerate(kernel):
            blurred += share * padded.take(range(shift, shift + length), axis=axis)
    centre = kernel[radius] ** 2
    return (blurred - centre * values) / (1.0 - centre)
