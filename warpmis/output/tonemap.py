"""From linear radiance to what a display shows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def to_display(linear: NDArray[np.floating], exposure: float = 0.0, *, srgb: bool = True) -> NDArray[np.uint8]:
    """Encode linear Rec.709 as 8-bit sRGB, or without `srgb` as 8-bit linear values: scale, clip, gamma.

    No tone curve, so that methods compare as they are.

    Reference: IEC 61966-2-1:1999, the transfer function in section 5.2.

    Args:
        linear: shape (..., 3); what is not a number shows black, what is infinite white.
        exposure: factor on the radiance [stops], 2^exposure.

    Returns:
        shape (..., 3) uint8.
    """
    scaled = np.nan_to_num(np.asarray(linear, dtype=np.float64), nan=0.0) * 2.0**exposure
    value = np.clip(scaled, 0.0, 1.0)
    if not srgb:
        return np.round(value * 255.0).astype(np.uint8)
    encoded = np.where(value <= 0.0031308, 12.92 * value, 1.055 * value ** (1.0 / 2.4) - 0.055)
    return np.round(encoded * 255.0).astype(np.uint8)
