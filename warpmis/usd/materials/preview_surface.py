"""UsdPreviewSurface: its inputs, each a constant within its range or a lookup."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpmis.scene import Color, Material
from warpmis.scene.texture import Lookup, TextureLookup, bounds_of, is_lookup, mean_of
from warpmis.usd.materials.shading_network import ShadingNetwork
from warpmis.usd.reading import Reading

INFINITY = float("inf")

# UsdPreviewSurface input -> field of scene.Material and the range of its values.
COLOR_INPUTS: dict[str, tuple[str, float, float]] = {
    "diffuseColor": ("diffuse_color", 0.0, 1.0),
    "emissiveColor": ("emissive_color", 0.0, INFINITY),
    "specularColor": ("specular_color", 0.0, 1.0),
}
FLOAT_INPUTS: dict[str, tuple[str, float, float]] = {
    "metallic": ("metallic", 0.0, 1.0),
    "roughness": ("roughness", 0.0, 1.0),
    "clearcoat": ("clearcoat", 0.0, 1.0),
    "clearcoatRoughness": ("clearcoat_roughness", 0.0, 1.0),
    "opacity": ("opacity", 0.0, 1.0),
    "ior": ("ior", 1e-3, INFINITY),
}


def read_preview_surface(shader: Any, network: ShadingNetwork) -> Material:
    """The material of a UsdPreviewSurface shader."""
    default = Material()
    values: dict[str, Any] = {}
    for name, (attribute, low, high) in COLOR_INPUTS.items():
        values[attribute] = _color(shader, network, name, getattr(default, attribute), low, high)
    for name, (attribute, low, high) in FLOAT_INPUTS.items():
        values[attribute] = _number(shader, network, name, getattr(default, attribute), low, high)
    values["ior"] = _constant_ior(values["ior"], network)
    values["use_specular_workflow"] = bool(_constant(shader, network, "useSpecularWorkflow", 0.0))
    threshold = _constant(shader, network, "opacityThreshold", 0.0)
    if threshold > 0.0 and not is_lookup(values["opacity"]):
        values["opacity"] = float(np.float32(values["opacity"]) >= np.float32(threshold))
    # A cutout is there or not, its highlights and glow with it, whatever the mode says.
    values["opacity_mode"] = "presence" if threshold > 0.0 else _opacity_mode(shader, network)
    values["opacity_threshold"] = threshold if is_lookup(values["opacity"]) else 0.0
    values["normal"] = _normal_map(shader, network)
    if _is_displaced(shader, network.reading):
        network.reading.warn(network.path, "inputs:displacement is not supported; the surface is not displaced")
    return Material(path=str(network.path), **values)


def _constant_ior(ior: float | Lookup, network: ShadingNetwork) -> float:
    if isinstance(ior, float):
        return ior
    mean = mean_of(ior, high=INFINITY)
    network.reading.warn(network.path, f"a varying inputs:ior is not supported; its mean {mean:g} is used")
    return max(mean, 1e-3)


def _constant(shader: Any, network: ShadingNetwork, name: str, default: float) -> float:
    """A number within [0, 1] that cannot vary over the surface."""
    number, fallback = np.array([network.constant(shader, name, default)], np.float64), np.array([default])
    return float(clamped(network.path, f"inputs:{name}", number, fallback, 0.0, 1.0, network.reading)[0])


def _opacity_mode(shader: Any, network: ShadingNetwork) -> str:
    """opacityMode, "transparent" unless authored as "presence"."""
    mode = str(network.constant(shader, "opacityMode", "transparent") or "transparent")
    if mode not in ("transparent", "presence"):
        network.reading.warn(network.path, f"opacityMode {mode} is not known; transparent is used")
        return "transparent"
    return mode


def _normal_map(shader: Any, network: ShadingNetwork) -> TextureLookup | None:
    """The picture that turns the normal; a constant normal, (0, 0, 1) in the specification, changes nothing."""
    shader_input = shader.GetInput("normal")
    value = network.value(shader, "normal", 3) if shader_input else None
    if not is_lookup(value):
        return None
    if not isinstance(value, TextureLookup) or value.channels != "rgb":
        message = "inputs:normal must be a constant or a texture's rgb; the surface's own normal is used"
        network.reading.warn(network.path, message)
        return None
    if value.bias[:3] == (0.0, 0.0, 0.0) and value.texture.tiles[min(value.texture.tiles)].dtype == np.uint8:
        network.reading.warn(network.path, "inputs:normal reads bytes without scale 2 and bias -1: half its directions")
    return value


def _is_displaced(shader: Any, reading: Reading) -> bool:
    shader_input = shader.GetInput("displacement")
    return bool(shader_input) and (
        shader_input.HasConnectedSource() or reading.get(shader_input.GetAttr(), 0.0, 0.0) != 0.0
    )


def _color(shader: Any, network: ShadingNetwork, name: str, default: Color, low: float, high: float) -> Color | Lookup:
    value = _value(shader, network, name, np.array(default), low, high)
    return value if is_lookup(value) else (float(value[0]), float(value[1]), float(value[2]))


def _number(shader: Any, network: ShadingNetwork, name: str, default: float, low: float, high: float) -> float | Lookup:
    value = _value(shader, network, name, np.array([default]), low, high)
    if isinstance(value, TextureLookup) and high == 1.0:
        return constant_if_uniform(value)
    return value if is_lookup(value) else float(value[0])


def constant_if_uniform(lookup: TextureLookup) -> float | TextureLookup:
    """0 or 1 where a lookup within [0, 1] gives that everywhere, as the alpha of most pictures; else the lookup."""
    least, greatest = bounds_of(lookup)
    return least if least == greatest and least in (0.0, 1.0) else lookup


def _value(
    shader: Any, network: ShadingNetwork, name: str, default: NDArray[np.float64], low: float, high: float
) -> Any:
    """A lookup, or a constant within its range, of the default's shape, (1,) or (3,)."""
    value = network.value(shader, name, len(default))
    if value is None or is_lookup(value):
        return default if value is None else value
    number = np.broadcast_to(np.atleast_1d(np.asarray(value, np.float64)), default.shape)
    return clamped(network.path, f"inputs:{name}", number, default, low, high, network.reading)


def clamped(
    path: Any,
    name: str,
    value: NDArray[np.float64],
    fallback: NDArray[np.float64],
    low: float,
    high: float,
    reading: Reading,
) -> NDArray[np.float64]:
    """The value within [low, high], with a warning where that changed it; the fallback for what is not finite."""
    inside = np.clip(np.where(np.isfinite(value), value, fallback), low, high)
    if not np.array_equal(inside, value):
        reading.warn(path, f"{name} = {_text(value)} is out of range; {_text(inside)} is used")
    return inside


def _text(value: NDArray[np.float64]) -> str:
    return ", ".join(f"{component:g}" for component in value)
