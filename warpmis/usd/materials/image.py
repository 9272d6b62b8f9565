"""Pictures as they are stored, or as linear Rec.709: EXR through OpenEXR, everything else through OpenImageIO.

Files are opened by USD's asset resolver, so that a picture inside a usdz package is found too.
"""

from __future__ import annotations

import contextlib
import io
import os
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Ar

from warpmis.usd.color_space import AUTO, LINEAR, RAW, SRGB, linear_rec709

Float32Array = NDArray[np.float32]

EXR_MAGIC = b"\x76\x2f\x31\x01"
EXR_CHANNELS = ("RGBA", "RGB", "YA", "Y")


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture as it is stored.

    Attributes:
        pixels: shape (rows, columns, 1 to 4 channels), row 0 on top: uint8 for 8-bit pictures; else float32, integers
            as a share of their largest. No alpha is multiplied in.
        says_srgb: whether the file's own metadata (ICC profile, EXIF) name sRGB.
    """

    pixels: NDArray[Any]
    says_srgb: bool = False


class PictureError(ValueError):
    """A picture that cannot be opened or decoded; the message says which and why."""


def read_picture(resolved_path: str, space: str = AUTO) -> Float32Array:
    """Decodes the first picture of a file to linear Rec.709, shape (rows, columns, 3), row 0 on top.

    One channel counts as grey, alpha is left out.

    Args:
        space: as `known_space` has it; AUTO takes 8-bit pictures for sRGB, all others for linear.

    Raises:
        PictureError: the file is missing, damaged or of an unknown format.
    """
    pixels = read_stored(resolved_path).pixels
    is_srgb = space == SRGB or (space == AUTO and pixels.dtype == np.uint8)
    return _as_rgb(linear_floats(pixels, SRGB if is_srgb else LINEAR if space == AUTO else space))


def linear_floats(pixels: NDArray[Any], space: str) -> Float32Array:
    """Pixels as stored in linear Rec.709, not negative, shape (rows, columns, 1 to 4); alpha as it is."""
    values = (pixels / 255.0).astype(np.float32) if pixels.dtype == np.uint8 else pixels
    if space in (LINEAR, RAW):
        return values
    colors, alpha = np.split(values, [3 if values.shape[-1] >= 3 else 1], axis=-1)
    linear = srgb_to_linear(colors) if space == SRGB else np.maximum(linear_rec709(colors, space), 0.0)
    return np.concatenate([linear, alpha], axis=-1).astype(np.float32)


def read_stored(resolved_path: str) -> Picture:
    """Decodes the first picture of a file.

    Raises:
        PictureError: the file is missing, damaged or of an unknown format.
    """
    data = asset_bytes(resolved_path)
    suffix = Path(resolved_path).suffix or ".img"
    try:
        picture = Picture(_decode_exr(data)) if data[:4] == EXR_MAGIC else _decode_other(data, suffix)
    except PictureError as error:
        raise PictureError(f"{resolved_path} cannot be decoded: {error}") from None
    if picture.pixels.ndim != 3 or 0 in picture.pixels.shape:
        raise PictureError(f"{resolved_path} holds no pixels")
    return picture


def srgb_to_linear(value: Float32Array) -> Float32Array:
    """The sRGB transfer function's inverse (IEC 61966-2-1), on [0, 1]."""
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4).astype(np.float32)


def without_infinities(pixels: Float32Array) -> tuple[Float32Array, int]:
    """The picture with its largest finite value in place of +inf, and how many texels had one.

    A sun is brighter than half precision can say, and a black one would light nothing.
    """
    infinite = np.isposinf(pixels)
    if not infinite.any():
        return pixels, 0
    largest = np.max(pixels, where=np.isfinite(pixels), initial=np.float32(0.0))
    return np.where(infinite, largest, pixels).astype(np.float32), int(infinite.any(axis=-1).sum())


def without_invalid_texels(pixels: Float32Array) -> tuple[Float32Array, int]:
    """The picture with its texels that are negative or not finite set to 0, and how many there were."""
    invalid = np.asarray(~(np.isfinite(pixels) & (pixels >= 0.0)).all(axis=-1))
    return np.where(invalid[..., None], np.float32(0.0), pixels), int(invalid.sum())


def asset_bytes(resolved_path: str) -> bytes:
    """A file's content, by USD's asset resolver.

    Raises:
        PictureError: it is missing or empty.
    """
    asset = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(resolved_path))
    if not asset:
        raise PictureError(f"{resolved_path} cannot be opened")
    with asset:
        buffer = asset.GetBuffer()
        if not buffer:
            raise PictureError(f"{resolved_path} is empty")
        return bytes(buffer)


def _decode_exr(data: bytes) -> Float32Array:
    """Colour channels of an EXR's first part, shape (rows, columns, channels)."""
    import OpenEXR

    try:
        channels = OpenEXR.File(io.BytesIO(data), separate_channels=True).channels()
        planes = {name.rsplit(".", 1)[-1]: channel.pixels for name, channel in reversed(channels.items())}
    except Exception as error:  # the binding raises RuntimeError, TypeError and others for damaged files
        reason = " ".join(word for word in str(error).split() if "<python_buffer>" not in word)
        raise PictureError(f"damaged OpenEXR file: {reason}") from None
    names = next((names for names in EXR_CHANNELS if set(names) <= set(planes)), "")
    if not names:
        raise PictureError(f"it has neither R, G, B nor Y, only {', '.join(channels)}")
    return np.stack([planes[name] for name in names], axis=-1).astype(np.float32)


def _decode_other(data: bytes, suffix: str) -> Picture:
    """Any format that OpenImageIO knows; its Python binding reads files only, so the bytes pass through one."""
    import OpenImageIO

    handle, name = tempfile.mkstemp(suffix=suffix)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        unaltered = OpenImageIO.ImageSpec()
        unaltered["oiio:UnassociatedAlpha"] = 1
        picture = OpenImageIO.ImageInput.open(name, unaltered)
        if picture is None:
            raise PictureError(_reason(OpenImageIO.geterror()))
        spec = picture.spec()
        eight_bit = str(spec.format) == "uint8"
        profile = str(spec.getattribute("ICCProfile:profile_description") or "")
        says_srgb = profile.startswith("sRGB") or spec.getattribute("Exif:ColorSpace") == 1
        pixels = picture.read_image("uint8" if eight_bit else "float")
        reason = picture.geterror()
        picture.close()
    finally:
        with contextlib.suppress(OSError):
            os.unlink(name)
    if pixels is None:
        raise PictureError(_reason(reason))
    pixels = np.atleast_3d(np.asarray(pixels, np.uint8 if eight_bit else np.float32))
    return Picture(np.ascontiguousarray(pixels[..., :4]), says_srgb)


def _reason(message: Any) -> str:
    """A decoder's message in one line, without the name of the temporary file."""
    words = [word for word in str(message).split() if tempfile.gettempdir() not in word]
    return " ".join(words) or "damaged, or of an unknown format"


def _as_rgb(pixels: Float32Array) -> Float32Array:
    channels = pixels.shape[-1]
    rgb = pixels[..., :3] if channels >= 3 else np.repeat(pixels[..., :1], 3, axis=-1)
    return np.ascontiguousarray(rgb, np.float32)
