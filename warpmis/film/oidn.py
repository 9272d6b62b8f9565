"""Open Image Denoise, by the extra package pyoidn."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpmis.errors import ConfigError

Float32Array = NDArray[np.float32]


def require_oidn() -> None:
    """Raise before a render, not after it, where the package is missing.

    Raises:
        ConfigError: pyoidn is not installed.
    """
    try:
        import pyoidn  # noqa: F401
    except ImportError:
        raise ConfigError("denoising needs Open Image Denoise: pip install 'warpmis[denoise]'") from None


def filter_with_oidn(image: Float32Array, albedo: Float32Array, normal: Float32Array) -> Float32Array:
    """The picture without noise, by its own albedo and normal, taken as they are.

    cleanAux keeps the edges of the auxiliary pictures. Their own noise is small from a few samples on.

    Args:
        image: linear Rec.709, shape (H, W, 3) float32; albedo, normal: the same shape.

    Raises:
        ConfigError: pyoidn is not installed.
    """
    require_oidn()
    import pyoidn

    pictures = [np.ascontiguousarray(np.nan_to_num(one), dtype=np.float32) for one in (image, albedo, normal)]
    color = np.maximum(pictures[0], 0.0)
    result: Float32Array = pyoidn.denoise(
        color, np.clip(pictures[1], 0.0, 1.0), np.clip(pictures[2], -1.0, 1.0), hdr=True, clean_aux=True, quality="high"
    )
    return result
