"""Omniverse's OmniSurface and OmniSurfaceLite, and their Base forms, by the names of their inputs.

Reference: NVIDIA (2024), "Omniverse Materials", the pages of OmniSurface.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from pxr import Sdf, UsdLux

from warpmis.scene import Material
from warpmis.usd.color_space import AUTO, RAW, space_of
from warpmis.usd.materials.layered_surface import (
    INFINITY,
    NO_COLOR,
    WHITE,
    LayeredSurface,
    SurfaceInputs,
    material_of,
)
from warpmis.usd.materials.pattern import Pattern, Picture, constant
from warpmis.usd.materials.pattern_network import PatternNetwork
from warpmis.usd.materials.shading_network import is_input
from warpmis.usd.materials.surface_shaders import with_subsurface
from warpmis.usd.shapes.primvar import PrimvarRead

NAMES = ("OmniSurface", "OmniSurfaceLite", "OmniSurfaceBase", "OmniSurfaceLiteBase")
LEFT_OUT = (
    *("specular_reflection_anisotropy", "coat_anisotropy", "coat_affect_color", "coat_affect_roughness"),
    *("specular_retro_reflection_weight", "enable_thin_film", "geometry_displacement", "geometry_displacement_image"),
    *("coat_normal_image", "subsurface_weight_image"),
)


def is_omni_surface(name: str) -> bool:
    """Whether `read_omni_surface` knows the MDL material."""
    return name in NAMES


def read_omni_surface(shader: Any, name: str, network: PatternNetwork) -> Material:
    """The Material of an MDL shader of that name."""
    inputs = OmniInputs(shader, network)
    inputs.warn_left_out(LEFT_OUT, name)
    base = inputs.times(
        inputs.color("diffuse_reflection_color", WHITE),
        inputs.number("diffuse_reflection_weight", 0.8),
        "diffuse_reflection_color",
    )
    transmits = inputs.flag("enable_specular_transmission")
    transmission = inputs.fixed("specular_transmission_weight", 0.0) if transmits else 0.0
    has_opacity = inputs.flag("enable_opacity")
    surface = LayeredSurface(
        diffuse=base,
        metalness=inputs.number("metalness", 0.0),
        specular=inputs.times(
            inputs.color("specular_reflection_color", WHITE),
            inputs.number("specular_reflection_weight", 1.0),
            "specular_reflection_color",
        ),
        roughness=inputs.number("specular_reflection_roughness", 0.2),
        ior=inputs.fixed("specular_reflection_ior", 1.5, INFINITY, 1e-3),
        coat=inputs.number("coat_weight", 0.0),
        coat_color=inputs.color("coat_color", WHITE),
        coat_roughness=inputs.number("coat_roughness", 0.1),
        coat_ior=inputs.fixed("coat_ior", 1.5, INFINITY, 1e-3),
        emission=_emission(inputs),
        opacity=inputs.number("geometry_opacity", 1.0) if has_opacity else constant(1.0),
        opacity_threshold=inputs.fixed("geometry_opacity_threshold", 0.0) if has_opacity else 0.0,
        normal=inputs.tangent_normal(),
        transmission=transmission,
        transmission_color=inputs.fixed_color("specular_transmission_color", WHITE) if transmission > 0.0 else WHITE,
        transmission_depth=inputs.fixed("specular_transmission_scattering_depth", 0.0, INFINITY),
        thin_walled=inputs.flag("thin_walled"),
    )
    if inputs.flag("enable_diffuse_transmission"):
        surface = with_subsurface(surface, inputs, "subsurface_weight", "subsurface_scattering_color", 1.0, name)
    return material_of(surface, network)


def _emission(inputs: OmniInputs) -> Pattern:
    """Radiance [nit]: an intensity in lux leaves the surface into pi steradians."""
    weight = inputs.number("emission_weight", 0.0)
    if weight.equals(0.0):
        return NO_COLOR
    intensity = inputs.fixed("emission_intensity", 1.0, INFINITY)
    mode = inputs.network.reading.value(inputs.network.source(inputs.shader, "emission_mode"))
    in_nit = str(mode) in ("1", "emission_nt")
    color = inputs.color("emission_color", WHITE, INFINITY)
    if inputs.flag("emission_use_temperature"):
        kelvin = inputs.fixed("emission_temperature", 6500.0, INFINITY)
        color = constant(np.array(UsdLux.BlackbodyTemperatureAsRgb(min(max(kelvin, 1000.0), 10000.0))))
    factor = constant(intensity if in_nit else intensity / np.pi)
    return inputs.times(color, inputs.times(factor, weight, "emission_weight").resized(1), "emission_color")


class OmniInputs(SurfaceInputs):
    """Inputs of which a picture, NAME_image, goes before the constant."""

    def _input(self, name: str, default: Any, high: float, low: float = 0.0) -> Pattern:
        picture = self._picture(f"{name}_image", AUTO if len(default) == 3 else RAW)
        if picture is not None:
            return picture.resized(len(default))
        return super()._input(name, default, high, low)

    def tangent_normal(self) -> Pattern | None:
        """The tangent-space map geometry_normal_image, of which geometry_normal_strength scales x and y."""
        found = self._picture("geometry_normal_image", RAW)
        strength = self.fixed("geometry_normal_strength", 1.0, INFINITY)
        return None if found is None else (found.resized(3) * 2.0 - 1.0) * constant([strength, strength, 1.0])

    def _picture(self, name: str, space: str) -> Pattern | None:
        """The four channels of a file that an input names; None where it names none that can be read."""
        network = self.network
        file = network.source(self.shader, name)
        if file is None or not is_input(file):
            return None
        asset = network.reading.get(file, like=Sdf.AssetPath())
        texture = network.textures.read(file, space_of(file, space, network.reading)) if asset and asset.path else None
        if texture is None:
            return None
        column = network.columns.column(PrimvarRead("st", (0.0, 0.0)))
        lines = [
            (network.vector(self.shader, f"uvw_{axis}_scale", 1, (1.0,))[0],
             network.vector(self.shader, f"uvw_{axis}_offset", 1, (0.0,))[0])
            for axis in "st"
        ]  # fmt: skip
        transform = ((lines[0][0], 0.0, lines[0][1]), (0.0, lines[1][0], lines[1][1]))
        return Pattern(np.zeros(4), np.ones(4), (0, 1, 2, 3), Picture(texture, column, transform, "repeat", "repeat"))
