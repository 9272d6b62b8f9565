"""Arnold's standard_surface by the names of its inputs, with image and normal_map nodes.

Reference: Autodesk (2024), "Arnold User Guide", the pages of standard_surface, image and normal_map.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from warpmis.scene import Material
from warpmis.usd.color_space import AUTO, known_space, space_of
from warpmis.usd.materials.layered_surface import SurfaceInputs, material_of
from warpmis.usd.materials.pattern import Pattern, Picture, constant
from warpmis.usd.materials.pattern_network import PatternNetwork
from warpmis.usd.materials.shading_network import Transform, is_input
from warpmis.usd.materials.surface_shaders import standard_surface
from warpmis.usd.shapes.primvar import PrimvarRead

PREFIX = "arnold:"
WRAP_MODES = {"periodic": "repeat", "black": "black", "clamp": "clamp", "mirror": "mirror", "file": "repeat"}
COMPONENTS = {"r": 0, "g": 1, "b": 2, "a": 3}


def is_arnold(kind: str) -> bool:
    """Whether `read_arnold` knows the surface shader."""
    return kind.removeprefix(PREFIX) == "standard_surface"


def read_arnold(shader: Any, network: ArnoldNetwork) -> Material:
    """The Material of an Arnold surface shader."""
    return material_of(standard_surface(SurfaceInputs(shader, network), "Arnold's standard_surface"), network)


class ArnoldNetwork(PatternNetwork):
    """A network of Arnold's image and normal_map nodes."""

    def node_pattern(self, node: Any, kind: str, output: str, width: int) -> tuple[bool, Pattern | None]:
        name = kind.removeprefix(PREFIX)
        if name == "image":
            found = self._image(node)
            place = COMPONENTS.get(output)
            if found is None or place is None:
                return True, None if found is None else found.resized(max(width, 1))
            return True, found.picked(place)
        if name == "normal_map":
            return True, self._normal_map(node)
        return super().node_pattern(node, kind, output, width)

    def _image(self, node: Any) -> Pattern | None:
        """The four channels of a picture file, times `multiply`, and `offset` more."""
        file = self.source(node, "filename")
        if file is None or not is_input(file):
            self.reading.warn(node.GetPath(), "the texture names no file; it is left out")
            return None
        named = str(self.constant(node, "color_space", "auto"))
        space = known_space(named)
        if space is None:
            self.reading.warn(node.GetPath(), f"color_space {named} is not known; {AUTO} is used")
        texture = self.textures.read(file, space_of(file, AUTO, self.reading) if space in (None, AUTO) else space)
        if texture is None:
            return None
        name = str(self.constant(node, "uvset", "")) or "st"
        column = self.columns.column(PrimvarRead(name, (0.0, 0.0)))
        wraps = [WRAP_MODES.get(str(self.constant(node, f"{axis}wrap", "periodic")), "repeat") for axis in "st"]
        source = Picture(texture, column, self._transform_of(node), wraps[0], wraps[1])
        factor = np.append(self.vector(node, "multiply", 3, (1.0, 1.0, 1.0)), 1.0)
        offset = np.append(self.vector(node, "offset", 3, (0.0, 0.0, 0.0)), 0.0)
        return Pattern(offset, factor, (0, 1, 2, 3), source)

    def _transform_of(self, node: Any) -> Transform:
        """Coordinates are moved, then scaled; swapped and flipped first."""

        def number(name: str, default: float) -> float:
            return float(self.vector(node, name, 1, (default,))[0])

        rows = np.eye(3)
        if self.constant(node, "swap_st", False):
            rows = rows[[1, 0, 2]]
        for axis, letter in enumerate("st"):
            if self.constant(node, f"{letter}flip", False):
                rows[axis] = np.array([0.0, 0.0, 1.0]) - rows[axis]
            rows[axis] = rows[axis] * number(f"{letter}scale", 1.0)
            rows[axis, 2] += number(f"{letter}offset", 0.0)
        (a, b, c), (d, e, f) = rows[:2].tolist()
        return (a, b, c), (d, e, f)

    def _normal_map(self, node: Any) -> Pattern | None:
        """A map in tangent space, in [0, 1] unless color_to_signed is off; `strength` scales x and y."""
        found = self.pattern(node, "input", 3)
        if found is None or not self.constant(node, "tangent_space", True):
            return None
        signed = found * 2.0 - 1.0 if self.constant(node, "color_to_signed", True) else found
        strength = float(self.vector(node, "strength", 1, (1.0,))[0])
        return signed * constant([strength, strength, 1.0])
