"""A picture of an allocation: which strategy gets the samples of each pixel.

Red is the BSDF, blue the lights, green a third strategy. Yellow is next-event estimation, in pixels without a mixture.
Colours are mixed by share in Oklab, where equal steps look equal. The primaries differ in lightness too (blue
is dark, red medium, green and yellow light), so that a grey print still orders them.

Reference: Ottosson (2020), "A perceptual color space for image processing".
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from warpmis.errors import WarpmisError
from warpmis.output.tonemap import to_display

# Oklab (L, a, b).
_COLOR = {"bsdf": (0.64, 0.18, 0.10), "light": (0.42, -0.02, -0.16)}
_THIRD_COLOR = (0.86, -0.14, 0.12)
_NEXT_EVENT_COLOR = np.array([0.90, -0.02, 0.15])

# What legends call it.
NEXT_EVENT = "next-event estimation"

_LMS_FROM_LAB = np.array(
    [[1.0, 0.3963377774, 0.2158037573], [1.0, -0.1055613458, -0.0638541728], [1.0, -0.0894841775, -1.2914855480]]
)
_RGB_FROM_LMS = np.array(
    [
        [4.0767416621, -3.3077115913, 0.2309699292],
        [-1.2684380046, 2.6097574011, -0.3413193965],
        [-0.0041960863, -0.7034186147, 1.7076147010],
    ]
)


def balance_map(
    allocation: NDArray[np.floating], strategies: Sequence[str], next_event: NDArray[np.floating] | None = None
) -> NDArray[np.uint8]:
    """Colour every pixel by its shares: rgb = srgb(sum_s a_s primary_s), the sum in Oklab.

    Args:
        allocation: shape (H, W, S), S at most 3, not negative, summing to 1 along the last axis.
        strategies: the S names.
        next_event: share of each pixel's samples that next-event estimation takes in place of the mixture, from 0 to 1,
            shape (H, W); None for none.

    Returns:
        sRGB, shape (H, W, 3) uint8.
    """
    lab = np.asarray(allocation, dtype=np.float64) @ primaries(strategies)
    if next_event is not None:
        left = np.asarray(next_event, dtype=np.float64)[..., None]
        lab = (1.0 - left) * lab + left * _NEXT_EVENT_COLOR
    return _to_srgb(lab)


def sample_shares(
    allocation: NDArray[np.floating], strategies: Sequence[str], next_event: NDArray[np.floating] | None = None
) -> dict[str, float]:
    """Share of all samples that each strategy drew and, where it is known, next-event estimation; summing to 1."""
    left = np.zeros(allocation.shape[:2]) if next_event is None else np.asarray(next_event, np.float64)
    mixed = (1.0 - left)[..., None] * allocation
    shares = {name: float(share) for name, share in zip(strategies, mixed.mean(axis=(0, 1)), strict=True)}
    return shares if next_event is None else {**shares, NEXT_EVENT: float(left.mean())}


def entry_colors(strategies: Sequence[str]) -> dict[str, NDArray[np.uint8]]:
    """The colour of each strategy, and of next-event estimation: sRGB, shape (3,)."""
    colors = _to_srgb(np.vstack([primaries(strategies), _NEXT_EVENT_COLOR]))
    return dict(zip((*strategies, NEXT_EVENT), colors, strict=True))


def primaries(strategies: Sequence[str]) -> NDArray[np.float64]:
    """The strategies' colours in Oklab, shape (S, 3).

    Raises:
        WarpmisError: there is no colour for each.
    """
    colors = [_COLOR.get(name, _THIRD_COLOR) for name in strategies]
    if len(set(colors)) < len(colors):
        names = ", ".join(strategies)
        raise WarpmisError(
            f"a balance map shows bsdf, light and one more strategy, not {names}; ask for none, or fewer"
        )
    return np.array(colors)


def _to_srgb(lab: NDArray[np.float64]) -> NDArray[np.uint8]:
    return to_display((lab @ _LMS_FROM_LAB.T) ** 3 @ _RGB_FROM_LMS.T)
