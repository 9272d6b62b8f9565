"""Surface shaders of MaterialX and Arnold by the names of their inputs: standard_surface, OpenPBR, glTF's, unlit.

References: Georgiev et al. (2019), "Autodesk Standard Surface"; Andersson et al. (2024), "OpenPBR Surface"; Khronos
(2021), "glTF 2.0 Specification", appendix B.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpmis.usd.materials.layered_surface import (
    BLACK,
    INFINITY,
    WHITE,
    LayeredSurface,
    SurfaceInputs,
)
from warpmis.usd.materials.pattern import constant

STANDARD_LEFT_OUT = (
    *("diffuse_roughness", "sheen", "thin_film_thickness", "specular_anisotropy", "transmission_scatter"),
    *("transmission_dispersion", "transmission_extra_roughness"),
)
OPEN_PBR_LEFT_OUT = (
    *("base_diffuse_roughness", "fuzz_weight", "thin_film_weight", "specular_roughness_anisotropy"),
    *("transmission_scatter", "transmission_dispersion_scale"),
)
# What changes the picture where there is a coat.
STANDARD_COAT = ("coat_anisotropy", "coat_normal", "coat_affect_color", "coat_affect_roughness")
OPEN_PBR_COAT = ("coat_roughness_anisotropy", "geometry_coat_normal")
GLTF_COAT = ("clearcoat_normal",)
GLTF_LEFT_OUT = ("sheen_color", "iridescence", "anisotropy_strength", "dispersion")
OPAQUE, MASK = 0, 1


def standard_surface(inputs: SurfaceInputs, name: str = "standard_surface") -> LayeredSurface:
    """Also Arnold's, whose inputs have the same names; where nothing is authored, both have an albedo of 0.8."""
    inputs.warn_left_out((*STANDARD_LEFT_OUT, *_of_coat(inputs, "coat", STANDARD_COAT)), name)
    base = inputs.times(inputs.color("base_color", 0.8), inputs.number("base", 1.0), "base_color")
    transmission = inputs.fixed("transmission", 0.0)
    surface = LayeredSurface(
        diffuse=base,
        metalness=inputs.number("metalness", 0.0),
        specular=inputs.times(inputs.color("specular_color", WHITE), inputs.number("specular", 1.0), "specular_color"),
        roughness=inputs.number("specular_roughness", 0.2),
        ior=inputs.fixed("specular_IOR", 1.5, INFINITY, 1e-3),
        coat=inputs.number("coat", 0.0),
        coat_color=inputs.color("coat_color", WHITE),
        coat_roughness=inputs.number("coat_roughness", 0.1),
        coat_ior=inputs.fixed("coat_IOR", 1.5, INFINITY, 1e-3),
        emission=inputs.times(
            inputs.color("emission_color", WHITE, INFINITY), inputs.number("emission", 0.0, INFINITY), "emission_color"
        ),
        opacity=inputs.color("opacity", WHITE).resized(1),
        normal=inputs.normal("normal"),
        transmission=transmission,
        transmission_color=inputs.fixed_color("transmission_color", WHITE) if transmission > 0.0 else WHITE,
        transmission_depth=inputs.fixed("transmission_depth", 0.0, INFINITY) if transmission > 0.0 else 0.0,
        thin_walled=inputs.flag("thin_walled"),
    )
    return with_subsurface(surface, inputs, "subsurface", "subsurface_color", 1.0, name)


def _of_coat(inputs: SurfaceInputs, weight: str, names: tuple[str, ...]) -> tuple[str, ...]:
    """The names of a coat's inputs where there is a coat."""
    return () if inputs.number(weight, 0.0).equals(0.0) else names


def open_pbr(inputs: SurfaceInputs) -> LayeredSurface:
    of_coat = _of_coat(inputs, "coat_weight", OPEN_PBR_COAT)
    inputs.warn_left_out((*OPEN_PBR_LEFT_OUT, *of_coat), "open_pbr_surface")
    base = inputs.times(inputs.color("base_color", 0.8), inputs.number("base_weight", 1.0), "base_color")
    transmission = inputs.fixed("transmission_weight", 0.0)
    surface = LayeredSurface(
        diffuse=base,
        metalness=inputs.number("base_metalness", 0.0),
        specular=inputs.times(
            inputs.color("specular_color", WHITE), inputs.number("specular_weight", 1.0), "specular_color"
        ),
        roughness=inputs.number("specular_roughness", 0.3),
        ior=inputs.fixed("specular_ior", 1.5, INFINITY, 1e-3),
        coat=inputs.number("coat_weight", 0.0),
        coat_color=inputs.color("coat_color", WHITE),
        coat_roughness=inputs.number("coat_roughness", 0.0),
        coat_ior=inputs.fixed("coat_ior", 1.6, INFINITY, 1e-3),
        emission=inputs.times(
            inputs.color("emission_color", WHITE, INFINITY),
            inputs.number("emission_luminance", 0.0, INFINITY),
            "emission_color",
        ),
        opacity=inputs.number("geometry_opacity", 1.0),
        normal=inputs.normal("geometry_normal"),
        transmission=transmission,
        transmission_color=inputs.fixed_color("transmission_color", WHITE) if transmission > 0.0 else WHITE,
        transmission_depth=inputs.fixed("transmission_depth", 0.0, INFINITY) if transmission > 0.0 else 0.0,
        thin_walled=inputs.flag("geometry_thin_walled"),
    )
    return with_subsurface(surface, inputs, "subsurface_weight", "subsurface_color", 0.8, "open_pbr_surface")


def with_subsurface(
    surface: LayeredSurface, inputs: SurfaceInputs, weight: str, color: str, default: float, shader_name: str
) -> LayeredSurface:
    """The surface with light that is scattered below it as diffuse light of the same colour, with a warning."""
    share = inputs.number(weight, 0.0)
    if share.equals(0.0):
        return surface
    inputs.network.reading.warn(
        inputs.network.path, f"not supported: {weight} of {shader_name}; its color is rendered as diffuse"
    )
    diffuse = inputs.network.folded(
        lambda base, below, s: base * (1.0 - s) + below * s,
        [surface.diffuse, inputs.color(color, default), share],
        {0, 1, 2},
        color,
    )
    return replace(surface, diffuse=diffuse, metal=surface.metal or surface.diffuse)


def gltf_pbr(inputs: SurfaceInputs) -> LayeredSurface:
    inputs.warn_left_out((*GLTF_LEFT_OUT, *_of_coat(inputs, "clearcoat", GLTF_COAT)), "gltf_pbr")
    base = inputs.color("base_color", WHITE)
    mode = round(inputs.fixed("alpha_mode", 0.0, 2.0))
    transmission = inputs.fixed("transmission", 0.0)
    # Glass of no thickness has no inside, and is tinted by the base's colour; else light is absorbed within.
    solid = transmission > 0.0 and inputs.number("thickness", 0.0, INFINITY).mean[0] > 0.0
    depth = inputs.fixed("attenuation_distance", 0.0, INFINITY) if solid else 0.0
    tint = np.ones(3) if transmission == 0.0 else inputs.network.numbers(base, "base_color")
    if depth > 0.0:
        tint = np.array(inputs.fixed_color("attenuation_color", WHITE))
    red, green, blue = tint.tolist()
    return LayeredSurface(
        diffuse=base,
        metalness=inputs.number("metallic", 1.0),
        specular=inputs.times(
            inputs.color("specular_color", WHITE, INFINITY), inputs.number("specular", 1.0), "specular_color"
        ),
        roughness=inputs.number("roughness", 1.0),
        ior=inputs.fixed("ior", 1.5, INFINITY, 1e-3),
        coat=inputs.number("clearcoat", 0.0),
        coat_roughness=inputs.number("clearcoat_roughness", 0.0),
        emission=inputs.times(
            inputs.color("emissive", BLACK, INFINITY), inputs.number("emissive_strength", 1.0, INFINITY), "emissive"
        ),
        opacity=constant(1.0) if mode == OPAQUE else inputs.number("alpha", 1.0),
        opacity_threshold=inputs.fixed("alpha_cutoff", 0.5) if mode == MASK else 0.0,
        normal=inputs.normal("normal"),
        transmission=transmission,
        transmission_color=(red, green, blue),
        transmission_depth=depth,
        thin_walled=not solid,
    )


def unlit(inputs: SurfaceInputs) -> LayeredSurface:
    """surface_unlit: emission, and a share that lets light straight through."""
    opacity = inputs.number("opacity", 1.0)
    passed = inputs.number("transmission", 0.0)
    kept = inputs.network.folded(lambda o, t: o * (1.0 - t), [opacity, passed], {0, 1}, "opacity")
    if not passed.equals(0.0) and not inputs.color("transmission_color", WHITE).equals(1.0):
        inputs.warn_left_out(("transmission_color",), "surface_unlit")
    emission = inputs.times(
        inputs.color("emission_color", WHITE, INFINITY), inputs.number("emission", 1.0, INFINITY), "emission_color"
    )
    # What lets light through shines all the same.
    shining = inputs.network.folded(lambda e, t: e / np.maximum(1.0 - t, 1e-3), [emission, passed], {0}, "emission")
    return LayeredSurface(
        diffuse=constant(BLACK),
        specular=constant(BLACK),
        roughness=constant(1.0),
        emission=shining,
        opacity=kept,
    )
