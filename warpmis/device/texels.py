"""Pictures as kernels read them: of every texel the channels that some material reads, side by side with those of other
pictures that are looked up at the same places, in blocks of 4 x 4 texels.

Bytes stay bytes. Floats that half precision or 16 bits hold exactly take two bytes, all others four.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpmis.device.texel_views import BLOCK, BYTES, FLOATS, HALVES, NO_CHANNEL, SHORTS, SRGB_BYTES, TileView
from warpmis.scene.texture import Texture, TextureLookup, channel_of

# Bytes of a channel, by encoding.
CHANNEL_BYTES = {BYTES: 1, SRGB_BYTES: 1, HALVES: 2, SHORTS: 2, FLOATS: 4}
WORD = 4

# Texels that are looked at together: what fits into a processor's cache.
CHUNK = 1 << 16

SHORT_MAX = np.float32(65535.0)


@dataclass(frozen=True, eq=False)
class Stack:
    """Pictures of one size whose texels stand side by side.

    Attributes:
        first: their first word; stride: words from texel to texel.
        pictures: each with its encoding and, for each of its channels that is stored, the channel and its first byte.
    """

    first: int
    stride: int
    pictures: list[tuple[NDArray[Any], int, dict[int, int]]]


@dataclass(eq=False)
class TexelTable:
    """Where the pictures of a scene stand.

    Attributes:
        needed: channels that are looked up of each picture, as stored, by the array's identity.
        stacks: in the order of their words; words: how many there are in all.
        placed: of a picture that is in already its stack, encoding and first bytes, by the array's identity.
    """

    needed: Mapping[int, set[int]]
    stacks: list[Stack] = field(default_factory=list)
    words: int = 0
    placed: dict[int, tuple[Stack, int, dict[int, int]]] = field(default_factory=dict)

    def add(self, pictures: Iterable[NDArray[Any]]) -> None:
        """Pictures of one size, looked up at the same places. One that is in already stays where it is."""
        new = list({id(pixels): pixels for pixels in pictures if id(pixels) not in self.placed}.values())
        if not new:
            return
        encodings = [encoding_of(pixels) for pixels in new]
        sizes = [CHANNEL_BYTES[encoding] for encoding in encodings]
        channels = [sorted(self.needed[id(pixels)]) for pixels in new]
        places = placed_bytes(list(zip(channels, sizes, strict=True)))
        ends = [byte + size for of_one, size in zip(places, sizes, strict=True) for byte in of_one.values()]
        stack = Stack(self.words, -(-max(ends, default=0) // WORD), list(zip(new, encodings, places, strict=True)))
        self.stacks.append(stack)
        for pixels, encoding, bytes_of in stack.pictures:
            self.placed[id(pixels)] = stack, encoding, bytes_of
        rows, columns = (-(-side // BLOCK) * BLOCK for side in new[0].shape[:2])
        self.words += rows * columns * stack.stride

    def view(self, pixels: NDArray[Any], is_srgb: bool) -> TileView:
        """The record of a picture that is in."""
        stack, encoding, bytes_of = self.placed[id(pixels)]
        view = TileView()
        view.rows, view.columns, channels = pixels.shape
        view.blocks = -(-view.columns // BLOCK)
        view.encoding = SRGB_BYTES if is_srgb and encoding == BYTES else encoding
        view.first, view.stride = stack.first, stack.stride
        of_channels = [bytes_of.get(channel_of(channel, channels), NO_CHANNEL) for channel in range(4)]
        view.places = sum(byte << 8 * channel for channel, byte in enumerate(of_channels))
        return view

    def texels(self) -> NDArray[np.uint32]:
        """The words of all pictures, shape (n,)."""
        words = np.zeros(self.words, np.uint32)
        for stack in self.stacks:
            if stack.stride:  # 0 where an alpha is looked up in pictures without one
                fill(words, stack)
        return words


def needed_channels(lookups: Iterable[TextureLookup]) -> dict[int, set[int]]:
    """The channels that lookups read of each picture, as it is stored, by the array's identity; -1 for none."""
    needed: dict[int, set[int]] = {}
    for lookup in lookups:
        channels = range(3) if lookup.channels == "rgb" else ["rgba".index(lookup.channels)]
        for pixels in lookup.texture.tiles.values():
            needed.setdefault(id(pixels), set()).update(channel_of(one, pixels.shape[-1]) for one in channels)
    return needed


def tiles_of(textures: Iterable[Texture]) -> Iterator[list[NDArray[Any]]]:
    """Of textures with tiles of the same numbers and sizes, the pictures of each tile."""
    every = list(textures)
    for number in every[0].tiles if every else ():
        yield [texture.tiles[number] for texture in every]


def placed_bytes(pictures: list[tuple[list[int], int]]) -> list[dict[int, int]]:
    """Where each stored channel of each picture has its first byte in a texel's words.

    Colours of bytes stand in one word, since a lookup reads all three. Single channels fill what is left of words: the
    first word with room, the largest parts first.

    Args:
        pictures: stored channels, and bytes that each takes.
    """
    parts = []
    for index, (channels, size) in enumerate(pictures):
        stored = [channel for channel in channels if channel >= 0]
        colors, others = (stored[:3], stored[3:]) if len(stored) >= 3 else ([], stored)
        in_word = WORD // size
        parts += [(index, colors[start : start + in_word], size) for start in range(0, len(colors), in_word)]
        parts += [(index, [channel], size) for channel in others]
    places: list[dict[int, int]] = [{} for _ in pictures]
    used: list[int] = []
    for index, channels, size in sorted(parts, key=lambda part: -len(part[1]) * part[2]):
        total = len(channels) * size
        word = next((w for w, taken in enumerate(used) if -(-taken // size) * size + total <= WORD), len(used))
        used += [0] * (word + 1 - len(used))
        start = -(-used[word] // size) * size
        places[index] |= {channel: word * WORD + start + place * size for place, channel in enumerate(channels)}
        used[word] = start + total
    return places


def encoding_of(pixels: NDArray[Any]) -> int:
    """The smallest encoding that holds every value of a picture, FLOATS by its own bits; BYTES for sRGB ones, too."""
    if pixels.dtype == np.uint8:
        return BYTES
    values = np.ascontiguousarray(pixels).ravel()
    parts = [values[start : start + CHUNK] for start in range(0, values.size, CHUNK)]
    if all(np.array_equal(halves(part).astype(np.float32), part) for part in parts):
        return HALVES
    if all(is_short(part) for part in parts):
        return SHORTS
    return FLOATS


def is_short(values: NDArray[np.float32]) -> bool:
    """Whether all are 16-bit integers over 65535, to a rounding."""
    if not (values.min() >= 0.0 and values.max() <= 1.0):
        return False
    exact = np.rint(values * SHORT_MAX) / SHORT_MAX
    return bool((np.abs(exact - values) <= np.float32(1.2e-7) * values).all())


def halves(values: NDArray[np.float32]) -> NDArray[np.float16]:
    with np.errstate(over="ignore"):  # what is too large becomes infinite, and is not equal
        return values.astype(np.float16)


def fill(words: NDArray[np.uint32], stack: Stack) -> None:
    """Write the texels of a stack, a row of blocks at a time; blocks at the edges are filled up with zeros."""
    rows, columns = stack.pictures[0][0].shape[:2]
    blocks = -(-columns // BLOCK)
    in_row = blocks * BLOCK * BLOCK * stack.stride
    row = np.zeros((BLOCK, blocks * BLOCK, stack.stride * WORD), np.uint8)
    for number in range(-(-rows // BLOCK)):
        above, count = number * BLOCK, min(BLOCK, rows - number * BLOCK)
        row[count:] = 0
        for pixels, encoding, places in stack.pictures:
            some = encoded(pixels[above : above + count], encoding)
            for channel, byte in places.items():
                for part in range(some.shape[-1]):
                    row[:count, :columns, byte + part] = some[..., channel, part]
        in_blocks = row.view(np.uint32).reshape(BLOCK, blocks, BLOCK, stack.stride).swapaxes(0, 1)
        start = stack.first + number * in_row
        words[start : start + in_row] = in_blocks.reshape(-1)


def encoded(pixels: NDArray[Any], encoding: int) -> NDArray[np.uint8]:
    """The bytes of every channel, lowest first, shape (rows, columns, channels, bytes)."""
    if encoding == HALVES:
        values = halves(pixels)
    elif encoding == SHORTS:
        values = np.rint(pixels * SHORT_MAX).astype(np.uint16)
    else:
        values = pixels
    return np.ascontiguousarray(values)[..., np.newaxis].view(np.uint8)
