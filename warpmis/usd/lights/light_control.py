"""UsdLux's controls over what a light does, shaping, pictures, multipliers; warnings of those not supported."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import UsdLux

from warpmis.scene.light_control import PLAIN, IesProfile, LightControl, Shaping
from warpmis.usd.asset_path import read_asset
from warpmis.usd.color_space import linear_color
from warpmis.usd.lights.ies import IesError, read_ies
from warpmis.usd.lights.light_picture import read_light_picture
from warpmis.usd.materials.image import PictureError, asset_bytes
from warpmis.usd.reading import Reading

Vector = NDArray[np.float64]

# The lights whose emission UsdLuxShapingAPI shapes here: those with a place.
SHAPED = ("RectLight", "DiskLight", "SphereLight", "CylinderLight")

# Where light groups are authored: our own name, then Karma's, RenderMan's and Arnold's.
GROUP_ATTRIBUTES = (
    "warpmis:lightGroup",
    "inputs:karma:light:lpetag",
    "karma:light:lpetag",
    "primvars:ri:attributes:identifier:lpegroup",
    "ri:attributes:identifier:lpegroup",
    "inputs:ri:light:lightGroup",
    "primvars:arnold:aov",
)

# Largest value of a control, as an angle, an exponent or a factor of radiance: two of them multiply within float32.
MAX_CONTROL = 1e18


def read_control(prim: Any, matrix: Vector, reading: Reading) -> LightControl:
    """What is asked of the light at one place, PLAIN for nothing.

    Args:
        matrix: local to world, USD's row-vector convention, shape (4, 4).
    """
    control = LightControl(
        shaping=read_shaping(prim, matrix, reading),
        picture=read_rect_picture(prim, matrix, reading),
        diffuse=_multiplier(prim, "inputs:diffuse", reading),
        specular=_multiplier(prim, "inputs:specular", reading),
        group=read_group(prim, reading),
    )
    return control if control.asks or control.group else PLAIN


def read_group(prim: Any, reading: Reading) -> str:
    """The key of the light's group, by the first of GROUP_ATTRIBUTES that has one; "" without one."""
    for name in GROUP_ATTRIBUTES:
        attribute = prim.GetAttribute(name)
        value = reading.get(attribute, "") if attribute else ""
        key = str(value[0] if not isinstance(value, str) and len(value) else value).strip()
        if value and key:
            return key
    return ""


def read_rect_picture(prim: Any, matrix: Vector, reading: Reading) -> NDArray[np.float32] | None:
    """A RectLight's picture; seen from where it shines to it stands upright, its left side at the local +X.

    Where the transform mirrors, `RectLight.half_u` is the opposite of the local X, and so is the picture.
    """
    if str(prim.GetTypeName()) != "RectLight":
        return None
    pixels = read_light_picture(prim, reading)
    mirrored = np.linalg.det(matrix[:3, :3]) < 0.0
    return pixels[:, ::-1] if pixels is not None and mirrored else pixels


def read_shaping(prim: Any, matrix: Vector, reading: Reading) -> Shaping | None:
    """An applied ShapingAPI as far as it changes what the light emits; None where it does not.

    A control that is not a number is left out, with a warning.
    """
    if not prim.HasAPI(UsdLux.ShapingAPI) or str(prim.GetTypeName()) not in SHAPED:
        return None
    degrees = _number(prim, "inputs:shaping:cone:angle", 90.0, reading)
    softness = _number(prim, "inputs:shaping:cone:softness", 0.0, reading)
    focus = _number(prim, "inputs:shaping:focus", 0.0, reading)
    attribute = prim.GetAttribute("inputs:shaping:focusTint")
    tint = np.array(linear_color(attribute, reading.get(attribute, (0.0, 0.0, 0.0)), reading), np.float64)
    if not (np.isfinite(tint) & (tint >= 0.0) & (tint < MAX_CONTROL)).all():
        reading.warn(prim.GetPath(), "shaping:focusTint is negative or not finite; black is used")
        tint = np.zeros(3)
    shaping = Shaping(
        to_world=nearest_rotation(matrix[:3, :3].T),
        cone_angle=math.radians(min(max(degrees, 0.0), 180.0)),
        cone_softness=min(max(softness, 0.0), 1.0),
        focus=max(focus, 0.0),
        focus_tint=tint,
        ies=read_profile(prim, reading),
        ies_angle_scale=_number(prim, "inputs:shaping:ies:angleScale", 0.0, reading) or 1.0,
    )
    return shaping if _changes(shaping, str(prim.GetTypeName())) else None


def _changes(shaping: Shaping, type_name: str) -> bool:
    """Whether a shaping changes the light: flat ones emit no further than 90 degrees off their axis anyway."""
    widest = math.pi if type_name in ("SphereLight", "CylinderLight") else math.pi / 2
    focused = shaping.focus > 0.0 and not (shaping.focus_tint == 1.0).all()
    return focused or shaping.cone_angle < widest or shaping.cone_softness > 0.0 or shaping.ies is not None


def read_profile(prim: Any, reading: Reading) -> IesProfile | None:
    """The profile of shaping:ies:file, over its mean intensity where shaping:ies:normalize is on; None without one or,
    with a warning, where it cannot be read."""
    asset = read_asset(prim.GetAttribute("inputs:shaping:ies:file"), reading)
    if asset is None or not asset.path:
        return None
    try:
        if not asset.file:
            raise IesError("it does not exist")
        profile = read_ies(asset_bytes(asset.file).decode("latin-1"))
    except (IesError, PictureError) as error:
        reading.warn(prim.GetPath(), f"the light is rendered without its profile {asset.path}: {error}")
        return None
    mean = profile.mean
    if reading.get(prim.GetAttribute("inputs:shaping:ies:normalize"), False) and mean > 0.0:
        return replace(profile, candela=profile.candela / mean)
    return profile


def _multiplier(prim: Any, name: str, reading: Reading) -> float:
    """A factor on what materials make of the light; 0, with a warning, where it is negative."""
    value = _number(prim, name, 1.0, reading)
    if value < 0.0:
        reading.warn(prim.GetPath(), f"{name} is negative; 0 is used")
    return max(value, 0.0)


def _number(prim: Any, name: str, default: float, reading: Reading) -> float:
    """A scalar attribute; its default, with a warning, where float32 could not hold its products."""
    value = reading.number(prim, name, default)
    if abs(value) <= MAX_CONTROL:
        return value
    what = "not finite" if not math.isfinite(value) else f"beyond {MAX_CONTROL:g}"
    reading.warn(prim.GetPath(), f"{name.removeprefix('inputs:')} is {what}; {default:g} is used")
    return default


def nearest_rotation(linear: Vector) -> Vector:
    """The orthogonal matrix closest to one of shape (3, 3): the axes' directions where there is no shear.

    Reference: Higham (1986), "Computing the Polar Decomposition, with Applications".
    """
    left, _, right = np.linalg.svd(linear)
    return np.asarray(left @ right)


def warn_unhonoured(prim: Any, reading: Reading) -> None:
    """One warning for each thing authored on a light that changes its picture and is not rendered."""
    path = prim.GetPath()
    light = UsdLux.LightAPI(prim)
    found = {
        "shaping (focus, cone, IES)": prim.HasAPI(UsdLux.ShapingAPI) and _shapes_in_vain(prim),
        "shadow color, distance and falloff": prim.HasAPI(UsdLux.ShadowAPI) and _shadows(prim, reading),
        "light filters": bool(reading.targets(light.GetFiltersRel())),
    }
    for feature, present in found.items():
        if present:
            reading.warn(path, f"not supported: {feature}; the light is rendered without")


def _shapes_in_vain(prim: Any) -> bool:
    """Whether an applied ShapingAPI asks for anything of a light that is not shaped."""
    names = ("inputs:shaping:focus", "inputs:shaping:cone:angle", "inputs:shaping:ies:file")
    return str(prim.GetTypeName()) not in SHAPED and any(prim.GetAttribute(name).HasAuthoredValue() for name in names)


def _shadows(prim: Any, reading: Reading) -> bool:
    """Whether an applied ShadowAPI changes the shadows, beside turning them off."""
    definition = prim.GetPrimDefinition()
    names = [name for name in definition.GetPropertyNames() if name.startswith("inputs:shadow:")]
    names.remove("inputs:shadow:enable")
    return any(reading.get(prim.GetAttribute(n)) != definition.GetAttributeFallbackValue(n) for n in names)
