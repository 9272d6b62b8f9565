"""What the common surface shaders share, layer by layer, and the Material that it becomes.

References: Georgiev et al. (2019), "Autodesk Standard Surface"; Andersson et al. (2024), "OpenPBR Surface".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from warpmis.scene import Material
from warpmis.scene.texture import TextureLookup
from warpmis.usd.materials.pattern import Pattern, constant, mixed
from warpmis.usd.materials.pattern_network import PatternNetwork
from warpmis.usd.materials.preview_surface import clamped, constant_if_uniform

INFINITY = float("inf")
WHITE = (1.0, 1.0, 1.0)
BLACK = (0.0, 0.0, 0.0)
OWN_NORMAL = "ND_normal_vector3"
# Reflectances closer than this are one: rounding of an index of refraction.
SAME_REFLECTANCE = 1e-6
LARGEST_REFLECTANCE = 0.999


NONE, ALL = constant(0.0), constant(1.0)
NO_COLOR, ALL_COLORS = constant(BLACK), constant(WHITE)


@dataclass(frozen=True, eq=False)
class LayeredSurface:
    """A diffuse base and a metal below a dielectric, below a coat. Patterns have one or three components, in [0, 1].

    Attributes:
        diffuse: albedo of the diffuse base.
        metal: the metal's reflectance at normal incidence; None for that of the base's colour.
        specular: what the dielectric's reflectance of its `ior` is multiplied with; its weight and tint.
        coat_color: what passes the coat at normal incidence.
        emission: radiance [nit] below the coat.
        normal: in the frame of the shading normal and the texture coordinates' directions.
        transmission, transmission_color, transmission_depth, thin_walled: as scene.Material has them.
    """

    diffuse: Pattern
    roughness: Pattern
    metal: Pattern | None = None
    metalness: Pattern = NONE
    specular: Pattern = ALL_COLORS
    ior: float = 1.5
    coat: Pattern = NONE
    coat_color: Pattern = ALL_COLORS
    coat_roughness: Pattern = NONE
    coat_ior: float = 1.5
    emission: Pattern = NO_COLOR
    opacity: Pattern = ALL
    opacity_threshold: float = 0.0
    normal: Pattern | None = None
    transmission: float = 0.0
    transmission_color: tuple[float, float, float] = WHITE
    transmission_depth: float = 0.0
    thin_walled: bool = False


def material_of(surface: LayeredSurface, network: PatternNetwork) -> Material:
    """The Material of a layered surface; what varies and must not is its mean, with a warning."""
    surface = below_coat(surface, network)
    opacity = network.as_value(surface.opacity, 1)
    opacity = constant_if_uniform(opacity) if isinstance(opacity, TextureLookup) else opacity
    if isinstance(opacity, float) and surface.opacity_threshold > 0.0:
        opacity = float(opacity >= surface.opacity_threshold)
    return Material(
        path=str(network.path),
        emissive_color=network.as_value(surface.emission, 3),
        roughness=network.as_value(surface.roughness, 1),
        **_coat(surface, network),
        opacity=opacity,
        opacity_threshold=0.0 if isinstance(opacity, float) else surface.opacity_threshold,
        opacity_mode="presence",
        normal=_normal(surface.normal, network),
        transmission=surface.transmission,
        transmission_color=surface.transmission_color if surface.transmission > 0.0 else WHITE,
        transmission_depth=surface.transmission_depth if surface.transmission > 0.0 else 0.0,
        thin_walled=surface.thin_walled and surface.transmission > 0.0,
        **_base(surface, network),
    )


def _coat(surface: LayeredSurface, network: PatternNetwork) -> dict[str, Any]:
    """The coat's inputs; nothing where there is none, so that materials without one are alike."""
    if surface.coat.equals(0.0):
        return {}
    return {
        "clearcoat": network.as_value(surface.coat, 1),
        "clearcoat_roughness": network.as_value(surface.coat_roughness, 1),
    }


def below_coat(surface: LayeredSurface, network: PatternNetwork) -> LayeredSurface:
    """The surface with all that lies below the coat in the coat's colour."""
    if surface.coat.equals(0.0) or surface.coat_color.equals(1.0):
        return surface
    passed = network.folded(_mix, [constant(WHITE), surface.coat_color, surface.coat], {0, 1, 2}, "the coat's color")

    def tinted(pattern: Pattern) -> Pattern:
        return network.folded(np.multiply, [pattern, passed], {0, 1}, "a color below the coat")

    return replace(
        surface,
        diffuse=tinted(surface.diffuse),
        metal=None if surface.metal is None else tinted(surface.metal),
        specular=tinted(surface.specular),
        emission=tinted(surface.emission),
    )


def _mix(background: Any, foreground: Any, share: Any) -> Any:
    return background * (1.0 - share) + foreground * share


def reflectance(ior: float) -> float:
    """At normal incidence, of an index of refraction."""
    return ((1.0 - ior) / (1.0 + ior)) ** 2


def ior_of(reflected: float) -> float:
    """The index of refraction, at least 1, that reflects so much at normal incidence."""
    root = float(np.sqrt(min(max(reflected, 0.0), LARGEST_REFLECTANCE)))
    return (1.0 + root) / (1.0 - root)


def _base(surface: LayeredSurface, network: PatternNetwork) -> dict[str, Any]:
    """Colours, metal and index of refraction: with metallic where one index tells all, else with specular colours."""
    weight = surface.specular
    of_ior, of_coat = reflectance(surface.ior), reflectance(surface.coat_ior)
    is_grey = weight.is_constant and len(set(weight.bias.tolist())) == 1
    reflected = float(weight.bias[0]) * of_ior if is_grey else of_ior
    coat_agrees = surface.coat.equals(0.0) or abs(reflected - of_coat) < SAME_REFLECTANCE
    one_color = surface.metal is None or surface.metalness.equals(0.0)
    if surface.transmission > 0.0:
        # Facets reflect by the same index as they refract by: a specular weight would change both.
        return {**_colors(surface, network), "ior": surface.ior} if not one_color else _metallic(surface, network)
    if is_grey and coat_agrees and one_color and reflected <= LARGEST_REFLECTANCE:
        return {**_metallic(surface, network), "ior": surface.ior if weight.equals(1.0) else ior_of(reflected)}
    return {**_colors(surface, network), "ior": surface.coat_ior if not surface.coat.equals(0.0) else surface.ior}


def _metallic(surface: LayeredSurface, network: PatternNetwork) -> dict[str, Any]:
    return {
        "diffuse_color": network.as_value(surface.diffuse, 3),
        "metallic": network.as_value(surface.metalness, 1),
        "ior": surface.ior,
    }


def _colors(surface: LayeredSurface, network: PatternNetwork) -> dict[str, Any]:
    """The base's colours without `metallic`: what it mixes is mixed here."""
    metal = surface.diffuse if surface.metal is None else surface.metal
    dielectric = surface.specular.resized(3) * reflectance(surface.ior)
    if dielectric.is_constant:
        dielectric = constant(np.minimum(dielectric.bias, 1.0))
    share = surface.metalness
    if share.equals(0.0) or share.equals(1.0):
        return {
            "use_specular_workflow": True,
            "diffuse_color": BLACK if share.equals(1.0) else network.as_value(surface.diffuse, 3),
            "specular_color": network.as_value(mixed(dielectric, metal, share), 3),
        }
    diffuse = network.folded(lambda color, m: color * (1.0 - m), [surface.diffuse, share], {0, 1}, "the diffuse color")
    specular = network.folded(_mix, [dielectric, metal, share], {0, 1, 2}, "the specular color")
    return {
        "use_specular_workflow": True,
        "diffuse_color": network.as_value(diffuse, 3),
        "specular_color": network.as_value(specular, 3),
    }


def _normal(pattern: Pattern | None, network: PatternNetwork) -> TextureLookup | None:
    """A picture of normals; constants and primvars leave the surface's own."""
    if pattern is None or pattern.is_constant:
        return None
    value = network.as_value(pattern, 3)
    return value if isinstance(value, TextureLookup) and value.channels == "rgb" else None


class SurfaceInputs:
    """The inputs of one surface shader as patterns, constants within their range."""

    def __init__(self, shader: Any, network: PatternNetwork) -> None:
        self.shader = shader
        self.network = network

    def color(self, name: str, default: Sequence[float] | float, high: float = 1.0) -> Pattern:
        return self._input(name, np.broadcast_to(np.asarray(default, np.float64), 3), high)

    def number(self, name: str, default: float, high: float = 1.0, low: float = 0.0) -> Pattern:
        return self._input(name, np.array([default]), high, low)

    def _input(self, name: str, default: Any, high: float, low: float = 0.0) -> Pattern:
        found = self.network.pattern(self.shader, name, len(default))
        if found is None:
            return constant(default)
        if not found.is_constant:
            return found
        path, reading = self.network.path, self.network.reading
        return constant(clamped(path, f"inputs:{name}", found.bias, default, low, high, reading))

    def fixed(self, name: str, default: float, high: float = 1.0, low: float = 0.0) -> float:
        """A number that cannot vary over the surface; with a warning, its mean where it does."""
        return self.network.number(self.number(name, default, high, low), name)

    def fixed_color(self, name: str, default: Sequence[float] | float, high: float = 1.0) -> tuple[float, float, float]:
        red, green, blue = self.network.numbers(self.color(name, default, high), name).tolist()
        return red, green, blue

    def flag(self, name: str, default: bool = False) -> bool:
        return bool(self.network.constant(self.shader, name, default))

    def normal(self, name: str) -> Pattern | None:
        """A pattern of normals; None for the surface's own, which a node may say as well."""
        node = self.network.node(self.shader, name)
        if node is not None and self.network.kind(node) == OWN_NORMAL:
            return None
        return self.network.pattern(self.shader, name, 3)

    def times(self, color: Pattern, weight: Pattern, name: str) -> Pattern:
        """A colour times its weight; black where that is 0 everywhere, whatever the colour."""
        if weight.equals(0.0):
            return constant(BLACK)
        return self.network.folded(np.multiply, [color, weight], {0, 1}, name)

    def warn_left_out(self, names: Sequence[str], shader_name: str) -> None:
        """One warning of the inputs that are not read and not 0."""
        found = [name for name in names if self._counts(name)]
        if found:
            self.network.reading.warn(
                self.network.path, f"not supported: {', '.join(found)} of {shader_name}; left out"
            )

    def _counts(self, name: str) -> bool:
        """Whether an input is connected, or authored as other than 0."""
        attribute = self.network.source(self.shader, name)
        if attribute is None:
            return False
        if not str(attribute.GetName()).startswith("inputs:"):
            return True
        return bool(np.any(np.asarray(self.network.reading.value(attribute) or 0.0) != 0.0))
