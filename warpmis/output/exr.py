"""OpenEXR files: float32 channels of one size, and a header of plain values."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from warpmis.errors import WarpmisError
from warpmis.output.atomic import replacing

Header = dict[str, str | int | float]

_PREFIX = "warpmis:"
_INT_LIMIT = 2**31  # an attribute holds 32 bits with a sign, and wraps around in silence


def write_exr(
    path: str | os.PathLike[str],
    channels: Mapping[str, NDArray[np.floating]],
    header: Mapping[str, str | int | float],
    foreign: Mapping[str, str] | None = None,
) -> None:
    """Write one part, ZIP compressed, with row 0 on top.

    Args:
        path: the file; it appears whole or not at all.
        channels: by name, such as "R" or "albedo.R", each of shape (H, W), stored as float32.
        header: attributes, stored as "warpmis:<name>". Floats keep 32 bits; an int beyond 32 bits is stored as text.
        foreign: attributes of other people's conventions, stored by their own names.
    """
    # OpenEXR ignores strides: given a view, it stores what lies beside it in memory.
    pixels = {name: np.ascontiguousarray(channel, dtype=np.float32) for name, channel in channels.items()}
    shapes = {channel.shape for channel in pixels.values()}
    if len(shapes) != 1 or len(next(iter(shapes))) != 2:
        raise ValueError(f"channels must share one shape (H, W), got {sorted(shapes)}")
    attributes = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        **{_PREFIX + name: _attribute(value) for name, value in header.items()},
        **(foreign or {}),
    }
    with replacing(path) as temporary:
        OpenEXR.File(attributes, pixels).write(temporary)


def read_exr(path: str | os.PathLike[str]) -> tuple[dict[str, NDArray[np.float32]], Header]:
    """Read a file's first part: channels by name, shape (H, W) float32, and its "warpmis:" attributes, unprefixed."""
    if not Path(path).is_file():
        raise WarpmisError(f"{path}: no such file")
    try:
        file = OpenEXR.File(os.fspath(path), separate_channels=True)
        channels = {name: np.asarray(channel.pixels, np.float32) for name, channel in file.channels().items()}
        attributes = file.header()
    except (OSError, RuntimeError) as error:
        raise WarpmisError(f"{path}: cannot be read as OpenEXR: {' '.join(str(error).split())}") from error
    header = {name.removeprefix(_PREFIX): value for name, value in attributes.items() if name.startswith(_PREFIX)}
    return channels, header


def _attribute(value: str | int | float) -> str | int | float:
    if isinstance(value, int) and not -_INT_LIMIT <= value < _INT_LIMIT:
        return str(value)
    return value
