"""The pictures of lights: linear Rec.709, or None and one warning."""

from __future__ import annotations

from typing import Any

from warpmis.usd.asset_path import read_asset
from warpmis.usd.color_space import AUTO, space_of
from warpmis.usd.lights.dome_format import LAYOUTS, as_latlong
from warpmis.usd.materials.image import (
    Float32Array,
    PictureError,
    read_picture,
    without_infinities,
    without_invalid_texels,
)
from warpmis.usd.reading import Reading


def read_light_picture(prim: Any, reading: Reading) -> Float32Array | None:
    """The picture of a light's texture:file, shape (rows, columns, 3); None without one or, with a warning, where it
    cannot be read."""
    path = prim.GetPath()
    attribute = prim.GetAttribute("inputs:texture:file")
    asset = read_asset(attribute, reading)
    if asset is None or not asset.path:
        return None
    try:
        if not asset.file:
            raise PictureError(f"{asset.path} does not exist")
        space = space_of(attribute, AUTO, reading)
        pixels, infinite = without_infinities(read_picture(asset.file, space))
        pixels, invalid = without_invalid_texels(pixels)
    except PictureError as error:
        what = "dome" if "Dome" in str(prim.GetTypeName()) else "light"
        reading.warn(path, f"the {what} is rendered in its plain color: {error}")
        return None
    if infinite:
        reading.warn(path, f"{infinite} texels of {asset.path} are infinite; its largest finite value is used there")
    if invalid:
        reading.warn(path, f"{invalid} texels of {asset.path} are negative or not finite; 0 is used there")
    return pixels


def read_dome_picture(prim: Any, reading: Reading) -> Float32Array | None:
    """A dome's picture as a lat-long one."""
    pixels = read_light_picture(prim, reading)
    layout = str(reading.get(prim.GetAttribute("inputs:texture:format"), "automatic"))
    if pixels is None or layout in ("automatic", "latlong"):
        return pixels
    if layout not in LAYOUTS:
        reading.warn(prim.GetPath(), f"texture:format {layout} is not known; the dome is rendered in its plain color")
        return None
    if layout == "cubeMapVerticalCross" and (pixels.shape[0] < 4 or pixels.shape[1] < 3):
        reading.warn(prim.GetPath(), "its picture is not a cross of six faces; the dome is rendered in its plain color")
        return None
    return as_latlong(pixels, layout)
