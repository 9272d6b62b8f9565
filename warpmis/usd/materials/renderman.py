"""RenderMan's surfaces by the names of their inputs: PxrSurface, PxrDisneyBsdf and PxrDisney, with PxrTexture.

References: Pixar (2024), "RenderMan Documentation", the pages of these nodes; Burley (2012), "Physically-Based Shading
at Disney"; Burley (2015), "Extending the Disney BRDF to a BSDF with Integrated Subsurface Scattering".
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from warpmis.scene import Material
from warpmis.usd.color_space import RAW, SRGB, space_of
from warpmis.usd.materials.layered_surface import (
    BLACK,
    INFINITY,
    WHITE,
    LayeredSurface,
    SurfaceInputs,
    ior_of,
    material_of,
    reflectance,
)
from warpmis.usd.materials.pattern import Pattern, Picture, constant, primvar
from warpmis.usd.materials.pattern_network import PatternNetwork
from warpmis.usd.materials.shading_network import Transform, is_input
from warpmis.usd.shapes.primvar import PrimvarRead

PHYSICAL = 1
PXR_SURFACE_LEFT_OUT = (
    *("fuzzGain", "subsurfaceGain", "singlescatterGain", "singlescatterDirectGain", "iridescenceFaceGain"),
    *("iridescenceEdgeGain", "diffuseTransmitGain", "specularAnisotropy", "clearcoatThickness", "ssAlbedo"),
    *("irradianceTint", "inputMaterial"),
)
DISNEY_LEFT_OUT = ("subsurface", "anisotropic", "sheen", "diffTrans", "scatterDistance", "flatness")
# Burley (2012), section 5.6: the reflectance of specular 1, the coat's largest weight, and its widths.
FULL_SPECULAR = 0.08
FULL_COAT = 0.25
COAT_WIDTHS = (0.1, 0.001)
OUTPUTS = {"resultR": 0, "resultG": 1, "resultB": 2, "resultA": 3, "resultF": 0}


def is_renderman(kind: str) -> bool:
    """Whether `read_renderman` knows the surface shader."""
    return kind in SURFACES


def read_renderman(shader: Any, network: RenderManNetwork) -> Material:
    """The Material of a RenderMan surface shader."""
    kind = network.kind(shader)
    return material_of(SURFACES[kind](SurfaceInputs(shader, network)), network)


def pxr_surface(inputs: SurfaceInputs) -> LayeredSurface:
    """Diffuse, the primary specular lobe (the rough one where that is black), coat, glass and glow."""
    inputs.warn_left_out(PXR_SURFACE_LEFT_OUT, "PxrSurface")
    diffuse = inputs.times(inputs.color("diffuseColor", 0.18), inputs.number("diffuseGain", 1.0), "diffuseColor")
    name = "specular"
    face = _face(inputs, name)
    if face.equals(0.0):
        name, face = "roughSpecular", _face(inputs, "roughSpecular")
    elif not _face(inputs, "roughSpecular").equals(0.0):
        inputs.network.reading.warn(inputs.network.path, "not supported: roughSpecular of PxrSurface; left out")
    glass = inputs.fixed("refractionGain", 0.0)
    coat = _face(inputs, "clearcoat")
    coat_reflectance = float(inputs.network.numbers(coat, "clearcoatFaceColor").max())
    roughness = ("glassRoughness", 0.1) if glass > 0.0 else (f"{name}Roughness", 0.2 if name == "specular" else 0.6)
    return LayeredSurface(
        diffuse=diffuse,
        metal=face,
        # The face's colour is the reflectance as it is, whatever an index of refraction says.
        metalness=constant(0.0),
        specular=inputs.network.folded(lambda f: f / reflectance(1.5), [face], {0}, "specularFaceColor"),
        roughness=inputs.number(*roughness),
        ior=1.5 if glass == 0.0 else inputs.fixed("glassIor", 1.5, INFINITY, 1e-3),
        coat=constant(1.0 if coat_reflectance > 0.0 else 0.0),
        coat_roughness=inputs.number("clearcoatRoughness", 0.0),
        coat_ior=ior_of(coat_reflectance),
        emission=inputs.times(
            inputs.color("glowColor", WHITE, INFINITY), inputs.number("glowGain", 0.0, INFINITY), "glowColor"
        ),
        opacity=inputs.number("presence", 1.0),
        normal=inputs.normal("bumpNormal"),
        transmission=glass,
        transmission_color=inputs.fixed_color("refractionColor", WHITE) if glass > 0.0 else WHITE,
        thin_walled=inputs.flag("thinGlass"),
    )


def _face(inputs: SurfaceInputs, lobe: str) -> Pattern:
    """A lobe's reflectance at normal incidence: the face's colour; in physical mode that of an index of refraction and
    an extinction, times the edge's colour."""
    mode = inputs.fixed(f"{lobe}FresnelMode", 0.0, 1.0)
    edge = inputs.color(f"{lobe}EdgeColor", BLACK)
    if mode != PHYSICAL:
        face = inputs.color(f"{lobe}FaceColor", BLACK)
        if not face.equals(0.0) and not edge.equals(1.0):
            inputs.network.reading.warn(inputs.network.path, f"{lobe}EdgeColor of PxrSurface counts as white")
        return face
    if edge.equals(0.0):
        return edge
    ior = inputs.color(f"{lobe}Ior", 1.5, INFINITY)
    extinction = inputs.color(f"{lobe}ExtinctionCoeff", 0.0, INFINITY)

    def fresnel(n: Any, k: Any, tint: Any) -> Any:
        return tint * ((n - 1.0) ** 2 + k * k) / ((n + 1.0) ** 2 + k * k)

    return inputs.network.folded(fresnel, [ior, extinction, edge], {2}, f"{lobe}Ior")


def pxr_disney(inputs: SurfaceInputs) -> LayeredSurface:
    """PxrDisney: the reflectance of 0.08 specular."""
    specular = inputs.number("specular", 0.5)
    return _disney(inputs, "PxrDisney", specular * (FULL_SPECULAR / reflectance(1.5)), 1.5)


def pxr_disney_bsdf(inputs: SurfaceInputs) -> LayeredSurface:
    """PxrDisneyBsdf: the reflectance of an index of refraction, and a share that refracts."""
    surface = _disney(
        inputs,
        "PxrDisneyBsdf",
        inputs.number("specReflectScale", 1.0, INFINITY),
        inputs.fixed("ior", 1.5, INFINITY, 1e-3),
    )
    # What is black absorbs nothing here: the colour is not asked for before it is authored.
    color = inputs.fixed_color("transColor", BLACK)
    return replace(
        surface,
        transmission=inputs.fixed("specTrans", 0.0),
        transmission_color=color if max(color) > 0.0 else WHITE,
        transmission_depth=inputs.fixed("transDistance", 1.0, INFINITY) if max(color) > 0.0 else 0.0,
        thin_walled=inputs.flag("isThin"),
    )


def _disney(inputs: SurfaceInputs, name: str, specular: Pattern, ior: float) -> LayeredSurface:
    inputs.warn_left_out(DISNEY_LEFT_OUT, name)
    base = inputs.color("baseColor", 0.5)
    tint = inputs.number("specularTint", 0.0)
    if not tint.equals(0.0):
        specular = inputs.network.folded(_tinted, [specular, base, tint], {0}, "specularTint")
    low, high = COAT_WIDTHS
    gloss = inputs.number("clearcoatGloss", 1.0)
    return LayeredSurface(
        diffuse=base,
        metalness=inputs.number("metallic", 0.0),
        specular=specular,
        ior=ior,
        roughness=inputs.number("roughness", 0.25),
        coat=inputs.number("clearcoat", 0.0) * FULL_COAT,
        coat_roughness=inputs.network.folded(
            lambda g: np.sqrt(np.maximum(low + (high - low) * g, 0.0)), [gloss], (), "clearcoatGloss"
        ),
        coat_ior=1.5,
        emission=inputs.color("emitColor", BLACK, INFINITY),
        opacity=inputs.number("presence", 1.0),
        normal=inputs.normal("bumpNormal"),
    )


def _tinted(specular: Any, base: Any, tint: Any) -> Any:
    """The reflectance in the base's hue, of luminance 1. Reference: Burley (2012), appendix."""
    luminance = np.sum(base * np.array([0.3, 0.6, 0.1]), axis=-1, keepdims=True)
    hue = np.where(luminance > 0.0, base / np.where(luminance > 0.0, luminance, 1.0), 1.0)
    return specular * (1.0 - tint + tint * hue)


SURFACES: dict[str, Callable[[SurfaceInputs], LayeredSurface]] = {
    "PxrSurface": pxr_surface,
    "PxrDisney": pxr_disney,
    "PxrDisneyBsdf": pxr_disney_bsdf,
}


class RenderManNetwork(PatternNetwork):
    """A network of RenderMan's pattern nodes that pass a picture or a primvar on."""

    def node_pattern(self, node: Any, kind: str, output: str, width: int) -> tuple[bool, Pattern | None]:
        if kind == "PxrTexture":
            found = self._texture(node)
            return True, None if found is None else _of_output(found, output, width)
        if kind == "PxrNormalMap":
            return True, self._normal_map(node)
        if kind == "PxrPrimvar":
            return True, self._primvar(node, output, width)
        if kind == "PxrToFloat":
            return True, self.pattern(node, "input", 3)
        if kind == "PxrInvert":
            found = self.pattern(node, "inputRGB", 3)
            return True, None if found is None else _of_output(constant(1.0) - found, output, width)
        return super().node_pattern(node, kind, output, width)

    def _texture(self, node: Any) -> Pattern | None:
        """The four channels of a picture file."""
        file = self.source(node, "filename")
        if file is None or not is_input(file):
            self.reading.warn(node.GetPath(), "the texture names no file; it is left out")
            return None
        linearize = bool(self.vector(node, "linearize", 1, (0.0,))[0])
        texture = self.textures.read(file, space_of(file, SRGB if linearize else RAW, self.reading))
        if texture is None:
            return None
        column, transform = self._manifold(node)
        if self.vector(node, "invertT", 1, (1.0,))[0] == 0.0:
            (a, b, c), (d, e, f) = transform
            transform = (a, b, c), (-d, -e, 1.0 - f)
        source = Picture(texture, column, transform, "repeat", "repeat")
        return Pattern(np.zeros(4), np.ones(4), (0, 1, 2, 3), source)

    def _manifold(self, node: Any) -> tuple[int, Transform]:
        """The coordinates, scaled, turned counter-clockwise [degree], and moved by a PxrManifold2D."""
        source = self.node(node, "manifold")
        kind = "" if source is None else self.kind(source)
        if source is not None and kind != "PxrManifold2D":
            self.reading.warn(node.GetPath(), f"its manifold {kind} is not supported; st is used")
        if kind != "PxrManifold2D":
            return self.columns.column(PrimvarRead("st", (0.0, 0.0))), ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))

        def number(name: str, default: float) -> float:
            return float(self.vector(source, name, 1, (default,))[0])

        angle = np.radians(number("angle", 0.0))
        scale_s, scale_t = number("scaleS", 1.0), number("scaleT", 1.0)
        cosine, sine = float(np.cos(angle)), float(np.sin(angle))
        return self.columns.column(PrimvarRead("st", (0.0, 0.0))), (
            (cosine * scale_s, -sine * scale_t, number("offsetS", 0.0)),
            (sine * scale_s, cosine * scale_t, number("offsetT", 0.0)),
        )

    def _normal_map(self, node: Any) -> Pattern | None:
        found = self.pattern(node, "inputRGB", 3)
        if found is None:
            texture = self._texture(node)
            found = None if texture is None else texture.resized(3)
        scale = float(self.vector(node, "bumpScale", 1, (1.0,))[0])
        return None if found is None else (found * 2.0 - 1.0) * constant([scale, scale, 1.0])

    def _primvar(self, node: Any, output: str, width: int) -> Pattern | None:
        name = str(self.constant(node, "varname", ""))
        components = {"float": 1, "float2": 2}.get(str(self.constant(node, "type", "float")), 3)
        if not name:
            return None
        return _of_output(primvar(PrimvarRead(name, (0.0,) * components)), output, width)


def _of_output(pattern: Pattern, output: str, width: int) -> Pattern:
    """What of a node's result an output carries."""
    place = OUTPUTS.get(output)
    return pattern.resized(width) if place is None else pattern.picked(min(place, pattern.width - 1))
