"""Omniverse's materials by the names of their inputs: OmniPBR and its variants, OmniGlass. No MDL file is looked at.

Reference: NVIDIA (2024), "Omniverse Materials", the pages of OmniPBR, OmniPBR_ClearCoat and OmniGlass.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from warpmis.scene import Material
from warpmis.scene.texture import TextureLookup, is_lookup
from warpmis.usd.color_space import AUTO, RAW, space_of
from warpmis.usd.materials.preview_surface import clamped, constant_if_uniform
from warpmis.usd.materials.shading_network import ShadingNetwork, Transform, is_input
from warpmis.usd.shapes.primvar import PrimvarRead

PBR = ("OmniPBR", "OmniPBR_Opacity", "OmniPBR_ClearCoat", "OmniPBR_ClearCoat_Opacity")
GLASS = ("OmniGlass", "OmniGlass_Opacity")
# The reflectance at normal incidence of a specular level of 1.
FULL_REFLECTANCE = 0.08
# What changes the picture and is not read, unless it is 0, False or no file.
LEFT_OUT = (
    *("ao_texture", "detail_normalmap_texture", "detail_bump_factor", "project_uvw", "emissive_color_texture"),
    *("emissive_mask_texture", "clearcoat_normal_map_texture", "glass_color_texture", "roughness_texture"),
)


def mdl_name(shader: Any) -> str:
    """The name of a shader's MDL material, "" where it has none."""
    prim = shader.GetPrim()
    name = prim.GetAttribute("info:mdl:sourceAsset:subIdentifier")
    text = name.Get() if name else None
    return text.split("(")[0].split("::")[-1] if isinstance(text, str) else ""


def is_mdl(name: str) -> bool:
    """Whether `read_mdl` knows the material."""
    return name in (*PBR, *GLASS)


def read_mdl(shader: Any, name: str, network: ShadingNetwork) -> Material:
    """The material of an MDL shader of that name; what it leaves out is one warning."""
    inputs = MdlInputs(shader, network)
    left_out = [each for each in LEFT_OUT if inputs.is_authored(each)]
    if left_out:
        network.reading.warn(network.path, f"not supported: {', '.join(left_out)} of {name}; left out")
    return glass(inputs) if name in GLASS else pbr(inputs, has_coat="ClearCoat" in name)


def glass(inputs: MdlInputs) -> Material:
    return Material(
        path=str(inputs.network.path),
        diffuse_color=(0.0, 0.0, 0.0),
        roughness=inputs.number("frosting_roughness", 0.0),
        ior=inputs.number("glass_ior", 1.491, high=np.inf, low=1e-3),
        transmission=1.0,
        transmission_color=inputs.color("glass_color", (1.0, 1.0, 1.0)),
        thin_walled=inputs.flag("thin_walled"),
        opacity=inputs.number("opacity_constant", 1.0) if inputs.flag("enable_opacity") else 1.0,
        opacity_mode="presence",
    )


def pbr(inputs: MdlInputs, has_coat: bool) -> Material:
    level = math.sqrt(FULL_REFLECTANCE * inputs.number("specular_level", 0.5))
    coat = has_coat and inputs.flag("enable_clearcoat", True)
    return Material(
        path=str(inputs.network.path),
        diffuse_color=inputs.albedo(),
        emissive_color=inputs.emission(),
        metallic=inputs.influenced("metallic", "metallic_texture", "metallic_texture_influence", 0.0, "b"),
        roughness=inputs.influenced(
            *("reflection_roughness", "reflectionroughness_texture", "reflection_roughness_texture_influence"),
            *(0.5, "g"),
        ),
        clearcoat=inputs.number("clearcoat_weight", 1.0) if coat else 0.0,
        clearcoat_roughness=inputs.number("clearcoat_reflection_roughness", 0.0),
        opacity=inputs.opacity(),
        opacity_threshold=inputs.number("opacity_threshold", 0.0),
        opacity_mode="presence",
        ior=(1.0 + level) / (1.0 - level),
        normal=inputs.normal(),
    )


class MdlInputs:
    """The inputs of one shader, constants within their range, and pictures at the shader's texture coordinates."""

    def __init__(self, shader: Any, network: ShadingNetwork) -> None:
        self.shader = shader
        self.network = network

    def is_authored(self, name: str) -> bool:
        attribute = self.network.source(self.shader, name)
        if attribute is None or not is_input(attribute):
            return attribute is not None
        value = self.network.reading.value(attribute)
        return bool(getattr(value, "path", value))

    def flag(self, name: str, default: bool = False) -> bool:
        return bool(self.network.constant(self.shader, name, default))

    def number(self, name: str, default: float, low: float = 0.0, high: float = 1.0) -> float:
        return float(self._constant(name, (default,), low, high)[0])

    def color(self, name: str, default: tuple[float, float, float], high: float = 1.0) -> tuple[float, float, float]:
        red, green, blue = self._constant(name, default, 0.0, high)
        return red, green, blue

    def _constant(self, name: str, default: tuple[float, ...], low: float, high: float) -> tuple[float, ...]:
        value = self.network.value(self.shader, name, len(default))
        if value is None or is_lookup(value):
            return default
        fallback = np.array(default)
        number = np.broadcast_to(np.atleast_1d(np.asarray(value, np.float64)), fallback.shape)
        reading = self.network.reading
        inside = clamped(self.network.path, f"inputs:{name}", number, fallback, low, high, reading)
        return tuple(inside.tolist())

    def picture(self, name: str, channels: str, space: str = RAW) -> TextureLookup | None:
        """The lookup of a file input; None where it names none, or with a warning none that can be read."""
        if not self.is_authored(name):
            return None
        file = self.network.source(self.shader, name)
        if not is_input(file):
            self.network.reading.warn(self.network.path, f"inputs:{name} must name a file; it is left out")
            return None
        texture = self.network.textures.read(file, space_of(file, space, self.network.reading))
        if texture is None:
            return None
        return TextureLookup(
            texture=texture,
            column=self.network.columns.column(PrimvarRead("st", (0.0, 0.0))),
            channels=channels,
            transform=self._transform(),
            wrap_s="repeat",
            wrap_t="repeat",
        )

    def _transform(self) -> Transform:
        """Coordinates are scaled, rotated counter-clockwise [degree], and moved."""
        scale = self.network.vector(self.shader, "texture_scale", 2, (1.0, 1.0))
        move = self.network.vector(self.shader, "texture_translate", 2, (0.0, 0.0))
        angle = math.radians(self.network.vector(self.shader, "texture_rotate", 1, (0.0,))[0])
        cosine, sine = math.cos(angle), math.sin(angle)
        return (cosine * scale[0], -sine * scale[1], move[0]), (sine * scale[0], cosine * scale[1], move[1])

    def albedo(self) -> Any:
        """tint (brightness color + add), of the picture where there is one."""
        tint = np.array(self.color("diffuse_tint", (1.0, 1.0, 1.0)))
        brightness, add = self.number("albedo_brightness", 1.0, high=np.inf), self.number("albedo_add", 0.0, -1.0)
        grey = self.number("albedo_desaturation", 0.0)
        found = self.picture("diffuse_texture", "rgb", AUTO)
        if found is None:
            color = np.array(self.color("diffuse_color_constant", (0.2, 0.2, 0.2)))
            color = color + grey * (color.mean() - color)
            return tuple(np.clip(tint * (brightness * color + add), 0.0, 1.0).tolist())
        if grey > 0.0:
            self.network.reading.warn(self.network.path, "not supported: albedo_desaturation of a picture; left out")
        return replace(found, scale=(*(tint * brightness).tolist(), 1.0), bias=(*(tint * add).tolist(), 0.0))

    def influenced(self, constant: str, file: str, influence: str, default: float, channel: str) -> Any:
        """A number that is mixed with a picture's: of its red, or of a channel of the picture for all."""
        number = self.number(f"{constant}_constant", default)
        share = self.number(influence, 0.0)
        if share == 0.0:
            return number
        together = self.picture("ORM_texture", channel) if self.flag("enable_ORM_texture") else None
        found = together or self.picture(file, "r")
        if found is None:
            return number
        rest = (1.0 - share) * number
        return constant_if_uniform(replace(found, scale=(share,) * 4, bias=(rest,) * 4))

    def emission(self) -> tuple[float, float, float]:
        """emissive_color times emissive_intensity [nit]."""
        if not self.flag("enable_emission"):
            return 0.0, 0.0, 0.0
        red, green, blue = self.color("emissive_color", (1.0, 0.1, 0.1), np.inf)
        intensity = self.number("emissive_intensity", 40.0, high=np.inf)
        return intensity * red, intensity * green, intensity * blue

    def opacity(self) -> Any:
        if not self.flag("enable_opacity"):
            return 1.0
        constant = self.number("opacity_constant", 1.0)
        if not self.flag("enable_opacity_texture"):
            return constant
        mode = self.network.vector(self.shader, "opacity_mode", 1, (1.0,))[0]  # 0 is mono_alpha
        found = self.picture("opacity_texture", "a" if mode == 0.0 else "r")
        return constant if found is None else constant_if_uniform(found.scaled(constant))

    def normal(self) -> TextureLookup | None:
        """A tangent-space map, of which bump_factor scales x and y."""
        bump = self.number("bump_factor", 1.0, -np.inf, np.inf)
        found = self.picture("normalmap_texture", "rgb")
        if found is None or bump == 0.0:
            return None
        return replace(found, scale=(2.0 * bump, 2.0 * bump, 2.0, 1.0), bias=(-bump, -bump, -1.0, 0.0))
