"""Whether a picture's file is there and whole: a sequence need not render it again."""

from __future__ import annotations

import os

import OpenImageIO as oiio

from warpmis.output.png import ends_as_png


def is_whole(path: str) -> bool:
    """Whether a file holds a whole picture: one that can be read to its end and was not interrupted.

    By OpenImageIO, since OpenEXR prints what is wrong with a file.
    """
    if not os.path.isfile(path):
        return False
    if path.lower().endswith(".png"):
        return ends_as_png(path)
    file = oiio.ImageInput.open(path)
    if file is None:
        oiio.geterror()  # else it is printed at the end
        return False
    pixels = file.read_image("float")
    is_cut = bool(file.geterror()) or pixels is None
    interrupted = file.spec().getattribute("warpmis:interrupted")
    file.close()
    return not is_cut and interrupted is None
