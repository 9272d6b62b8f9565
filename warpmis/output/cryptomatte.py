"""Cryptomatte: names as ids of pixels, with how much of each pixel they cover.

Reference: Friedman, Jones (2015), "Fully Automatic ID Mattes with Support for Motion Blur and Transparency"; Psyop,
"Cryptomatte Specification", version 1.2.0.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# The largest shares of a pixel that are stored, two to a layer of four channels.
RANKS = 6
MASK = 0xFFFFFFFF

IdArray = NDArray[np.uint32]
ShareArray = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Coverage:
    """Of each pixel the names that cover most of it.

    Attributes:
        layer: what the names are of, in Cryptomatte's words: "CryptoObject" or "CryptoMaterial".
        names: of all prims or materials of the scene.
        ids: their Cryptomatte ids, the largest share first, 0 where there is none, shape (H, W, RANKS) uint32.
        shares: of the pixel, from 0 to 1, shape (H, W, RANKS) float32.
    """

    layer: str
    names: tuple[str, ...]
    ids: IdArray
    shares: ShareArray


def murmur3(data: bytes, seed: int = 0) -> int:
    """MurmurHash3_x86_32. Reference: Appleby (2011), "MurmurHash3"."""
    state = seed
    whole = len(data) // 4 * 4
    for place in range(0, whole, 4):
        state ^= _scrambled(int.from_bytes(data[place : place + 4], "little"))
        state = (_rotated(state, 13) * 5 + 0xE6546B64) & MASK
    if whole < len(data):
        state ^= _scrambled(int.from_bytes(data[whole:], "little"))
    state ^= len(data)
    state = ((state ^ (state >> 16)) * 0x85EBCA6B) & MASK
    state = ((state ^ (state >> 13)) * 0xC2B2AE35) & MASK
    return state ^ (state >> 16)


def _scrambled(word: int) -> int:
    return (_rotated((word * 0xCC9E2D51) & MASK, 15) * 0x1B873593) & MASK


def _rotated(word: int, bits: int) -> int:
    return ((word << bits) | (word >> (32 - bits))) & MASK


def id_of(name: str) -> int:
    """The name's id: its hash, made the bits of a float32 that is neither 0, subnormal, infinite nor no number."""
    found = murmur3(name.encode())
    exponent = found >> 23 & 0xFF
    return found ^ (1 << 23) if exponent in (0, 0xFF) else found


def attributes(layer: str, names: Iterable[str]) -> dict[str, str]:
    """The header's entries of a layer, its manifest among them."""
    prefix = f"cryptomatte/{murmur3(layer.encode()):08x}"[: len("cryptomatte/") + 7]
    manifest = {name: f"{id_of(name):08x}" for name in sorted(set(names))}
    return {
        f"{prefix}/name": layer,
        f"{prefix}/hash": "MurmurHash3_32",
        f"{prefix}/conversion": "uint32_to_float32",
        f"{prefix}/manifest": json.dumps(manifest, separators=(",", ":")),
    }


def channels(layer: str, ids: IdArray, shares: ShareArray) -> dict[str, NDArray[np.float32]]:
    """The layer's channels. ids, shares: of each pixel, the largest share first, shape (H, W, RANKS)."""
    found = {}
    for rank in range(0, RANKS, 2):
        name = f"{layer}{rank // 2:02}"
        for letters, place in (("RG", rank), ("BA", rank + 1)):
            found[f"{name}.{letters[0]}"] = np.ascontiguousarray(ids[..., place]).view(np.float32)
            found[f"{name}.{letters[1]}"] = shares[..., place]
    return found


def ranked(ids: IdArray, shares: ShareArray) -> tuple[IdArray, ShareArray]:
    """The shares of equal ids in a row added up, and the RANKS largest of each row, shape (n, RANKS) each; of equal
    ones the smaller id is first."""
    order = np.argsort(ids, axis=1, kind="stable")
    ids, shares = np.take_along_axis(ids, order, 1), np.take_along_axis(shares, order, 1)
    place = np.cumsum(np.diff(ids, axis=1, prepend=ids[:, :1]) != 0, axis=1)
    sums, named = np.zeros_like(shares), np.zeros_like(ids)
    np.add.at(sums, (np.arange(len(ids))[:, None], place), shares)
    np.put_along_axis(named, place, ids, 1)
    sums[named == 0] = 0.0
    best = np.argsort(-sums, axis=1, kind="stable")[:, :RANKS]
    top = np.take_along_axis(sums, best, 1)
    return np.where(top > 0.0, np.take_along_axis(named, best, 1), np.uint32(0)), top


def mean_coverage(parts: Sequence[tuple[Coverage, ...]]) -> tuple[Coverage, ...]:
    """Of several renders of one picture, which count alike."""
    layers = []
    for same in zip(*parts, strict=True):
        ids = np.concatenate([one.ids for one in same], axis=-1)
        shares = np.concatenate([one.shares for one in same], axis=-1) * np.float32(1.0 / len(same))
        height, width, count = ids.shape
        top_ids, top_shares = ranked(ids.reshape(-1, count), shares.reshape(-1, count))
        names = tuple(dict.fromkeys(name for one in same for name in one.names))
        shape = (height, width, RANKS)
        layers.append(Coverage(same[0].layer, names, top_ids.reshape(shape), top_shares.reshape(shape)))
    return tuple(layers)
