"""PNG files, to look at."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray

from warpmis.output.atomic import replacing
from warpmis.output.tonemap import to_display

# The chunk IEND without data, and its checksum. Source: W3C, "Portable Network Graphics (PNG) Specification", 11.2.5.
PNG_END = b"\0\0\0\0IEND\xae\x42\x60\x82"


def write_png(
    path: str | os.PathLike[str], linear: NDArray[np.floating], exposure: float = 0.0, *, srgb: bool = True
) -> None:
    """Write a linear Rec.709 image, shape (H, W, 3), as sRGB, or as linear bytes; `exposure` in stops."""
    write_display_png(path, to_display(linear, exposure, srgb=srgb), srgb=srgb)


def write_display_png(path: str | os.PathLike[str], picture: NDArray[np.uint8], *, srgb: bool | None = True) -> None:
    """Write values as they are, shape (H, W, 3) uint8: sRGB, linear, or for None others. The file appears whole or not
    at all."""
    height, width, channels = picture.shape
    spec = oiio.ImageSpec(width, height, channels, "uint8")
    if srgb is not None:
        spec.attribute("oiio:ColorSpace", "srgb_rec709_scene" if srgb else "lin_rec709_scene")
    with replacing(path) as temporary:
        output = oiio.ImageOutput.create("png")
        if output is None:
            raise RuntimeError(oiio.geterror())
        # OpenImageIO reports errors by its return values alone, and a full disk not at all.
        done = output.open(temporary, spec) and output.write_image(np.ascontiguousarray(picture))
        if not (output.close() and done):
            raise OSError(output.geterror())
        if not ends_as_png(temporary):
            raise OSError("No space left on device")


def ends_as_png(path: str) -> bool:
    """Whether a file ends as a PNG file does. Writing goes forwards, so that nothing before it can be missing."""
    with open(path, "rb") as file:
        file.seek(max(0, os.path.getsize(path) - len(PNG_END)))
        return file.read() == PNG_END


def png_bytes(picture: NDArray[np.uint8]) -> bytes:
    """A PNG file's content, of sRGB values, shape (H, W, 3) uint8, for a page that holds its own pictures."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "picture.png"
        write_display_png(path, picture)
        return path.read_bytes()
