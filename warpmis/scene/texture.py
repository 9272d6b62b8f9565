"""Material inputs that vary over a surface: pictures looked up by texture coordinates, and primvars.

An input is a number, a colour, or one of the two lookups below; what a lookup reads at the corners of a triangle
stands in scene.Geometry.primvars from its `column` on.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

Vec4 = tuple[float, float, float, float]

# UDIM's number of the tile that holds the coordinates from (0, 0) to (1, 1), also of a picture without tiles.
FIRST_TILE = 1001


# Texels that are counted together.
COUNTED_TOGETHER = 1 << 16

# The floats whose lower 16 bits are 0, those that are not finite as 0, which no texel has.
UPPER_HALVES = np.nan_to_num(
    (np.arange(1 << 16, dtype=np.uint32) << np.uint32(16)).view(np.float32), nan=0.0, posinf=0.0, neginf=0.0
).astype(np.float64)


@dataclass(frozen=True, eq=False)
class Texture:
    """A picture, or the tiles of a UDIM one.

    Attributes:
        tiles: by UDIM number (1001 + column + 10 row) the pixels, shape (rows, columns, channels), row 0 on top:
            uint8 of 255, or float32, finite. Channels: grey; grey and alpha; RGB; RGBA.
        is_srgb: whether the colours of uint8 tiles are sRGB encoded; all other values are linear.
        is_udim: whether the coordinates choose the tile; else there is FIRST_TILE alone.
    """

    tiles: dict[int, NDArray[Any]]
    is_srgb: bool = False
    is_udim: bool = False

    @cached_property
    def _known(self) -> dict[int, tuple[NDArray[np.float64], NDArray[np.float64]]]:
        return {}

    def values(self, channel: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Of red, green, blue or alpha: linear values, shape (n,), and how many texels have each, shape (n,).

        Floats are cut to their upper 16 bits: by less than one part in 128, and 0 and 1 not at all.
        """
        if channel not in self._known:
            self._known[channel] = self._channel_values(channel)
        return self._known[channel]

    def _channel_values(self, channel: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        values, counts = [], []
        for pixels in self.tiles.values():
            place = channel_of(channel, pixels.shape[-1])
            if place < 0:
                values.append(np.ones(1))
                counts.append(np.full(1, pixels[..., 0].size, np.float64))
            elif pixels.dtype == np.uint8:
                counts.append(counted(pixels[..., place], 256))
                values.append(byte_values(self.is_srgb and channel < 3))
            else:
                counts.append(counted(pixels[..., place], 1 << 16))
                values.append(UPPER_HALVES)
        present = np.concatenate(counts) > 0.0
        return np.concatenate(values)[present], np.concatenate(counts)[present]


def counted(pixels: NDArray[Any], bins: int) -> NDArray[np.float64]:
    """How many texels have each byte, or each upper half of a float, shape (rows, columns) to (bins,).

    By some rows at a time, which is many times faster than all at once: what is counted stays in the cache.
    """
    counts = np.zeros(bins, np.int64)
    rows = max(1, COUNTED_TOGETHER // max(1, pixels.shape[1]))
    for first in range(0, len(pixels), rows):
        some = pixels[first : first + rows]
        counts += np.bincount(some.ravel() if bins == 256 else upper_halves(some), minlength=bins)
    return counts.astype(np.float64)


def channel_of(channel: int, channels: int) -> int:
    """Where a picture of 1 to 4 channels stores red, green, blue or alpha (0 to 3); -1 for an alpha of 1."""
    if channel == 3:
        return channels - 1 if channels in (2, 4) else -1
    return channel if channels >= 3 else 0


def upper_halves(values: NDArray[np.float32]) -> NDArray[np.uint32]:
    """The upper 16 bits of floats, shape (n,)."""
    return np.ascontiguousarray(values, np.float32).view(np.uint32).ravel() >> np.uint32(16)


def byte_values(is_srgb: bool) -> NDArray[np.float64]:
    """The linear values of the bytes 0 to 255, shape (256,); of sRGB by IEC 61966-2-1."""
    value = np.arange(256) / 255.0
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4) if is_srgb else value


@dataclass(frozen=True)
class TextureLookup:
    """`scale * texel + bias`, bilinear, at the texture coordinates of the hit; (0, 0) is the picture's lower left.

    Attributes:
        column: of Geometry.primvars where the two texture coordinates begin.
        channels: "rgb", or one of "r", "g", "b", "a".
        transform: rows (a, b, c) of the map s' = a s + b t + c, and of t', applied to the coordinates first.
        wrap_s, wrap_t: beyond [0, 1] one of "black", "clamp", "repeat", "mirror". A UDIM tile is clamped.
        fallback: the result where a UDIM picture has no tile.
    """

    texture: Texture
    column: int = 0
    channels: str = "rgb"
    transform: tuple[tuple[float, float, float], tuple[float, float, float]] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    wrap_s: str = "black"
    wrap_t: str = "black"
    scale: Vec4 = (1.0, 1.0, 1.0, 1.0)
    bias: Vec4 = (0.0, 0.0, 0.0, 0.0)
    fallback: Vec4 = (0.0, 0.0, 0.0, 1.0)

    def scaled(self, factor: float) -> TextureLookup:
        """The lookup whose results are `factor` times these."""
        (a, b, c, d), (e, f, g, h) = self.scale, self.bias
        scale, bias = (factor * a, factor * b, factor * c, d), (factor * e, factor * f, factor * g, h)
        return replace(self, scale=scale, bias=bias)

    def results(self, channel: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """What red, green, blue or alpha of the lookup can be at a texel, shape (n,), and how often, shape (n,).

        What a place without a texel gives counts as one texel.
        """
        values, counts = self.texture.values(channel)
        results = self.scale[channel] * values + self.bias[channel]
        outside = self._outside(channel)
        return np.append(results, outside), np.append(counts, np.ones(len(outside)))

    def _outside(self, channel: int) -> list[float]:
        """What a place without a texel gives, if there are such places."""
        if self.texture.is_udim:
            return [self.fallback[channel]]
        return [self.bias[channel]] if "black" in (self.wrap_s, self.wrap_t) else []

    def share_at_least(self, threshold: float, channel: int) -> float:
        """The share of the texels that a cutout keeps, by the float32 numbers that the device compares."""
        least, scale, bias = np.float32(threshold), np.float32(self.scale[channel]), np.float32(self.bias[channel])
        kept, texels = 0.0, 0.0
        for pixels in self.texture.tiles.values():
            place = channel_of(channel, pixels.shape[-1])
            values, counts = np.ones(1, np.float32), np.array(pixels[..., 0].size)
            if place >= 0 and pixels.dtype == np.uint8:
                values = byte_values(self.texture.is_srgb and channel < 3).astype(np.float32)
                counts = counted(pixels[..., place], 256)
            elif place >= 0:
                values, counts = pixels[..., place], np.array(1)
            kept += float(((scale * values + bias >= least) * counts).sum())
            texels += pixels[..., 0].size
        outside = np.array(self._outside(channel), np.float32)
        return (kept + float((outside >= least).sum())) / (texels + len(outside))


@dataclass(frozen=True)
class PrimvarLookup:
    """The primvar's value, interpolated over the triangle.

    Attributes:
        column: of Geometry.primvars where its value begins: one column for a number, three for a colour.
    """

    column: int


Lookup = TextureLookup | PrimvarLookup


def is_lookup(value: object) -> bool:
    return isinstance(value, TextureLookup | PrimvarLookup)


def mean_of(value: Any, high: float = 1.0, threshold: float = 0.0) -> Any:
    """A constant input as it is; of a lookup the mean over its texels, of a primvar, which is not known, one half.

    Args:
        high: results are clamped to [0, high] first.
        threshold: if above 0, results become 0 below it and 1 from it on.
    """
    if isinstance(value, PrimvarLookup):
        return 0.5

    def mean(channel: int) -> float:
        if threshold > 0.0:
            return value.share_at_least(threshold, channel)
        results, counts = value.results(channel)
        return float(np.average(np.clip(results, 0.0, high), weights=counts))

    if isinstance(value, TextureLookup):
        return tuple(mean(c) for c in range(3)) if value.channels == "rgb" else mean("rgba".index(value.channels))
    return value


def bounds_of(value: Any) -> tuple[float, float]:
    """Least and greatest value of a number input, a lookup within [0, 1]."""
    if isinstance(value, PrimvarLookup):
        return 0.0, 1.0
    if isinstance(value, TextureLookup):
        channels = (0, 1, 2) if value.channels == "rgb" else ("rgba".index(value.channels),)
        results = np.clip(np.concatenate([value.results(channel)[0] for channel in channels]), 0.0, 1.0)
        return float(results.min()), float(results.max())
    return float(value), float(value)
