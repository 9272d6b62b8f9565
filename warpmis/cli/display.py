"""How PNGs encode the picture: sRGB, linear values, or a view of an OpenColorIO display."""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpmis.errors import ConfigError

COLOR_CORRECTIONS = ("disabled", "sRGB", "openColorIO")


def add_display_options(group: Any) -> None:
    """usdrecord's option, and which display and view it means."""
    group.add_argument(
        "--color-correction-mode", "--colorCorrectionMode", "-color", choices=COLOR_CORRECTIONS, default="sRGB",
        help="encoding of PNGs: sRGB, disabled for linear values, or openColorIO for a display's view, by the "
        "configuration that the variable OCIO names, or OpenColorIO's own (default: %(default)s)",
    )  # fmt: skip
    group.add_argument(
        "--ocio-display", "--ocioDisplay", metavar="NAME", help="with openColorIO: the display (default: the "
        "configuration's)",
    )  # fmt: skip
    group.add_argument(
        "--ocio-view", "--ocioView", metavar="NAME", help="with openColorIO: the display's view (default: its first)"
    )
    group.add_argument(
        "--ocio-color-space", "--ocioColorSpace", metavar="NAME",
        help="with openColorIO: what the configuration calls the picture's colour space (default: linear Rec.709)",
    )  # fmt: skip


def check_display(arguments: argparse.Namespace) -> None:
    """Refuse now, not after the render, a display that there is not.

    Raises:
        ConfigError: there is no such display, view or colour space, or they are not asked for.
    """
    named = [name for name in ("display", "view", "color_space") if getattr(arguments, f"ocio_{name}")]
    if arguments.color_correction_mode == "openColorIO":
        from warpmis.output.ocio import check_view

        check_view(*_view(arguments))
    elif named:
        raise ConfigError(f"--ocio-{named[0].replace('_', '-')} is for --color-correction-mode openColorIO: give both")


def write_shown(path: str, linear: NDArray[np.floating], arguments: argparse.Namespace) -> None:
    """Write a PNG of a linear Rec.709 picture, shape (H, W, 3)."""
    from warpmis.output.png import write_display_png, write_png

    mode = arguments.color_correction_mode
    if mode != "openColorIO":
        write_png(path, linear, srgb=mode == "sRGB")
        return
    from warpmis.output.ocio import to_view

    write_display_png(path, to_view(linear, *_view(arguments)), srgb=None)


def _view(arguments: argparse.Namespace) -> tuple[str, str, str]:
    return arguments.ocio_display or "", arguments.ocio_view or "", arguments.ocio_color_space or ""
