"""How different two pictures look when one flips between them, by an extra package."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Flip:
    """FLIP's verdict: the mean from 0 (the same) to 1, and its false colours, sRGB, shape (H, W, 3) uint8."""

    mean: float
    colors: NDArray[np.uint8]


def flip(image: NDArray[np.floating], reference: NDArray[np.floating]) -> Flip | None:
    """HDR-FLIP of two linear Rec.709 pictures; None without the package flip-evaluator.

    Exposures are those that the reference calls for, the viewing distance its default of 67 pixels a degree.

    Reference: Andersson, Nilsson, Shirley, Akenine-Möller (2021).
    """
    try:
        import flip_evaluator
    except ImportError:
        return None
    pictures = [np.clip(np.nan_to_num(picture), 0.0, 65504.0).astype(np.float32) for picture in (reference, image)]
    colors, mean, _ = flip_evaluator.evaluate(*pictures, "HDR")
    return Flip(float(mean), (np.clip(colors, 0.0, 1.0) * 255.0).round().astype(np.uint8))
