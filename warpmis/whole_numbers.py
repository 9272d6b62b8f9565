"""The range of every whole number that a caller can set.

Kernels count in 32 bits: each range ends well before a count or an index could overflow.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpmis.errors import ConfigError

# A picture of 16,384 x 16,384 pixels: a film takes some 150 bytes a pixel, twice.
MAX_PIXELS = 1 << 28

# The EXR's channel of sample counts is float32, which holds whole numbers up to here.
MAX_SPP = 1 << 24


@dataclass(frozen=True)
class Range:
    """What messages call a setting, and its least and greatest value."""

    name: str
    low: int
    high: int


RANGES = {
    "width": Range("image width", 1, MAX_PIXELS),
    "height": Range("image height", 1, MAX_PIXELS),
    "spp": Range("samples per pixel (spp)", 1, MAX_SPP),
    "max_depth": Range("max depth", 0, 1_000_000),
    "seed": Range("seed", 0, 2**32 - 1),
    "threads": Range("threads", 1, 4096),
    "learn_rounds": Range("learn rounds", 1, MAX_SPP),
    "learn_spp": Range("learn samples per pixel a round", 1, MAX_SPP),
    "shutter_samples": Range("shutter samples", 1, 65_536),
    # Of `compare`: a reference has 16 times the samples per pixel of the longest runs, and is rendered in 4 parts.
    "repeats": Range("repeats", 2, 10_000),
    "longest_spp": Range("samples per pixel (spp)", 1, MAX_SPP // 4),
    "reference_spp": Range("reference spp", 8, 4 * MAX_SPP),
}


def checked_integer(setting: str, value: object) -> int:
    """The value as Python's own int, so that NumPy's do not travel into headers and JSON.

    Raises:
        ConfigError: it is no whole number, or not within the setting's range.
    """
    known = RANGES[setting]
    wanted = f"from {known.low} to {known.high}"
    if not isinstance(value, int | np.integer) or isinstance(value, bool):
        raise ConfigError(f"{known.name} must be a whole number {wanted}, got {value!r}")
    number = int(value)
    if not known.low <= number <= known.high:
        raise ConfigError(f"{known.name} must be {wanted}, got {_digits(number)}")
    return number


def _digits(number: int) -> str:
    """A number of any length in a line: Python refuses to spell out those of several thousand digits."""
    return str(number) if abs(number) < 10**30 else f"one of {number.bit_length()} bits"
