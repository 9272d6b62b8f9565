"""Materials: UsdPreviewSurface with constant inputs, and displayColor where nothing is bound."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import UsdGeom, UsdShade

from warpmis.scene import Color, Material
from warpmis.usd.reading import Reading

INFINITY = float("inf")
GREY = 0.18

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


@dataclass(eq=False)
class MaterialReader:
    """Reads each material of the stage once, and numbers them as Scene.materials does.

    Attributes:
        materials: material -> its index, in the order of first use.
        by_path: what the stage's materials were read as; None for one that is not a UsdPreviewSurface.
    """

    reading: Reading
    materials: dict[Material, int] = field(default_factory=dict)
    by_path: dict[Any, Material | None] = field(default_factory=dict)

    def index(self, material: Material) -> int:
        """The material's place in Scene.materials."""
        return self.materials.setdefault(material, len(self.materials))

    def of_triangles(self, prim: Any, faces: NDArray[np.int64]) -> NDArray[np.int64]:
        """Material index of each triangle of a gprim, GeomSubsets of the family materialBind included.

        Args:
            faces: the face that each triangle came from, shape (f,).
        """
        subsets = UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets() if prim.IsA(UsdGeom.Mesh) else []
        by_face = np.full(int(faces.max(initial=-1)) + 1, -1)
        for subset in subsets:
            material = self.bound(subset.GetPrim())
            indices = self.reading.indices(subset.GetIndicesAttr())
            if material is not None:
                by_face[indices[(indices >= 0) & (indices < len(by_face))]] = self.index(material)
        by_triangle = by_face[faces]
        if (by_triangle < 0).any():
            own = self.index(self.bound(prim) or display_material(prim, self.reading))
            by_triangle = np.where(by_triangle < 0, own, by_triangle)
        return by_triangle

    def bound(self, prim: Any) -> Material | None:
        """The material bound to a gprim or GeomSubset (purpose full before all), or None."""
        material, relationship = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial(UsdShade.Tokens.full)
        if not material:
            if relationship:
                targets = ", ".join(str(target) for target in relationship.GetTargets())
                self.reading.warn(prim.GetPath(), f"its bound material {targets} does not exist; displayColor is used")
            return None
        path = material.GetPath()
        if path not in self.by_path:
            self.by_path[path] = _read_material(material, self.reading)
        return self.by_path[path]


def display_material(prim: Any, reading: Reading) -> Material:
    """The Lambertian of a gprim's displayColor and displayOpacity, 0.18 and 1 where they are not authored."""
    primvars = UsdGeom.PrimvarsAPI(prim)
    color = _display_value(primvars, "displayColor", 3, reading)
    opacity = _display_value(primvars, "displayOpacity", 1, reading)
    return Material(
        diffuse_color=(GREY, GREY, GREY) if color is None else _color(color),
        opacity=1.0 if opacity is None else float(opacity[0]),
        lambertian=True,
    )


def _display_value(primvars: Any, name: str, components: int, reading: Reading) -> NDArray[np.float64] | None:
    """A display primvar as one value, shape (components,): the mean, with a warning, where its values differ."""
    primvar = primvars.FindPrimvarWithInheritance(name)
    if not primvar or not primvar.HasValue():
        return None
    path = primvars.GetPath()
    values = np.asarray(primvar.ComputeFlattened(reading.time))
    if values.dtype.kind not in "fiu" or values.size % components:
        reading.warn(path, f"primvars:{name} is of the wrong type; it is not used")
        return None
    values = values.astype(np.float64).reshape(-1, components)
    if not len(values):
        return None
    if not np.array_equal(values, np.broadcast_to(values[0], values.shape), equal_nan=True):
        reading.warn(path, f"{name} varies over the surface; its mean is used")
    fallback = np.full(components, GREY if components == 3 else 1.0)
    return _clamped(path, f"primvars:{name}", values.mean(axis=0), fallback, 0.0, 1.0, reading)


def _read_material(material: Any, reading: Reading) -> Material | None:
    """A UsdPreviewSurface; None, with a warning, for a material of another shader."""
    path = material.GetPath()
    shader = material.ComputeSurfaceSource()[0]
    if not shader:
        reading.warn(path, "it has no UsdPreviewSurface; displayColor is used")
        return None
    if shader.GetIdAttr().Get() != "UsdPreviewSurface":
        name = shader.GetIdAttr().Get() or shader.GetImplementationSource()
        reading.warn(path, f"its surface shader {name} is not supported; displayColor is used")
        return None
    default = Material()
    values: dict[str, Any] = {}
    for name, (attribute, low, high) in COLOR_INPUTS.items():
        values[attribute] = _color(_number(path, shader, name, getattr(default, attribute), low, high, reading))
    for name, (attribute, low, high) in FLOAT_INPUTS.items():
        values[attribute] = float(_number(path, shader, name, getattr(default, attribute), low, high, reading)[0])
    values["use_specular_workflow"] = bool(_number(path, shader, "useSpecularWorkflow", 0, 0, 1, reading)[0])
    threshold = float(_number(path, shader, "opacityThreshold", 0.0, 0.0, 1.0, reading)[0])
    if threshold > 0.0:
        values["opacity"] = float(values["opacity"] >= threshold)
    # A cutout is there or not, its highlights and glow with it, whatever the mode says.
    values["opacity_mode"] = "presence" if threshold > 0.0 else _opacity_mode(path, shader, reading)
    _warn_unread_inputs(path, shader, reading)
    return Material(path=str(path), **values)


def _opacity_mode(path: Any, shader: Any, reading: Reading) -> str:
    """opacityMode, "transparent" unless authored as "presence"."""
    mode = str(_input_value(path, shader, "opacityMode", reading) or "transparent")
    if mode not in ("transparent", "presence"):
        reading.warn(path, f"opacityMode {mode} is not known; transparent is used")
        return "transparent"
    return mode


def _warn_unread_inputs(path: Any, shader: Any, reading: Reading) -> None:
    """Inputs that change the surface's shape."""
    shader_input = shader.GetInput("normal")
    if shader_input and shader_input.HasConnectedSource():
        reading.warn(path, "inputs:normal is not supported; the surface's own normal is used")
    shader_input = shader.GetInput("displacement")
    if shader_input and (shader_input.HasConnectedSource() or reading.get(shader_input.GetAttr(), 0.0) != 0.0):
        reading.warn(path, "inputs:displacement is not supported; the surface is not displaced")


def _number(
    path: Any, shader: Any, name: str, default: Any, low: float, high: float, reading: Reading
) -> NDArray[np.float64]:
    """A float or color3f input within its range, shape (1,) or (3,)."""
    fallback = np.atleast_1d(np.asarray(default, np.float64))
    value = _input_value(path, shader, name, reading)
    if value is None:
        return fallback
    try:
        number = np.broadcast_to(np.atleast_1d(np.asarray(value, np.float64)), fallback.shape)
    except (TypeError, ValueError):
        reading.warn(path, f"inputs:{name} is of the wrong type; its default is used")
        return fallback
    return _clamped(path, f"inputs:{name}", number, fallback, low, high, reading)


def _input_value(path: Any, shader: Any, name: str, reading: Reading) -> Any:
    """An input's constant, through any interface connections; None where only its default is left."""
    shader_input = shader.GetInput(name)
    if not shader_input:
        return None
    producing = UsdShade.Utils.GetValueProducingAttributes(shader_input)
    if not producing:
        return None
    attribute = producing[0]
    if UsdShade.Utils.GetType(attribute.GetName()) == UsdShade.AttributeType.Input:
        return reading.get(attribute)
    source = UsdShade.Shader(attribute.GetPrim())
    kind = source.GetIdAttr().Get() if source else attribute.GetPrim().GetTypeName()
    reading.warn(path, f"inputs:{name} is connected to {kind} {attribute.GetPrim().GetPath()}; its fallback is used")
    fallback = attribute.GetPrim().GetAttribute("inputs:fallback")
    value = reading.get(fallback) if fallback else None
    return None if value is None else _output_component(value, str(attribute.GetBaseName()))


def _output_component(value: Any, output: str) -> Any:
    """The part of a texture's float4 that an output carries: rgb, or one of r, g, b, a; other values as they are."""
    array = np.atleast_1d(np.asarray(value, np.float64))
    if array.shape != (4,):
        return value
    return array[:3] if output == "rgb" else array["rgba".index(output)] if output in tuple("rgba") else array[:3]


def _clamped(
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


def _color(value: NDArray[np.float64]) -> Color:
    return float(value[0]), float(value[1]), float(value[2])
