"""A picture of an allocation: which strategy gets the samples of each pixel.

Red is the BSDF, blue the lights, green a third strategy. Colours are mixed by share in Oklab, where equal steps look
equal, and the primaries differ in lightness too (blue dark, red medium, green light), so that a grey print still
orders them.

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


def balance_map(allocation: NDArray[np.floating], strategies: Sequence[str]) -> NDArray[np.uint8]:
    """Colour every pixel by its shares: rgb = srgb(sum_s a_s primary_s), the sum in Oklab.

    Args:
        allocation: shape (H, W, S), S at most 3, not negative, summing to 1 along the last axis.
        strategies: the S names.

    Returns:
        sRGB, shape (H, W, 3) uint8.
    """
    lab = np.asarray(allocation, dtype=np.float64) @ primaries(strategies)
    return to_display((lab @ _LMS_FROM_LAB.T) ** 3 @ _RGB_FROM_LMS.T)


def with_legend(picture: NDArray[np.uint8], strategies: Sequence[str]) -> NDArray[np.uint8]:
    """Add a colour bar below: from all of one strategy (left) to all of the next (right), ticks at the quarters.

    Three strategies have three bars side by side: first to second, second to third, third to first.
    """
    height, width, _ = picture.shape
    rows = max(8, height // 24)
    bar = np.repeat(balance_map(_legend_shares(width, len(strategies)), strategies), rows, axis=0)
    bars = 3 if len(strategies) == 3 else 1
    for tick in np.linspace(0, width - 1, 4 * bars + 1).round().astype(int):
        bar[: rows // 3, tick] = 0
    return np.concatenate([picture, np.zeros((1, width, 3), np.uint8), bar])


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


def _legend_shares(width: int, count: int) -> NDArray[np.float64]:
    """Shares along the legend, shape (1, width, count)."""
    corners = np.eye(count)
    stops = np.concatenate([corners, corners[:1]]) if count == 3 else corners
    position = np.linspace(0, len(stops) - 1, width)
    columns = [np.interp(position, np.arange(len(stops)), stops[:, strategy]) for strategy in range(count)]
    return np.stack(columns, axis=-1)[np.newaxis]
