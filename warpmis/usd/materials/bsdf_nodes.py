"""MaterialX's BSDF and EDF nodes: what a graph of them adds up to, as one layered surface.

Lobes of one kind add up with their weights. What lies over a surface that has a specular lobe already is its coat.
Reference: Smythe, Stone et al. (2024), "MaterialX Physically Based Shading Nodes" 1.39.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
from pxr import UsdShade

from warpmis.usd.materials.layered_surface import (
    BLACK,
    INFINITY,
    NO_COLOR,
    NONE,
    WHITE,
    LayeredSurface,
    SurfaceInputs,
    ior_of,
    reflectance,
)
from warpmis.usd.materials.materialx_network import MaterialXNetwork
from warpmis.usd.materials.pattern import Pattern, constant
from warpmis.usd.materials.pattern_network import LONGEST_CHAIN

# The width of facets where a node says nothing: alpha, the square of a roughness.
DEFAULT_ALPHA = 0.05
LEFT_OUT = ("thinfilm_thickness", "retroreflective")
DEFAULT_IOR = 1.5
Result = TypeVar("Result")


@dataclass(frozen=True, eq=False)
class Lobes:
    """What BSDF nodes add up to.

    Attributes:
        diffuse: albedo, three components.
        specular: reflectance at normal incidence, three components; alpha: of its facets, None without any.
        coat, coat_ior, coat_alpha: a dielectric above all that.
        transmission: the share that refracts, by ior, in its colour.
        normal: of the first node that has one of its own.
    """

    diffuse: Pattern = NO_COLOR
    specular: Pattern = NO_COLOR
    alpha: Pattern | None = None
    coat: Pattern = NONE
    coat_ior: float = DEFAULT_IOR
    coat_alpha: Pattern | None = None
    transmission: Pattern = NONE
    transmission_color: Pattern = NO_COLOR
    ior: float = DEFAULT_IOR
    normal: Pattern | None = None


class BsdfReader:
    """Reads the graph of BSDF and EDF nodes behind one surface node."""

    def __init__(self, network: MaterialXNetwork) -> None:
        self.network = network
        # What outputs were read as, by their path and the type that was asked for; None while they are being read.
        self.found: dict[Any, Any] = {}

    def surface(self, shader: Any) -> LayeredSurface:
        """The layered surface of a `surface` node."""
        lobes = self.lobes(shader, "bsdf")
        inputs = SurfaceInputs(shader, self.network)
        share = float(np.clip(self.network.number(lobes.transmission, "weight"), 0.0, 1.0))
        color = self.network.numbers(lobes.transmission_color, "tint")
        red, green, blue = np.clip(color / max(share, 1e-6), 0.0, 1.0).tolist()
        # The dielectric's share of what is seen is the whole interface, where it refracts.
        kept = 1.0 / max(1.0 - share, 1e-6) if share > 0.0 else 1.0
        return LayeredSurface(
            diffuse=lobes.diffuse * kept if share < 1.0 else NO_COLOR,
            specular=lobes.specular * (1.0 / reflectance(DEFAULT_IOR)),
            ior=lobes.ior if share > 0.0 else DEFAULT_IOR,
            roughness=self._roughness(lobes.alpha),
            coat=lobes.coat,
            coat_ior=lobes.coat_ior,
            coat_roughness=self._roughness(lobes.coat_alpha),
            emission=self.emission(shader, "edf"),
            opacity=inputs.number("opacity", 1.0),
            normal=lobes.normal,
            transmission=share,
            transmission_color=(red, green, blue),
            thin_walled=inputs.flag("thin_walled"),
        )

    def _roughness(self, alpha: Pattern | None) -> Pattern:
        found = constant(DEFAULT_ALPHA) if alpha is None else alpha.resized(1)
        return self.network.folded(lambda a: np.sqrt(np.clip(a, 0.0, 1.0)), [found], (), "roughness")

    def _folded(self, function: Any, inputs: list[Pattern], affine: set[int], node: Any) -> Pattern:
        return self.network.folded(function, inputs, affine, f"{self.network.kind(node)} {node.GetPath()}")

    def lobes(self, shader: Any, name: str) -> Lobes:
        """What an input is connected to; no lobe at all where it is not connected."""
        return self._once(shader, name, self._lobes, Lobes())

    def emission(self, shader: Any, name: str) -> Pattern:
        """The radiance [nit] of the EDF that an input is connected to, three components."""
        return self._once(shader, name, self._emission, NO_COLOR)

    def _once(self, shader: Any, name: str, read: Callable[[Any], Result], nothing: Result) -> Result:
        """What the node that an input is connected to was read as; nothing without one, and, with a warning, where it
        is connected to itself."""
        attribute = self.network.source(shader, name)
        if attribute is None or not str(attribute.GetName()).startswith("outputs:"):
            return nothing
        key = attribute.GetPath(), type(nothing)
        pending = sum(found is None for found in self.found.values())
        if key not in self.found and pending < LONGEST_CHAIN:
            self.found[key] = None
            self.found[key] = read(UsdShade.Shader(attribute.GetPrim()))
        if self.found.get(key) is None:
            self.network.reading.warn(self.network.path, f"{key[0]} is connected to itself in a circle; it is not used")
            return nothing
        return self.found[key]

    def _lobes(self, node: Any) -> Lobes:
        kind = self.network.kind(node).removeprefix("ND_")
        if kind.startswith("layer_"):
            return self._layered(node)
        if kind == "mix_bsdf":
            return self._mixed(node)
        if kind == "add_bsdf":
            return self._sum(self.lobes(node, "in1"), self.lobes(node, "in2"), node)
        if kind.startswith("multiply_bsdf"):
            factor = self.network.pattern_or(node, "in2", (1.0,), 1 if kind.endswith("F") else 3)
            return self._scaled(self.lobes(node, "in1"), factor, node)
        leaf = LEAVES.get(kind)
        if leaf is not None:
            inputs = SurfaceInputs(node, self.network)
            inputs.warn_left_out(LEFT_OUT, kind)
            return replace(leaf(self, node), normal=inputs.normal("normal"))
        inner = self.network.graphs.output(node, f"ND_{kind}", "out")
        if inner is not None:
            return self._lobes(UsdShade.Shader(inner.GetPrim()))
        self.network.reading.warn(self.network.path, f"ND_{kind} {node.GetPath()} is not supported; it is left out")
        return Lobes()

    def _weighted(self, node: Any, name: str, default: float) -> Pattern:
        """A colour input times the node's weight."""
        inputs = SurfaceInputs(node, self.network)
        return inputs.times(inputs.color(name, default), inputs.number("weight", 1.0), name)

    def diffuse(self, node: Any) -> Lobes:
        """Oren and Nayar's, and Burley's, as Lambert's."""
        SurfaceInputs(node, self.network).warn_left_out(("roughness",), self.network.kind(node))
        return Lobes(diffuse=self._weighted(node, "color", 0.18))

    def subsurface(self, node: Any) -> Lobes:
        kind = self.network.kind(node)
        self.network.reading.warn(self.network.path, f"not supported: {kind}; its color is rendered as diffuse")
        return Lobes(diffuse=self._weighted(node, "color", 0.18))

    def dielectric(self, node: Any) -> Lobes:
        """By its scatter_mode: what it reflects, what it refracts, or both."""
        inputs = SurfaceInputs(node, self.network)
        ior = inputs.fixed("ior", DEFAULT_IOR, INFINITY, 1e-3)
        weight, tint = inputs.number("weight", 1.0), self._weighted(node, "tint", 1.0)
        return self._interface(node, tint * reflectance(ior), weight, tint, ior)

    def schlick(self, node: Any) -> Lobes:
        color = self._weighted(node, "color0", 1.0)
        inputs = SurfaceInputs(node, self.network)
        weight, tint = inputs.number("weight", 1.0), self._weighted(node, "color90", 1.0)
        return self._interface(node, color, weight, tint, ior_of(float(inputs.color("color0", WHITE).mean.mean())))

    def _interface(self, node: Any, reflected: Pattern, weight: Pattern, tint: Pattern, ior: float) -> Lobes:
        mode = str(self.network.constant(node, "scatter_mode", "R"))
        alpha = self._alpha(node)
        lobes = Lobes(specular=reflected if "R" in mode else NO_COLOR, alpha=alpha, ior=ior)
        return replace(lobes, transmission=weight, transmission_color=tint) if "T" in mode else lobes

    def conductor(self, node: Any) -> Lobes:
        """By the index of refraction and the extinction of each channel."""
        inputs = SurfaceInputs(node, self.network)
        n = inputs.color("ior", (0.183, 0.421, 1.373), INFINITY)
        k = inputs.color("extinction", (3.424, 2.346, 1.770), INFINITY)

        def fresnel(n: Any, k: Any, weight: Any) -> Any:
            return weight * ((n - 1.0) ** 2 + k * k) / ((n + 1.0) ** 2 + k * k)

        color = self._folded(fresnel, [n, k, inputs.number("weight", 1.0)], {2}, node)
        return Lobes(specular=color, alpha=self._alpha(node))

    def nothing(self, node: Any) -> Lobes:
        if not SurfaceInputs(node, self.network).number("weight", 1.0).equals(0.0):
            kind = self.network.kind(node)
            self.network.reading.warn(self.network.path, f"not supported: {kind}; it is left out")
        return Lobes()

    def _alpha(self, node: Any) -> Pattern:
        return self.network.pattern_or(node, "roughness", (DEFAULT_ALPHA,), 2).resized(1)

    def _layered(self, node: Any) -> Lobes:
        """A top over a base: the top reflects for both, or is a coat where the base has a specular lobe."""
        top, base = self.lobes(node, "top"), self.lobes(node, "base")
        if top.specular.equals(0.0) or (base.specular.equals(0.0) and base.coat.equals(0.0)):
            return self._sum(top, base, node)
        if not base.coat.equals(0.0):
            self.network.reading.warn(self.network.path, f"{node.GetPath()} has a second coat; it is left out")
            return base
        usual = max(reflectance(top.ior), 1e-6)
        weight = self._folded(lambda f: f / usual, [top.specular], {0}, node).resized(1)
        return replace(base, coat=weight, coat_ior=top.ior, coat_alpha=top.alpha)

    def _mixed(self, node: Any) -> Lobes:
        share = self.network.pattern_or(node, "mix", (0.0,))
        if share.equals(0.0) or share.equals(1.0):
            return self.lobes(node, "bg" if share.equals(0.0) else "fg")
        foreground, background = self.lobes(node, "fg"), self.lobes(node, "bg")
        rest = self._folded(lambda s: 1.0 - s, [share], {0}, node)
        return self._sum(self._scaled(foreground, share, node), self._scaled(background, rest, node), node)

    def _scaled(self, lobes: Lobes, factor: Pattern, node: Any) -> Lobes:
        def scaled(pattern: Pattern) -> Pattern:
            return pattern if pattern.equals(0.0) else self._folded(np.multiply, [pattern, factor], {0, 1}, node)

        return replace(
            lobes,
            diffuse=scaled(lobes.diffuse),
            specular=scaled(lobes.specular),
            coat=scaled(lobes.coat).resized(1),
            transmission=scaled(lobes.transmission).resized(1),
            transmission_color=scaled(lobes.transmission_color),
        )

    def _sum(self, first: Lobes, second: Lobes, node: Any) -> Lobes:
        """Both together; facets are those of the lobe that reflects more."""

        def total(a: Pattern, b: Pattern) -> Pattern:
            if a.equals(0.0) or b.equals(0.0):
                return b if a.equals(0.0) else a
            return self._folded(np.add, [a, b], {0, 1}, node)

        def energy(lobes: Lobes) -> float:
            return float(lobes.specular.mean.mean() + lobes.transmission.mean.mean())

        facets = max(second, first, key=energy)
        coated = second if first.coat.equals(0.0) else first
        refracts = second if first.transmission.equals(0.0) else first
        if min(energy(first), energy(second)) > 0.0 and not _same(first.alpha, second.alpha):
            self.network.reading.warn(self.network.path, "lobes of several roughnesses have that of the strongest one")
        return Lobes(
            diffuse=total(first.diffuse, second.diffuse),
            specular=total(first.specular, second.specular),
            alpha=facets.alpha,
            coat=total(first.coat, second.coat),
            coat_ior=coated.coat_ior,
            coat_alpha=coated.coat_alpha,
            transmission=total(first.transmission, second.transmission),
            transmission_color=total(first.transmission_color, second.transmission_color),
            ior=refracts.ior,
            normal=second.normal if first.normal is None else first.normal,
        )

    def _emission(self, node: Any) -> Pattern:
        kind = self.network.kind(node).removeprefix("ND_")
        inputs = SurfaceInputs(node, self.network)
        if kind == "uniform_edf":
            return inputs.color("color", WHITE, INFINITY)
        if kind == "add_edf":
            parts = [self.emission(node, each) for each in ("in1", "in2")]
            return self._folded(np.add, parts, {0, 1}, node)
        if kind.startswith("multiply_edf"):
            factor = self.network.pattern_or(node, "in2", (1.0,), 1 if kind.endswith("F") else 3)
            return self._folded(np.multiply, [self.emission(node, "in1"), factor], {0, 1}, node)
        if kind == "mix_edf":
            parts = [self.emission(node, each) for each in ("bg", "fg")]
            share = self.network.pattern_or(node, "mix", (0.0,))
            return self._folded(lambda b, f, s: b * (1.0 - s) + f * s, [*parts, share], {0, 1, 2}, node)
        if kind == "generalized_schlick_edf":
            inputs.warn_left_out(("color90",), kind)
            color = inputs.color("color0", WHITE)
            return self._folded(np.multiply, [self.emission(node, "base"), color], {0, 1}, node)
        self.network.reading.warn(self.network.path, f"ND_{kind} {node.GetPath()} is not supported; it does not emit")
        return constant(BLACK)


def _same(first: Pattern | None, second: Pattern | None) -> bool:
    """Whether two patterns are one, or equal numbers."""
    if first is second or first is None or second is None:
        return True
    if first.source is not second.source:
        return False
    return first.channels == second.channels and np.array_equal([first.scale, first.bias], [second.scale, second.bias])


COMBINATIONS = (
    *("layer_", "mix_bsdf", "mix_edf", "add_bsdf", "add_edf", "multiply_bsdf", "multiply_edf", "uniform_edf"),
    *("conical_edf", "measured_edf", "generalized_schlick_edf"),
)
LEAVES = {
    "oren_nayar_diffuse_bsdf": BsdfReader.diffuse,
    "burley_diffuse_bsdf": BsdfReader.diffuse,
    "subsurface_bsdf": BsdfReader.subsurface,
    "dielectric_bsdf": BsdfReader.dielectric,
    "generalized_schlick_bsdf": BsdfReader.schlick,
    "conductor_bsdf": BsdfReader.conductor,
    "sheen_bsdf": BsdfReader.nothing,
    "translucent_bsdf": BsdfReader.nothing,
}


def is_bsdf_node(kind: str) -> bool:
    """Whether a node of a graph of BSDFs or EDFs is known, if only to be left out."""
    name = kind.removeprefix("ND_")
    return name in LEAVES or name.startswith(COMBINATIONS)
