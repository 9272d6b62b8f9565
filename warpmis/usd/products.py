"""RenderProducts: which files a stage's RenderSettings ask for, and which channels of the result go into each."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import PurePosixPath, PureWindowsPath
from typing import Any

import numpy as np
from pxr import Usd, UsdRender

from warpmis.aovs import LIGHT
from warpmis.errors import ConfigError, StageError
from warpmis.path_expression import accepted
from warpmis.usd.messages import Messages
from warpmis.usd.opening import open_stage
from warpmis.usd.reading import Reading, add_diagnostics, captured_diagnostics, composition_warnings
from warpmis.usd.request import checked_source
from warpmis.usd.settings import settings_prim

# What renderers and light path expressions call the pictures that a result has, in lower case.
SOURCES = {
    "color": {"ci", "c.*", "color", "rgb", "rgba", "beauty"},
    "alpha": {"a", "alpha"},
    "depth": {"z", "depth", "cameradepth"},
    "normal": {"n", "nn", "normal", "normals"},
    "albedo": {"albedo", "basecolor"},
    "primId": {"primid"},
    "instanceId": {"instanceid"},
    "elementId": {"elementid"},
    "uv": {"uv", "st", "texcoord"},
    "materialId": {"materialid"},
    "motion": {"motion", "motionvector", "motionvectors"},
    **{name: {name, name.replace("_", ""), "_".join(reversed(name.split("_")))} for name in LIGHT},
}
# The result's channels for each, by the last part of the file's name for them.
CHANNELS = {
    "color": {"R": "R", "G": "G", "B": "B"},
    "alpha": {"A": "A"},
    "depth": {"Z": "Z"},
    "normal": {"X": "N.X", "Y": "N.Y", "Z": "N.Z"},
    "albedo": {"R": "albedo.R", "G": "albedo.G", "B": "albedo.B"},
    "primId": {"primId": "primId"},
    "instanceId": {"instanceId": "instanceId"},
    "elementId": {"elementId": "elementId"},
    "uv": {"U": "uv.U", "V": "uv.V"},
    "materialId": {"materialId": "materialId"},
    "motion": {"X": "motion.X", "Y": "motion.Y"},
    **{name: {letter: f"{name}.{letter}" for letter in "RGB"} for name in LIGHT},
}
# What a render has to be asked for.
AOVS = {"uv", "materialId", "motion", *LIGHT}
# A variable of one of these types brings the coverage along with the colour.
WITH_ALPHA = {"color4f", "color4h", "color4d", "float4", "half4"}


@dataclass(frozen=True)
class Product:
    """One picture to render.

    Attributes:
        path: the RenderProduct prim's.
        file: the file's name, without a folder, ending in .exr or .png.
        channels: the file's channels and which of the result's each is; None for all as RenderResult.write has them.
        warnings: what of it is not supported.
        aovs: what the render has to be asked for, as RenderConfig.aov.
    """

    path: str
    file: str
    channels: dict[str, str] | None
    warnings: tuple[str, ...] = ()
    aovs: tuple[str, ...] = ()


def read_products(
    path_or_stage: Any,
    *,
    render_settings: str | None = None,
    time: float | None = None,
    variants: Sequence[str] = (),
    mask: Sequence[str] = (),
    session_layer: str | os.PathLike[str] | None = None,
) -> tuple[Product, ...]:
    """The products of the stage's RenderSettings, named as at one time.

    Raises:
        StageError: the stage cannot be opened, or has no RenderSettings or no products of type raster.
    """
    warnings = Messages()
    try:
        with captured_diagnostics() as messages, np.errstate(all="ignore"):
            stage = open_stage(checked_source(path_or_stage), variants, mask, session_layer)
            code = Usd.TimeCode(stage.GetStartTimeCode() if time is None else time)
            return _read_all(Reading(stage, code, frozenset(), 0, warnings=warnings), render_settings)
    except StageError as error:
        add_diagnostics(messages, warnings)
        raise error.explained_by(tuple(warnings)) from None


def _read_all(reading: Reading, render_settings: str | None) -> tuple[Product, ...]:
    stage = reading.stage
    composition_warnings(reading, {})
    settings = settings_prim(stage, render_settings)
    if settings is None:
        raise StageError("the stage has no RenderSettings, and so no products", stage.GetRootLayer().GetDisplayName())
    products = []
    for target in reading.targets(settings.GetProductsRel(), "it is not rendered"):
        prim = stage.GetPrimAtPath(target)
        if prim and prim.IsA(UsdRender.Product):
            products.append(_read(UsdRender.Product(prim), replace(reading, warnings=Messages())))
        elif prim:
            reading.warn(settings.GetPath(), f"its product {target} is not a RenderProduct prim")
    if not products:
        raise StageError("these RenderSettings have no products", str(settings.GetPath()))
    return tuple(products)


def _read(product: Any, reading: Reading) -> Product:
    path = str(product.GetPath())
    kind = reading.get(product.GetProductTypeAttr(), "raster")
    if kind != "raster":
        reading.warn(path, f"productType {kind} is not supported; a raster is rendered")
    file = _file_name(product, reading)
    channels: dict[str, str] = {}
    aovs: list[str] = []
    targets = reading.targets(product.GetOrderedVarsRel(), "it is left out")
    for target in targets:
        found = _variable(reading.stage.GetPrimAtPath(target), str(target), reading)
        channels |= found.channels
        aovs += found.aovs
    if targets and not channels:
        reading.warn(path, "none of its variables is supported; all channels are written")
    return Product(path, file, channels or None, tuple(reading.warnings), tuple(dict.fromkeys(aovs)))


def _file_name(product: Any, reading: Reading) -> str:
    """The last part of productName: where the file goes is for the caller to say, not for the stage."""
    name = str(reading.get(product.GetProductNameAttr(), ""))
    last = PurePosixPath(PureWindowsPath(name).name).name
    if last in ("", ".", ".."):
        return f"{product.GetPrim().GetName()}.exr"
    if not last.lower().endswith((".exr", ".png")):
        reading.warn(product.GetPath(), f"{last} is written as {last}.exr; files are .exr or .png")
        return f"{last}.exr"
    return last


@dataclass(frozen=True)
class Variable:
    """A RenderVar's channels, by their names in the file, and what they ask of the render."""

    channels: dict[str, str] = field(default_factory=dict)
    aovs: tuple[str, ...] = ()


def _variable(prim: Any, path: str, reading: Reading) -> Variable:
    """A layer is named by the prim, unless that is a usual name of what it is."""
    if not prim:
        return Variable()
    if not prim.IsA(UsdRender.Var):
        reading.warn(path, "there is no RenderVar here")
        return Variable()
    var, name = UsdRender.Var(prim), str(prim.GetName())
    source = str(reading.get(var.GetSourceNameAttr(), "")) or name
    kind = str(reading.get(var.GetSourceTypeAttr(), "raw"))
    is_expression = kind == "lpe" or source.startswith("lpe:")
    source = source.removeprefix("lpe:").strip()
    if kind == "primvar" and source.lower() not in SOURCES["uv"]:
        return _unsupported(source, path, reading)
    found = [what for what, names in SOURCES.items() if source.lower() in names]
    if not found:
        return _of_light(source, name, path, reading) if is_expression else _unsupported(source, path, reading)
    what = found[0]
    parts = dict(CHANNELS[what])
    if what == "color" and reading.get(var.GetDataTypeAttr(), "color3f") in WITH_ALPHA:
        parts |= CHANNELS["alpha"]
    asked = (what,) if what in AOVS else ()
    usual = name.lower() in SOURCES[what]
    if len(parts) == 1:
        return Variable({part if usual else name: own for part, own in parts.items()}, asked)
    if what == "color" and usual:
        return Variable(parts)
    return Variable({f"{name}.{part}": own for part, own in parts.items()}, asked)


def _of_light(expression: str, name: str, path: str, reading: Reading) -> Variable:
    """The layer of a light path expression."""
    try:
        if accepted(expression, ()).all():
            return Variable({f"{name}.{letter}": letter for letter in "RGB"})
    except ConfigError as error:
        reading.warn(path, f"{error}; it is left out")
        return Variable()
    own = f"var.{name}"
    return Variable({f"{name}.{letter}": f"{own}.{letter}" for letter in "RGB"}, (f"{own}={expression}",))


def _unsupported(source: str, path: str, reading: Reading) -> Variable:
    reading.warn(path, f"the variable {source} is not supported; it is left out")
    return Variable()
