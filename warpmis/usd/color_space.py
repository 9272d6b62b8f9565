"""Colour spaces that a stage names: whose a value is, and the value in linear Rec.709.

An attribute's own name counts, else that of the nearest prim with ColorSpaceAPI, its own prim first. Names are Gf's,
and what Blender, MaterialX and the usual OCIO configurations call the same spaces: letters and digits are compared.
Reference: UsdColorSpaceAPI's schema; GfColorSpace.
"""

from __future__ import annotations

import re
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Usd

from warpmis.usd.reading import Reading

FloatArray = NDArray[np.float64]

LINEAR = "lin_rec709_scene"
SRGB = "srgb_rec709_scene"
RAW = "raw"
# No space: the decoder's guess, by the file's format.
AUTO = "auto"

# What stands for each of Gf's spaces elsewhere, in small letters and digits alone.
ALIASES = {
    RAW: "raw data identity unknown none noncolor noncolordata genericdata utilityraw",
    LINEAR: "linear linearrec709 linearrec709srgb linrec709 linrec709srgb linsrgb linearsrgb srgblinear scenelinear "
    "utilitylinearrec709 utilitylinearsrgb linrec709scene linearbt709",
    SRGB: "srgb srgbtexture srgbtx srgbrec709 srgbencodedrec709 srgbencodedrec709srgb srgbencodedrec709texture "
    "srgbdisplay utilitysrgbtexture inputgenericsrgbtexture",
    "lin_ap1_scene": "acescg acesacescg linap1 linearap1 linearacescg",
    "lin_ap0_scene": "aces20651 acesaces20651 linap0 linearap0",
    "srgb_ap1_scene": "srgbap1 srgbencodedap1 srgbencodedap1texture",
    "g22_ap1_scene": "g22ap1 gamma22ap1 gamma22ap1texture gamma22encodedap1 utilitygamma22ap1texture",
    "g18_rec709_scene": "g18rec709 gamma18rec709 gamma18rec709texture gamma18encodedrec709 utilitygamma18rec709texture",
    "g22_rec709_scene": "g22rec709 gamma22rec709 gamma22rec709texture gamma22encodedrec709 utilitygamma22rec709texture",
    "g24_rec709_scene": "g24rec709 gamma24rec709 gamma24rec709texture gamma24encodedrec709 rec709display rec1886 "
    "rec1886rec709display utilitygamma24rec709texture",
    "lin_p3d65_scene": "linp3d65 linearp3d65 lindisplayp3 lineardisplayp3 lineardcip3d65 utilitylinearp3d65",
    "srgb_p3d65_scene": "srgbp3d65 srgbdisplayp3 displayp3 displayp3display srgbencodedp3d65 srgbencodedp3d65texture",
    "lin_rec2020_scene": "linrec2020 linearrec2020 linearbt2020 utilitylinearrec2020",
    "lin_adobergb_scene": "linadobergb linearadobergb utilitylinearadobergb",
    "g22_adobergb_scene": "adobergb g22adobergb gamma22adobergb",
    "lin_ciexyzd65_scene": "linciexyzd65 linearciexyzd65 ciexyz ciexyzd65 ciexyzd65scenereferred",
}
BY_ALIAS = {alias: space for space, aliases in ALIASES.items() for alias in aliases.split()}


def known_space(name: str) -> str | None:
    """Gf's name of a space, RAW for data, AUTO for "auto"; None for one that is not known."""
    if name.lower() == AUTO:
        return AUTO
    found = BY_ALIAS.get(re.sub("[^a-z0-9]", "", name.lower()))
    return found or (name if Gf.ColorSpace.IsValid(name) else None)


def space_of(attribute: Any, otherwise: str, reading: Reading) -> str:
    """The space of an attribute's value, as `known_space` has it; `otherwise` without one and, with a warning, for one
    that is not known."""
    name = str(attribute.GetColorSpace()) or inherited_space(attribute.GetPrim(), reading)
    if not name:
        return otherwise
    found = known_space(name)
    if found is None:
        reading.warn(attribute.GetPath(), f"its color space {name} is not known; {otherwise} is used")
    return found or otherwise


def inherited_space(prim: Any, reading: Reading) -> str:
    """The name that the nearest prim with ColorSpaceAPI gives, the prim itself first; "" without any."""
    while prim and not prim.IsPseudoRoot():
        if prim.HasAPI(Usd.ColorSpaceAPI):
            name = str(reading.get(prim.GetAttribute("colorSpace:name"), ""))
            if name:
                return name
        prim = prim.GetParent()
    return ""


def linear_color(attribute: Any, value: Any, reading: Reading) -> Any:
    """The value of an attribute in linear Rec.709: colours, shape (..., 3 or 4), alpha as it is. What is no colour
    stays as it is."""
    if attribute.GetRoleName() != "Color" or value is None:
        return value
    space = space_of(attribute, LINEAR, reading)
    if space in (LINEAR, RAW, AUTO):
        return value
    colors = np.asarray(value, np.float64)
    return np.concatenate([linear_rec709(colors[..., :3], space), colors[..., 3:]], axis=-1)


def linear_rec709(colors: FloatArray, space: str) -> FloatArray:
    """Colours of one of Gf's spaces in linear Rec.709, shape (..., 3), also beyond the gamut; (..., 1) for grey."""
    linear = linearized(colors, space)
    return linear if colors.shape[-1] == 1 else linear @ to_rec709(space)


def linearized(values: FloatArray, space: str) -> FloatArray:
    """Values without the space's transfer function: a power, with a straight piece near 0 where it has one."""
    described = Gf.ColorSpace(space)
    gamma, bias = described.GetGamma(), described.GetLinearBias()
    if gamma == 1.0:
        return np.asarray(values, np.float64)
    power = ((np.maximum(values, 0.0) + bias) / (1.0 + bias)) ** gamma
    if bias == 0.0:
        return np.asarray(power)
    end, slope = described.GetTransferFunctionParams()
    return np.where(values <= end, values / slope, power)


@cache
def to_rec709(space: str) -> FloatArray:
    """What linear colours of a space, as rows, are multiplied with, shape (3, 3)."""
    target, source = Gf.ColorSpace(LINEAR), Gf.ColorSpace(space)
    return np.array([target.Convert(source, Gf.Vec3f(*axis)).GetRGB() for axis in np.eye(3).tolist()], np.float64)
