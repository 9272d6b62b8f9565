"""Pictures within an HTML file: PNG to show, half floats to expose and subtract in the browser."""

from __future__ import annotations

import base64
import zlib

import numpy as np
from numpy.typing import NDArray

from warpmis.output.png import png_bytes

HALF_MAX = 65504.0

# From worse to better, each pair with equal lightness: orange and violet differ to every eye.
DIVERGING = np.array([[166, 76, 0], [240, 172, 96], [245, 245, 245], [172, 164, 214], [76, 40, 130]])

# Efficiency maps end at a factor of 8 either way.
FULL_COLOR_STOPS = 3.0


def png_uri(picture: NDArray[np.uint8]) -> str:
    """sRGB, shape (H, W, 3) uint8, as a data URI."""
    return "data:image/png;base64," + base64.b64encode(png_bytes(picture)).decode("ascii")


def packed(image: NDArray[np.floating]) -> str:
    """Linear radiance, shape (H, W, 3), as base64 of deflated half floats.

    All low bytes come first, then all high ones, which compress far better among themselves.
    """
    finite = np.nan_to_num(np.asarray(image, np.float64), nan=0.0, posinf=HALF_MAX, neginf=0.0)
    half = np.clip(finite, 0.0, HALF_MAX).astype("<f2")
    planes = np.ascontiguousarray(half.reshape(-1).view(np.uint8).reshape(-1, 2).T)
    return base64.b64encode(zlib.compress(planes.tobytes(), 6)).decode("ascii")


def ratio_map(ratio: NDArray[np.floating]) -> NDArray[np.uint8]:
    """False colours of a ratio, shape (H, W): orange below 1, white at 1, violet above; full at 1/8 and 8."""
    tiny = np.finfo(np.float64).tiny
    stops = np.log2(np.clip(np.asarray(ratio, np.float64), tiny, None))
    place = np.clip(stops / FULL_COLOR_STOPS, -1.0, 1.0)
    anchors = np.linspace(-1.0, 1.0, len(DIVERGING))
    channels = [np.interp(place, anchors, DIVERGING[:, channel]) for channel in range(3)]
    return np.stack(channels, axis=-1).round().astype(np.uint8)


def diverging_gradient() -> str:
    """The colours of `ratio_map` from left to right, as CSS."""
    return f"linear-gradient(90deg, {', '.join('rgb({}, {}, {})'.format(*color) for color in DIVERGING)})"


def exposure_for(image: NDArray[np.floating]) -> float:
    """Exposure at which the bright parts of a picture show just below white, to half a stop [stops]."""
    bright = float(np.percentile(np.asarray(image, np.float64).max(axis=-1), 95.0))
    return round(2.0 * np.log2(0.9 / bright)) / 2.0 if bright > 0.0 else 0.0
