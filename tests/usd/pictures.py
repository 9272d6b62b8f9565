"""Picture files that tests write."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO


def write(path: Path, pixels: np.ndarray, kind: str = "float") -> Path:
    """A picture file; pixels shape (rows, columns, channels) in [0, 1], stored as `kind`."""
    rows, columns, channels = pixels.shape
    spec = OpenImageIO.ImageSpec(columns, rows, channels, kind)
    spec["oiio:UnassociatedAlpha"] = 1
    spec["compression"] = "none" if path.suffix != ".jpg" else "jpeg:100"
    output = OpenImageIO.ImageOutput.create(str(path))
    assert output.open(str(path), spec), OpenImageIO.geterror()
    assert output.write_image(np.ascontiguousarray(pixels, np.float32)), output.geterror()
    output.close()
    return path
