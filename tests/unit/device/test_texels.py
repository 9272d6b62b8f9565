"""Texels as the device has them: every channel that is read, once, in as few bytes as hold its values."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from warpmis.device.texel_views import BLOCK, BYTES, FLOATS, HALVES, NO_CHANNEL, SHORTS, SRGB_BYTES
from warpmis.device.texels import TexelTable, encoding_of, needed_channels, placed_bytes
from warpmis.scene.texture import Texture, TextureLookup

RANDOM = np.random.default_rng(5)


def table_of(*lookups: TextureLookup) -> TexelTable:
    """All of one place."""
    table = TexelTable(needed_channels(lookups))
    table.add(lookup.texture.tiles[1001] for lookup in lookups)
    return table


def lookup(pixels: np.ndarray, channels: str = "rgb") -> TextureLookup:
    return TextureLookup(Texture({1001: pixels}), channels=channels)


def random_bytes(channels: int) -> np.ndarray:
    return RANDOM.integers(0, 256, (6, 9, channels), np.uint8)


# ---- places within a texel ------------------------------------------------------------------------------------------


def test_places_by_hand() -> None:
    """Two colours of bytes with a single channel each in the byte that is left."""
    assert placed_bytes([([0, 1, 2], 1), ([1, 2], 1), ([0, 1, 2], 1)]) == [
        {0: 0, 1: 1, 2: 2}, {1: 3, 2: 7}, {0: 4, 1: 5, 2: 6},
    ]  # fmt: skip
    assert placed_bytes([([0], 1), ([0, 1, 2], 2), ([0], 4)]) == [{0: 10}, {0: 0, 1: 2, 2: 8}, {0: 4}]
    assert placed_bytes([([0, 1, 2, 3], 1)]) == [{0: 0, 1: 1, 2: 2, 3: 3}]
    assert placed_bytes([([-1], 1), ([], 4)]) == [{}, {}]


@pytest.mark.parametrize("seed", range(40))
def test_no_byte_is_used_twice_and_no_channel_crosses_a_word(seed: int) -> None:
    random = np.random.default_rng(seed)
    pictures = []
    for _ in range(random.integers(1, 10)):
        channels = sorted(random.choice(4, random.integers(1, 5), replace=False).tolist())
        pictures.append((channels, int(random.choice([1, 2, 4]))))
    used: set[int] = set()
    for (channels, size), places in zip(pictures, placed_bytes(pictures), strict=True):
        assert sorted(places) == channels
        for byte in places.values():
            own = set(range(byte, byte + size))
            assert not own & used and byte % size == 0 and byte + size <= NO_CHANNEL
            used |= own
    assert max(used) // 4 < sum(-(-len(channels) * size // 4) for channels, size in pictures)


# ---- encodings ------------------------------------------------------------------------------------------------------

HALF_VALUES = RANDOM.normal(size=(5, 7, 3)).astype(np.float16).astype(np.float32)
SHORT_VALUES = (RANDOM.integers(0, 65536, (5, 7, 3)) / 65535.0).astype(np.float32)


@pytest.mark.parametrize(
    ("pixels", "encoding"),
    [
        (random_bytes(3), BYTES), (HALF_VALUES, HALVES), (SHORT_VALUES, SHORTS),
        (np.zeros((2, 2, 1), np.float32), HALVES),
        (RANDOM.random((5, 7, 3)).astype(np.float32), FLOATS), (SHORT_VALUES + np.float32(1e-5), FLOATS),
        (np.full((2, 2, 1), 1e5, np.float32), FLOATS), (-SHORT_VALUES, FLOATS),
        (SHORT_VALUES + np.float32(1.0), FLOATS),
    ],
)  # fmt: skip
def test_the_smallest_encoding_that_holds_every_value(pixels: np.ndarray, encoding: int) -> None:
    assert encoding_of(pixels) == encoding


def test_one_value_in_a_large_picture_decides() -> None:
    pixels = np.zeros((300, 700, 1), np.float32)
    pixels[299, 699] = 0.1
    assert encoding_of(pixels) == FLOATS


# ---- the words ------------------------------------------------------------------------------------------------------


def stored(table: TexelTable, pixels: np.ndarray, row: int, column: int, channel: int) -> float:
    """A channel's value from the words, as the kernels find it, by TileView's description."""
    view = table.view(pixels, False)
    byte = (int(view.places) >> 8 * channel) & 255
    block = (row // BLOCK) * view.blocks + column // BLOCK
    texel = block * BLOCK * BLOCK + (row % BLOCK) * BLOCK + column % BLOCK
    words = table.texels()[view.first + texel * view.stride :]
    raw = words.view(np.uint8)[byte : byte + {FLOATS: 4, HALVES: 2, SHORTS: 2, BYTES: 1}[view.encoding]]
    kind = {FLOATS: np.float32, HALVES: np.float16, SHORTS: np.uint16, BYTES: np.uint8}[view.encoding]
    value = float(raw.view(kind)[0])
    return value / {SHORTS: 65535.0, BYTES: 255.0}.get(view.encoding, 1.0)


def test_every_channel_that_is_read_is_there() -> None:
    """Pictures of all encodings at one place: each texel of each is found by its record."""
    shape = (6, 9)
    pictures = [
        random_bytes(3), random_bytes(4), RANDOM.random((*shape, 3)).astype(np.float32),
        RANDOM.normal(size=(*shape, 3)).astype(np.float16).astype(np.float32),
        (RANDOM.integers(0, 65536, (*shape, 2)) / 65535.0).astype(np.float32),
    ]  # fmt: skip
    table = table_of(*map(lookup, pictures), lookup(pictures[1], "a"), lookup(pictures[4], "a"))
    for pixels in pictures:
        scale = 255.0 if pixels.dtype == np.uint8 else 1.0
        of_channels = [0, 1, 2, 3][: pixels.shape[-1]] if pixels.shape[-1] != 2 else [0, 0, 0, 1]
        for row, column in itertools.product((0, 3, 5), (0, 4, 8)):
            for channel, own in enumerate(of_channels):
                assert stored(table, pixels, row, column, channel) == pytest.approx(
                    pixels[row, column, own] / scale, rel=1e-6
                )


def test_what_nothing_reads_is_not_stored() -> None:
    """Of pictures of bytes eight channels are read: two words a texel. Six rows and nine columns fill 8 x 12."""
    color, packed, normal = random_bytes(3), random_bytes(4), random_bytes(3)
    table = table_of(lookup(color), lookup(packed, "g"), lookup(packed, "b"), lookup(normal))
    assert table.words == 8 * 12 * 2
    rough, metal = random_bytes(1), random_bytes(1)
    assert table_of(*map(lookup, (color, normal)), lookup(rough, "r"), lookup(metal, "r")).words == 8 * 12 * 2
    assert table_of(lookup(packed, "g")).words == 8 * 12
    assert (int(table.view(packed, False).places) & 255) == NO_CHANNEL


def test_the_alpha_of_a_picture_without_one_takes_nothing() -> None:
    pixels = random_bytes(3)
    table = table_of(lookup(pixels, "a"))
    assert table.words == 0 and table.texels().size == 0
    assert int(table.view(pixels, True).places) == 0xFFFFFFFF


def test_bytes_may_be_both_srgb_and_linear() -> None:
    pixels = random_bytes(3)
    table = table_of(lookup(pixels))
    assert (table.view(pixels, True).encoding, table.view(pixels, False).encoding) == (SRGB_BYTES, BYTES)
