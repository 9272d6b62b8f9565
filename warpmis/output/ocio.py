"""The picture as OpenColorIO's displays show it: a display with one of its views, through OpenImageIO."""

from __future__ import annotations

import os

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray

from warpmis.errors import ConfigError

# The configuration that comes with OpenColorIO, for those who set none by the environment variable OCIO.
BUILT_IN = "ocio://default"
# Names of linear Rec.709, in which pictures are rendered: as OpenImageIO and as common configurations call it.
LINEAR = ("lin_rec709_scene", "lin_rec709", "Linear Rec.709 (sRGB)", "Utility - Linear - sRGB")


def check_view(display: str = "", view: str = "", color_space: str = "") -> tuple[str, str]:
    """The display and the view by these names, "" for the configuration's default; no picture is needed.

    Raises:
        ConfigError: the configuration cannot be read, or has no such display, view or colour space.
    """
    config = oiio.ColorConfig(_path())
    if config.getNumDisplays() == 0 or config.geterror():
        raise ConfigError(f"{_path()}: cannot be read as an OpenColorIO configuration; set the variable OCIO to one")
    displays = list(config.getDisplayNames())
    display = display or config.getDefaultDisplayName()
    if display not in displays:
        raise ConfigError(f"there is no OpenColorIO display '{display}'; choose from {', '.join(displays)}")
    views = list(config.getViewNames(display))
    view = view or config.getDefaultViewName(display)
    if view not in views:
        raise ConfigError(f"the OpenColorIO display '{display}' has no view '{view}'; choose from {', '.join(views)}")
    if color_space and color_space not in config.getColorSpaceNames():
        names = ", ".join(config.getColorSpaceNames())
        raise ConfigError(f"there is no OpenColorIO colour space '{color_space}'; choose from {names}")
    return display, view


def to_view(
    linear: NDArray[np.floating], display: str = "", view: str = "", color_space: str = ""
) -> NDArray[np.uint8]:
    """Encode a picture by a display's view, shape (H, W, 3) uint8.

    Args:
        linear: linear Rec.709, shape (H, W, 3); what is not a number shows black.
        color_space: the configuration's name of what `linear` is in, "" for linear Rec.709.

    Raises:
        ConfigError: as check_view, or the picture cannot be converted.
    """
    display, view = check_view(display, view, color_space)
    largest = float(np.finfo(np.float16).max)  # what a view can tell apart
    pixels = np.nan_to_num(np.asarray(linear, np.float32), nan=0.0, posinf=largest, neginf=0.0)
    pixels = np.clip(pixels, -largest, largest)
    shown = oiio.ImageBufAlgo.ociodisplay(
        oiio.ImageBuf(np.ascontiguousarray(pixels)), display, view, fromspace=color_space or _linear(),
        unpremult=False, colorconfig=_path(),
    )  # fmt: skip
    if shown.has_error:
        raise ConfigError(f"OpenColorIO: {' '.join(shown.geterror().split())}")
    values: NDArray[np.float32] = np.asarray(shown.get_pixels(oiio.FLOAT), np.float32)
    return np.asarray(np.round(np.clip(values, 0.0, 1.0) * np.float32(255.0)), np.uint8)


def _path() -> str:
    return os.environ.get("OCIO") or BUILT_IN


def _linear() -> str:
    """What the configuration calls linear Rec.709; OpenImageIO's own name, which it resolves itself, if it has none."""
    known = set(oiio.ColorConfig(_path()).getColorSpaceNames())
    return next((name for name in LINEAR if name in known), LINEAR[0])
