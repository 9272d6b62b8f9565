"""What a shading node gives over a surface: numbers, a picture, or a primvar, and what arithmetic makes of them.

Arithmetic on numbers is done at once. What is affine in one picture, component by component, stays that picture with
another scale and bias. Everything else is evaluated texel by texel into a new picture of linear floats, if all
pictures are looked up at the same places.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpmis.scene.texture import (
    FIRST_TILE,
    PrimvarLookup,
    Texture,
    TextureLookup,
    Vec4,
    byte_values,
    channel_of,
    mean_of,
)
from warpmis.usd.shapes.primvar import PrimvarColumns, PrimvarRead

FloatArray = NDArray[Any]
Transform = tuple[tuple[float, float, float], tuple[float, float, float]]

# Texels that are evaluated at once: a few MiB for each operand.
BLOCK_TEXELS = 1 << 18
# Texels from side to side of a picture that is drawn from coordinates.
DRAWN = 512
# The largest number that a texel may have.
MOST = 3.0e38


class CannotFold(Exception):
    """Patterns that no single picture can hold; the message says why."""


@dataclass(frozen=True, eq=False)
class Picture:
    """A texture and where it is looked up: the attributes of scene.texture.TextureLookup.

    Attributes:
        is_drawn: whether the texture was made from coordinates, and so fits the wrap modes and size of any other.
    """

    texture: Texture
    column: int
    transform: Transform
    wrap_s: str
    wrap_t: str
    fallback: Vec4 = (0.0, 0.0, 0.0, 1.0)
    is_drawn: bool = False

    def fits(self, other: Picture) -> bool:
        """Whether one picture can stand for both."""
        same = (self.column, self.transform) == (other.column, other.transform)
        same = same and self.texture.tiles.keys() == other.texture.tiles.keys()
        same = same and self.texture.is_udim == other.texture.is_udim
        return same and (self.is_drawn or (self.wrap_s, self.wrap_t) == (other.wrap_s, other.wrap_t))


@dataclass(frozen=True, eq=False)
class Pattern:
    """`scale * source + bias`, shape (n,) each.

    Attributes:
        source: a picture, a primvar, or None for numbers, which are the bias.
        channels: which component of the source each of the n components reads; 0 to 3 are red, green, blue, alpha.
    """

    bias: NDArray[np.float64]
    scale: NDArray[np.float64]
    channels: tuple[int, ...]
    source: Picture | PrimvarRead | None = None

    @property
    def width(self) -> int:
        return len(self.bias)

    @property
    def is_constant(self) -> bool:
        return self.source is None

    @property
    def mean(self) -> NDArray[np.float64]:
        """Shape (n,): a constant's value, a picture's mean, a primvar's where its value is the fallback."""
        if isinstance(self.source, PrimvarRead):
            return self.scale * np.array(self.source.fallback)[list(self.channels)] + self.bias
        if self.source is None:
            return self.bias
        lookup = TextureLookup(self.source.texture, wrap_s="repeat", wrap_t="repeat")
        means = [mean_of(replace(lookup, channels="rgba"[c]), high=np.inf) for c in self.channels]
        return self.scale * np.array(means) + self.bias

    def equals(self, number: float) -> bool:
        """Whether it is this number everywhere."""
        return self.is_constant and bool((self.bias == number).all())

    def picked(self, *components: int) -> Pattern:
        """The pattern of these components, which may repeat."""
        rows = list(components)
        return replace(
            self, bias=self.bias[rows], scale=self.scale[rows], channels=tuple(self.channels[c] for c in rows)
        )

    def resized(self, width: int) -> Pattern:
        """One component for all, the first of more, or zeros for what is missing."""
        if self.width == width:
            return self
        if self.width == 1:
            return self.picked(*[0] * width)
        if self.width > width:
            return self.picked(*range(width))
        return joined([self, constant(np.zeros(width - self.width))])

    def __add__(self, other: Pattern | float) -> Pattern:
        return evaluated(np.add, [self, _pattern(other)], {0, 1})

    def __sub__(self, other: Pattern | float) -> Pattern:
        return evaluated(np.subtract, [self, _pattern(other)], {0, 1})

    def __mul__(self, other: Pattern | float) -> Pattern:
        return evaluated(np.multiply, [self, _pattern(other)], {0, 1})


def constant(values: Any) -> Pattern:
    """A pattern of numbers, shape (n,)."""
    bias = np.atleast_1d(np.asarray(values, np.float64))
    return Pattern(bias, np.zeros(len(bias)), (0,) * len(bias))


def primvar(read: PrimvarRead) -> Pattern:
    width = len(read.fallback)
    return Pattern(np.zeros(width), np.ones(width), tuple(range(width)), read)


def coordinates(column: int) -> Pattern:
    """Texture coordinates themselves, of two components: as a picture, from (0, 0) to (1, 1)."""
    centres = ((np.arange(DRAWN) + 0.5) / DRAWN).astype(np.float32)
    s, t = np.broadcast_arrays(centres[None, :], centres[::-1, None])
    texture = Texture({FIRST_TILE: np.stack([s, t, np.zeros_like(s)], axis=-1)})
    source = Picture(texture, column, ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), "clamp", "clamp", is_drawn=True)
    return Pattern(np.zeros(2), np.ones(2), (0, 1), source)


def of_lookup(lookup: TextureLookup) -> Pattern:
    """The pattern of a lookup: of three components, or of one."""
    channels = (0, 1, 2) if lookup.channels == "rgb" else ("rgba".index(lookup.channels),)
    rows, scale, bias = list(channels), np.array(lookup.scale), np.array(lookup.bias)
    fallback = (np.array(lookup.fallback) - bias) / np.where(scale == 0.0, 1.0, scale)
    source = Picture(lookup.texture, lookup.column, lookup.transform, lookup.wrap_s, lookup.wrap_t, _vec4(fallback))
    return Pattern(bias[rows], scale[rows], channels, source)


def mixed(background: Pattern, foreground: Pattern, share: Pattern) -> Pattern:
    """background (1 - share) + foreground share."""
    if share.equals(0.0):
        return background
    return foreground if share.equals(1.0) else evaluated(_mix, [background, foreground, share], {0, 1, 2})


def _mix(background: FloatArray, foreground: FloatArray, share: FloatArray) -> FloatArray:
    return background * (1.0 - share) + foreground * share


def _pattern(value: Pattern | float) -> Pattern:
    return value if isinstance(value, Pattern) else constant(value)


def joined(parts: Sequence[Pattern]) -> Pattern:
    """The components of several patterns side by side.

    Raises:
        CannotFold: as `evaluated`.
    """
    varying = [part for part in parts if not part.is_constant]
    if all(part.source is varying[0].source for part in varying[1:]):
        return Pattern(
            np.concatenate([part.bias for part in parts]),
            np.concatenate([part.scale for part in parts]),
            tuple(channel for part in parts for channel in part.channels),
            varying[0].source if varying else None,
        )

    def side_by_side(*values: FloatArray) -> FloatArray:
        shape = np.broadcast_shapes(*[value.shape[:-1] for value in values])
        return np.concatenate([np.broadcast_to(value, (*shape, value.shape[-1])) for value in values], axis=-1)

    return evaluated(side_by_side, parts)


def evaluated(function: Callable[..., FloatArray], inputs: Sequence[Pattern], affine: Any = ()) -> Pattern:
    """A function of values, shape (..., n) each, that gives shape (..., m), of patterns.

    Args:
        affine: the places of the inputs in which the function is affine, component by component, whatever the others.

    Raises:
        CannotFold: a primvar goes through what is not affine, or pictures are looked up at different places.
    """
    varying = [place for place, pattern in enumerate(inputs) if not pattern.is_constant]
    with np.errstate(all="ignore"):
        if not varying:
            return constant(_finite(function(*[pattern.bias for pattern in inputs])))
        if len(varying) == 1 and varying[0] in affine:
            return _affine(function, inputs, varying[0])
        return _baked(function, inputs)


def _affine(function: Callable[..., FloatArray], inputs: Sequence[Pattern], place: int) -> Pattern:
    """The function of one input that varies, by its values at 0 and 1."""
    varying = inputs[place]

    def at(number: float) -> NDArray[np.float64]:
        numbers = [np.full(p.width, number) if p is varying else p.bias for p in inputs]
        return np.asarray(function(*numbers), np.float64)

    bias = _finite(at(0.0))
    slope = _finite(at(1.0)) - bias
    source = varying.resized(len(bias)) if varying.width == 1 else varying
    return replace(source, bias=_finite(slope * source.bias + bias), scale=_finite(slope * source.scale))


def _baked(function: Callable[..., FloatArray], inputs: Sequence[Pattern]) -> Pattern:
    sources = [pattern.source for pattern in inputs if pattern.source is not None]
    pictures = [source for source in sources if isinstance(source, Picture)]
    if len(pictures) < len(sources):
        raise CannotFold("a primvar cannot go through it")
    first = min(pictures, key=lambda picture: picture.is_drawn)
    if not all(picture.fits(first) for picture in pictures):
        raise CannotFold("its pictures are looked up at different places")
    # What is outside of a black border reads 0: the function of that is the new bias.
    bordered = "black" in (first.wrap_s, first.wrap_t) and not first.texture.is_udim
    outside = _finite(function(*[pattern.bias for pattern in inputs])) if bordered else np.zeros(1)
    tiles = {}
    for number in first.texture.tiles:
        shapes = [picture.texture.tiles[number].shape[:2] for picture in pictures]
        shape = max(shapes, key=lambda one: one[0] * one[1])
        found = _evaluated_tile(function, inputs, number, shape)
        tiles[number] = _three_wide(found - outside.astype(np.float32) if outside.any() else found)
    fallback = _finite(function(*[_at_fallback(pattern) for pattern in inputs]))
    width = len(fallback)
    outside = np.broadcast_to(outside, width).astype(np.float64)
    texel = np.zeros(4)
    texel[:width] = fallback - outside
    source = replace(first, texture=Texture(tiles, False, first.texture.is_udim), fallback=_vec4(texel))
    return Pattern(outside, np.ones(width), tuple(range(width)), source)


def bordered(pattern: Pattern, outside: NDArray[np.float64]) -> Pattern:
    """A picture's pattern that is `outside`, shape (n,), beyond a border that is black otherwise."""
    source = pattern.source
    if not isinstance(source, Picture) or not outside.any():
        return pattern
    tiles = {
        number: _three_wide(_evaluated_tile(lambda values: values - outside, [pattern], number, pixels.shape[:2]))
        for number, pixels in source.texture.tiles.items()
    }
    width = len(outside)
    shifted = replace(source, texture=Texture(tiles, False, source.texture.is_udim))
    return Pattern(outside, np.ones(width), tuple(range(width)), shifted)


def _at_fallback(pattern: Pattern) -> NDArray[np.float64]:
    source = pattern.source
    if not isinstance(source, Picture):
        return pattern.bias
    return pattern.scale * np.array(source.fallback)[list(pattern.channels)] + pattern.bias


def _evaluated_tile(
    function: Callable[..., FloatArray], inputs: Sequence[Pattern], number: int, shape: tuple[int, int]
) -> NDArray[np.float32]:
    """The function at every texel of a tile, shape (rows, columns, m), some rows at a time."""
    operands = [_operand(pattern, number, shape) for pattern in inputs]
    step = max(BLOCK_TEXELS // shape[1], 1)
    found = None
    for start in range(0, shape[0], step):
        rows = slice(start, min(start + step, shape[0]))
        values = _finite(function(*[operand(rows) for operand in operands]))
        if found is None:
            found = np.empty((*shape, values.shape[-1]), np.float32)
        found[rows] = values
    return np.zeros((*shape, 1), np.float32) if found is None else found


def _operand(pattern: Pattern, number: int, shape: tuple[int, int]) -> Callable[[slice], FloatArray]:
    """What gives some rows of a pattern on one tile, shape (rows, columns, n); numbers as shape (n,)."""
    source = pattern.source
    if not isinstance(source, Picture):
        return lambda rows: pattern.bias.astype(np.float32)
    pixels = source.texture.tiles[number]
    if pixels.shape[:2] != shape:
        pixels = _resampled(pixels, source.texture.is_srgb, shape)
    scale, bias = pattern.scale.astype(np.float32), pattern.bias.astype(np.float32)
    is_srgb = source.texture.is_srgb

    is_plain = bool((scale == 1.0).all() and (bias == 0.0).all())

    def values(rows: slice) -> FloatArray:
        planes = np.stack([linear_channel(pixels[rows], channel, is_srgb) for channel in pattern.channels], axis=-1)
        return planes if is_plain else planes * scale + bias

    return values


def linear_channel(pixels: NDArray[Any], channel: int, is_srgb: bool) -> NDArray[np.float32]:
    """Red, green, blue or alpha (0 to 3) of pixels as a Texture stores them, linear, shape (rows, columns)."""
    place = channel_of(channel, pixels.shape[-1])
    if place < 0:
        return np.ones(pixels.shape[:2], np.float32)
    if pixels.dtype == np.uint8:
        return byte_values(is_srgb and channel < 3).astype(np.float32)[pixels[..., place]]
    return np.asarray(pixels[..., place], np.float32)


def _resampled(pixels: NDArray[Any], is_srgb: bool, shape: tuple[int, int]) -> NDArray[np.float32]:
    """A tile of another size as four linear channels, interpolated between the centres of texels, clamped."""
    channels = 1 if pixels.shape[-1] == 1 else 4
    values = np.stack([linear_channel(pixels, channel, is_srgb) for channel in range(channels)], axis=-1)
    for axis in (0, 1):
        places = np.clip((np.arange(shape[axis]) + 0.5) * values.shape[axis] / shape[axis] - 0.5, 0, None)
        low = np.minimum(places.astype(np.int64), values.shape[axis] - 1)
        high = np.minimum(low + 1, values.shape[axis] - 1)
        share = (places - low).astype(np.float32).reshape((-1, 1, 1) if axis == 0 else (1, -1, 1))
        values = values.take(low, axis) * (1.0 - share) + values.take(high, axis) * share
    return np.ascontiguousarray(values, np.float32)


def _three_wide(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Channels as a Texture has them: two are the first two of three."""
    if values.shape[-1] == 2:
        values = np.concatenate([values, np.zeros_like(values[..., :1])], axis=-1)
    return np.ascontiguousarray(values)


def _finite(values: Any) -> NDArray[Any]:
    """Values with 0 in the place of what no float32 holds, so that no division spoils a picture."""
    found = np.atleast_1d(values)
    with np.errstate(all="ignore"):
        bounded = np.abs(found) <= MOST  # False for what is not a number
    return found if bounded.all() else np.where(bounded, found, 0.0)


def value_of(pattern: Pattern, width: int, columns: PrimvarColumns) -> Any:
    """A pattern as a Material has its inputs: a number or a tuple of three, or a lookup."""
    pattern = pattern.resized(width)
    source = pattern.source
    if source is None:
        return float(pattern.bias[0]) if width == 1 else tuple(pattern.bias.tolist())
    if isinstance(source, PrimvarRead):
        return PrimvarLookup(columns.column(_read(pattern, source)))
    same = len(set(pattern.channels)) == len(set(pattern.scale)) == len(set(pattern.bias)) == 1
    if same:
        return _lookup(source, pattern, "rgba"[pattern.channels[0]])
    if pattern.channels != (0, 1, 2):
        return value_of(_baked(lambda values: values, [pattern]), width, columns)
    return _lookup(source, pattern, "rgb")


def _lookup(source: Picture, pattern: Pattern, channels: str) -> TextureLookup:
    if len(channels) == 1:
        scale, bias = np.full(4, pattern.scale[0]), np.full(4, pattern.bias[0])
    else:
        scale, bias = np.append(pattern.scale, 1.0), np.append(pattern.bias, 0.0)
    fallback = scale * np.array(source.fallback) + bias
    return TextureLookup(
        texture=source.texture,
        column=source.column,
        channels=channels,
        transform=source.transform,
        wrap_s=source.wrap_s,
        wrap_t=source.wrap_t,
        scale=_vec4(scale),
        bias=_vec4(bias),
        fallback=_vec4(fallback),
    )


def _read(pattern: Pattern, source: PrimvarRead) -> PrimvarRead:
    """The primvar with the pattern's arithmetic."""
    plain = pattern.channels == tuple(range(len(source.fallback)))
    if plain and (pattern.scale == 1.0).all() and (pattern.bias == 0.0).all():
        return source
    scale, bias = tuple(pattern.scale.tolist()), tuple(pattern.bias.tolist())
    return replace(source, channels=pattern.channels, scale=scale, bias=bias)


def _vec4(values: NDArray[np.float64]) -> Vec4:
    a, b, c, d = values.tolist()
    return a, b, c, d
