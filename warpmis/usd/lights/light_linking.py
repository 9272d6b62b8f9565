"""Light linking: which prims a light reaches, and which stand in its way (collections lightLink and shadowLink)."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import UsdLux

from warpmis.scene import DomeLight, Light, Prim
from warpmis.scene.light_control import PLAIN, LightControl
from warpmis.usd.reading import PxrError, Reading, one_line


def linked_lights(lights: list[Light], prims: list[Prim], reading: Reading) -> tuple[Light, ...]:
    """The lights with what their collections and ShadowAPI say about the prims of the scene."""
    paths = [prim.path for prim in prims]
    linked = [_linked_light(light, paths, reading) for light in lights]
    domes = [light for light in linked if isinstance(light, DomeLight)]
    if len(domes) > 1 and any(dome.control.asks for dome in domes):
        reading.warn(domes[0].path, "not supported: linking and multipliers where there are several domes; left out")
        linked = [replace(light, control=PLAIN) if isinstance(light, DomeLight) else light for light in linked]
    return tuple(linked)


def _linked_light(light: Light, paths: list[str], reading: Reading) -> Light:
    control = _linked(light.path, light.control, paths, reading)
    return light if control is light.control else replace(light, control=control)


def linked_prims(prims: list[Prim], reading: Reading) -> tuple[Prim, ...]:
    """The same for lights made of geometry, whose shadows are those of all prims."""
    paths = [prim.path for prim in prims]
    return tuple(_linked_prim(prim, paths, reading) for prim in prims)


def _linked_prim(prim: Prim, paths: list[str], reading: Reading) -> Prim:
    control = _linked(prim.path, prim.control, paths, reading)
    if control.shadow_casters is not None:
        reading.warn(
            prim.path,
            "not supported: shadow controls of a light made of geometry; its shadows are rendered as they are",
        )
        control = replace(control, shadow_casters=None)
    return prim if control is prim.control else replace(prim, control=control)


def _linked(path: str, control: LightControl, paths: list[str], reading: Reading) -> LightControl:
    prim = reading.stage.GetPrimAtPath(path) if path else None
    if not prim or not prim.HasAPI(UsdLux.LightAPI):
        return control
    authored = map(str, prim.GetAuthoredPropertyNames())
    if not prim.HasAPI(UsdLux.ShadowAPI) and not any(name.startswith("collection:") for name in authored):
        return control
    light = UsdLux.LightAPI(prim)
    reached = members(light.GetLightLinkCollectionAPI(), paths, reading)
    casters = members(light.GetShadowLinkCollectionAPI(), paths, reading)
    if prim.HasAPI(UsdLux.ShadowAPI) and not reading.get(UsdLux.ShadowAPI(prim).GetShadowEnableAttr(), True):
        casters = np.zeros(len(paths), bool)
    if reached is None and casters is None:
        return control
    return replace(control, illuminates=reached, shadow_casters=casters)


def members(collection: Any, paths: list[str], reading: Reading) -> NDArray[np.bool_] | None:
    """Which of the paths a collection holds, shape (len(paths),); None for all."""
    excludes = reading.targets(collection.GetExcludesRel(), "nothing is excluded by it")
    reading.targets(collection.GetIncludesRel(), "nothing is included by it")
    reading.get(collection.GetExpansionRuleAttr())
    everything = reading.get(collection.GetIncludeRootAttr(), True)
    if everything and not excludes:
        return None
    try:
        query = collection.ComputeMembershipQuery()
    except PxrError as error:
        reading.warn(collection.GetCollectionPath(), f"it counts as holding everything: {one_line(error)}")
        return None
    held = np.array([query.IsPathIncluded(path) for path in paths], bool)
    return None if held.all() else held
