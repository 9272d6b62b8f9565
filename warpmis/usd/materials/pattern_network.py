"""A shading network whose inputs are read as patterns: what arithmetic makes of numbers, pictures and primvars."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from pxr import UsdShade

from warpmis.scene.texture import PrimvarLookup, TextureLookup
from warpmis.usd.materials.pattern import (
    CannotFold,
    Pattern,
    constant,
    evaluated,
    of_lookup,
    primvar,
    value_of,
)
from warpmis.usd.materials.shading_network import ShadingNetwork, is_input

# Nodes one behind the other.
LONGEST_CHAIN = 100


@dataclass(eq=False)
class PatternNetwork(ShadingNetwork):
    """The nodes behind one material's surface shader, read as patterns.

    Attributes:
        patterns: what node outputs gave, by their path; None for what is not known.
    """

    patterns: dict[Any, Pattern | None] = field(default_factory=dict)

    def value(self, shader: Any, name: str, width: int) -> Any:
        found = self.pattern(shader, name, width)
        return None if found is None else self.as_value(found, width)

    def as_value(self, pattern: Pattern, width: int) -> Any:
        """A pattern as a Material has its inputs; what of it cannot be looked up is its mean, with a warning."""
        try:
            value = value_of(pattern, width, self.columns)
        except CannotFold as reason:
            self.reading.warn(self.path, f"an input is not supported as it is: {reason}; its mean is used")
            value = value_of(constant(pattern.mean), width, self.columns)
        if isinstance(value, TextureLookup) and not self.textures.admits(value.texture):
            self.reading.warn(self.path, "the stage's textures have too many texels; the mean of a picture is used")
            return value_of(constant(pattern.mean), width, self.columns)
        return value

    def pattern(self, shader: Any, name: str, width: int) -> Pattern | None:
        """What an input takes, of so many components; None for the input's default: nothing is authored, or with a
        warning, what is connected is not known."""
        attribute = self.source(shader, name)
        if attribute is None or is_input(attribute):
            return self._numbers_pattern(attribute, width)
        path = attribute.GetPath()
        if path in self.pending:
            self.reading.warn(self.path, f"{path} is connected to itself in a circle; it is not used")
            return None
        if path not in self.patterns and len(self.pending) >= LONGEST_CHAIN:
            self.reading.warn(
                self.path, f"more than {LONGEST_CHAIN} nodes lie one behind the other; the last are not used"
            )
            return None
        if path not in self.patterns:
            self.pending.append(path)
            self.patterns[path] = self._of_output(attribute)
            self.pending.pop()
        found = self.patterns[path]
        return None if found is None else found.resized(width)

    def pattern_or(self, shader: Any, name: str, default: Sequence[float], width: int = 0) -> Pattern:
        """What an input takes, of the default's width, or the default."""
        found = self.pattern(shader, name, width or len(default))
        return constant(default) if found is None else found

    def _numbers_pattern(self, attribute: Any, width: int) -> Pattern | None:
        numbers = self._numbers(attribute, width_of(attribute) or width) if attribute else None
        if numbers is None:
            return None
        if not np.isfinite(numbers).all():
            self.reading.warn(attribute.GetPath(), "it must be finite; it is not used")
            return None
        return constant(numbers).resized(width)

    def _of_output(self, attribute: Any) -> Pattern | None:
        """What a node's output gives; None, with a warning that names the node, for one that is not known."""
        node, output = UsdShade.Shader(attribute.GetPrim()), str(attribute.GetBaseName())
        kind = self.kind(node) if node else str(attribute.GetPrim().GetTypeName())
        try:
            known, found = self.node_pattern(node, kind, output, width_of(attribute) or 1)
        except CannotFold as reason:
            self.reading.warn(self.path, f"{kind} {node.GetPath()} is not used: {reason}")
            return None
        if not known:
            self.reading.warn(self.path, f"{kind} {attribute.GetPrim().GetPath()} is not known; its default is used")
            return self._numbers_pattern(attribute.GetPrim().GetAttribute("inputs:fallback"), width_of(attribute) or 1)
        return found

    def node_pattern(self, node: Any, kind: str, output: str, width: int) -> tuple[bool, Pattern | None]:
        """Whether a node of this kind is known, and what its output of so many components gives."""
        known, found = self.node_value(node, kind, output, min(width, 3) if width != 2 else 1)
        if isinstance(found, TextureLookup):
            return known, of_lookup(found)
        if isinstance(found, PrimvarLookup):
            reads = {column: read for read, column in self.columns.reads.items()}
            return known, primvar(reads[found.column])
        return known, None if found is None else constant(found)

    def folded(self, function: Any, inputs: Sequence[Pattern], affine: Any, name: str) -> Pattern:
        """A function of patterns; where no picture can hold it, pictures that lie elsewhere count as their mean."""
        try:
            return evaluated(function, inputs, affine)
        except CannotFold as reason:
            self.reading.warn(self.path, f"{name} is approximated: {reason}; the mean of all but one is used")
        kept = max(inputs, key=_detail)
        patterns = [one if one is kept else constant(one.mean) for one in inputs]
        try:
            return evaluated(function, patterns, affine)
        except CannotFold:
            return evaluated(function, [constant(one.mean) for one in patterns])

    def vector(self, node: Any, name: str, components: int, default: Any) -> Any:
        """A constant of so many components, finite, also one that a graph of numbers gives."""
        attribute = self.source(node, name)
        if attribute is None or is_input(attribute):
            return super().vector(node, name, components, default)
        found = self.pattern(node, name, components)
        return default if found is None else tuple(self.numbers(found, name).tolist())

    def number(self, pattern: Pattern, name: str) -> float:
        """A pattern that a Material has as one number; with a warning, its mean where it varies."""
        return float(self.numbers(pattern.resized(1), name)[0])

    def numbers(self, pattern: Pattern, name: str) -> Any:
        """A pattern that a Material has as numbers, shape (n,); with a warning, their means where it varies."""
        if not pattern.is_constant:
            shown = ", ".join(f"{number:g}" for number in pattern.mean)
            self.reading.warn(self.path, f"a varying inputs:{name} is not supported; its mean {shown} is used")
        return pattern.mean


def _detail(pattern: Pattern) -> float:
    """How much of it a picture shows: of several that cannot be one, that of the most colours and texels is kept."""
    source = pattern.source
    if source is None:
        return -1.0
    texture = getattr(source, "texture", None)
    texels = 0 if texture is None else sum(pixels[..., 0].size for pixels in texture.tiles.values())
    return texels + 1e10 * len(set(pattern.channels))


def width_of(attribute: Any) -> int:
    """The number of components of an attribute's type; 0 for what is not numbers."""
    default = attribute.GetTypeName().scalarType.defaultValue
    values = np.asarray(default)
    if values.dtype.kind not in "iufb":
        return 0
    return int(values.size) if values.ndim <= 1 else 0
