"""MaterialX's pattern nodes in a stage: pictures, coordinates, primvars, and the arithmetic between them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from warpmis.scene.texture import FIRST_TILE, Texture
from warpmis.usd.color_space import RAW, space_of
from warpmis.usd.materials.library_graphs import LibraryGraphs, source_within
from warpmis.usd.materials.node_math import MATH, NodeMath, category_of
from warpmis.usd.materials.pattern import Pattern, Picture, bordered, constant, joined, primvar
from warpmis.usd.materials.pattern_network import PatternNetwork, width_of
from warpmis.usd.materials.shading_network import is_input
from warpmis.usd.materials.texture_coordinates import coordinate_pattern, texture_coordinates, transform_of
from warpmis.usd.shapes.primvar import PrimvarRead

WRAP_MODES = {"constant": "black", "clamp": "clamp", "periodic": "repeat", "mirror": "mirror"}
COMPONENTS = {"r": 0, "g": 1, "b": 2, "a": 3, "x": 0, "y": 1, "z": 2, "w": 3}
# Texels of one cell of a checkerboard, from side to side, and of a split.
CELL = 128
SPLIT = 1024

# What stands for a procedural node: the mean of its values, by the input that says it, or as a number.
MEANS: dict[str, str | float] = {
    "noise2d": "pivot",
    "noise3d": "pivot",
    "fractal2d": 0.0,
    "fractal3d": 0.0,
    "cellnoise2d": 0.5,
    "cellnoise3d": 0.5,
    "worleynoise2d": 0.5,
    "worleynoise3d": 0.5,
    "unifiednoise2d": 0.5,
    "unifiednoise3d": 0.5,
    "randomfloat": 0.5,
}


@dataclass(eq=False)
class MaterialXNetwork(PatternNetwork):
    """A network whose nodes may be MaterialX's as well as UsdPreviewSurface's.

    Attributes:
        graphs: what stands for nodes of the standard library that are graphs of others.
    """

    graphs: LibraryGraphs = field(default_factory=LibraryGraphs)

    def source(self, shader: Any, name: str) -> Any:
        if shader.GetPrim().GetStage() == self.reading.stage:
            return super().source(shader, name)
        port = shader.GetInput(name)
        found = source_within(port) if port else None
        node = None if found is None else self.graphs.interface(found)
        if found is None or node is None:
            return found
        outer = self.source(node, str(found.GetBaseName()))
        return found if outer is None and found.HasAuthoredValue() else outer

    def node_pattern(self, node: Any, kind: str, output: str, width: int) -> tuple[bool, Pattern | None]:
        if kind.startswith("ND_Usd"):
            return super().node_pattern(node, preview_kind(kind), output, width)
        category = _first_word(kind)
        if category in READERS:
            return True, READERS[category](self, node, kind, output, width)
        if category in MEANS:
            return True, self._mean(node, kind, category, width)
        if kind == "ND_artistic_ior" and output == "extinction":
            return True, self._math(node, "artistic_extinction", width)
        if name := category_of(kind):
            return True, self._math(node, name, width)
        inner = self.graphs.output(node, kind, output)
        if inner is not None:
            return True, self._of_output(inner)
        return super().node_pattern(node, kind, output, width)

    def _math(self, node: Any, name: str, width: int) -> Pattern | None:
        """A node of arithmetic; None where what it is about is not known."""
        math = MATH[name]
        if name == "switch":
            return self._switched(node, width)
        found = {
            each: self.pattern(node, each, self.width_of_input(node, each) or len(default))
            for each, default in math.inputs.items()
        }
        first = next(iter(found))
        if found[first] is None and self.node(node, first) is not None:
            return None
        patterns = _matched(
            [constant(default) if found[each] is None else found[each] for each, default in math.inputs.items()], math
        )
        if name.startswith("if") and patterns[0].is_constant and patterns[1].is_constant:
            holds = bool(math.function(patterns[0].bias, patterns[1].bias, np.ones(1), np.zeros(1))[0])
            return patterns[2 if holds else 3].resized(width)
        affine = {list(math.inputs).index(each) for each in math.affine}
        return self.folded(math.function, patterns, affine, f"{name} {node.GetPath()}").resized(width)

    def _switched(self, node: Any, width: int) -> Pattern | None:
        which = self.pattern_or(node, "which", (0.0,))
        place = int(np.floor(self.number(which, "which")))
        return self.pattern_or(node, f"in{place + 1}", (0.0,) * width)

    def _mean(self, node: Any, kind: str, category: str, width: int) -> Pattern:
        """A procedural node's mean, with a warning."""
        told = MEANS[category]
        mean = constant(told) if isinstance(told, float) else self.pattern_or(node, told, (0.0,))
        self.reading.warn(self.path, f"{kind} {node.GetPath()} is not supported; its mean is used")
        return mean.resized(width)

    def _image(self, node: Any, kind: str, output: str, width: int) -> Pattern | None:
        """A lookup of an image node; its `default` where the picture cannot be read."""
        file = self.source(node, "file")
        texture = None
        if file is not None and is_input(file):
            # Colours alone have a space in MaterialX.
            space = space_of(file, RAW, self.reading) if "_color" in kind else RAW
            texture = self.textures.read(file, space)
        if texture is None:
            return self.pattern(node, "default", width)
        tiled = kind.startswith("ND_tiledimage")
        column, transform = texture_coordinates(self, node, tiled)
        wraps = [str(self.constant(node, f"{axis}addressmode", "periodic")) for axis in "uv"]
        wrap_s, wrap_t = ("repeat" if tiled else WRAP_MODES.get(mode, "repeat") for mode in wraps)
        source = Picture(texture, column, transform, wrap_s, wrap_t)
        found = Pattern(np.zeros(width), np.ones(width), tuple(range(width)), source)
        if "black" not in (wrap_s, wrap_t) or texture.is_udim:
            return found
        return bordered(found, self.numbers(self.pattern_or(node, "default", (0.0,) * width), "default"))

    def _normal_map(self, node: Any, kind: str, output: str, width: int) -> Pattern | None:
        """A tangent-space map's texels in [0, 1] as vectors, x and y times the node's scale."""
        found = self.pattern(node, "in", 3)
        if found is None or str(self.constant(node, "space", "tangent")) != "tangent":
            return None
        along = self.numbers(self.pattern_or(node, "scale", (1.0,), self.width_of_input(node, "scale") or 1), "scale")
        scale = constant([along[0], along[-1], 1.0])
        return (found * 2.0 - 1.0) * scale

    def _component(self, node: Any, kind: str, output: str, width: int) -> Pattern | None:
        """One component, of a separate node by its output's name, of an extract node by its index."""
        found = self.pattern(node, "in", self.width_of_input(node, "in") or 4)
        if found is None:
            return None
        if kind.startswith("ND_extract"):
            place = int(self.number(self.pattern_or(node, "index", (0.0,)), "index"))
        else:
            place = COMPONENTS.get(output.removeprefix("out"), 0)
        return found.picked(min(max(place, 0), found.width - 1))

    def _converted(self, node: Any, kind: str, output: str, width: int) -> Pattern | None:
        found = self.pattern(node, "in", self.width_of_input(node, "in") or width)
        if found is not None and found.width == 3 and width == 4:
            return joined([found, constant(1.0)])
        return None if found is None else found.resized(width)

    def _combined(self, node: Any, kind: str, output: str, width: int) -> Pattern:
        count = int(kind.removeprefix("ND_combine")[0])
        widths = {"CF": (3, 1), "VV": (2, 2), "VF": (3, 1)}.get(kind[-2:], (1,) * count)
        parts = [self.pattern_or(node, f"in{k + 1}", (0.0,) * each) for k, each in enumerate(widths)]

        def side_by_side(*values: Any) -> Any:
            shape = np.broadcast_shapes(*[value.shape[:-1] for value in values])
            return np.concatenate([np.broadcast_to(value, (*shape, value.shape[-1])) for value in values], axis=-1)

        varying = {id(part.source) for part in parts if not part.is_constant}
        return joined(parts) if len(varying) < 2 else self.folded(side_by_side, parts, (), f"{kind} {node.GetPath()}")

    def _swizzled(self, node: Any, kind: str, output: str, width: int) -> Pattern | None:
        """MaterialX's node before 1.39: the components that `channels` spells, 0 and 1 among them."""
        found = self.pattern(node, "in", self.width_of_input(node, "in") or 4)
        if found is None:
            return None
        letters = str(self.constant(node, "channels", ""))[:width] or "rgba"[:width]
        parts = [
            constant(float(letter)) if letter in "01" else found.picked(min(COMPONENTS.get(letter, 0), found.width - 1))
            for letter in letters
        ]
        return joined(parts).resized(width)

    def _primvar(self, node: Any, kind: str, output: str, width: int) -> Pattern | None:
        if kind.startswith("ND_geomcolor"):
            return primvar(PrimvarRead("displayColor", (0.0,) * 3)).resized(width)
        if width == 2:
            return self._coordinates_of(node, kind, output, width)
        name = str(self.constant(node, "geomprop", ""))
        default = self.numbers(self.pattern_or(node, "default", (0.0,) * width), "default")
        return primvar(PrimvarRead(name, tuple(default.tolist())))

    def _coordinates_of(self, node: Any, kind: str, output: str, width: int) -> Pattern | None:
        found = coordinate_pattern(self, node, kind.replace("_vector3", "_vector2"))
        return None if found is None else found.resized(width)

    def _ramp(self, node: Any, kind: str, output: str, width: int) -> Pattern:
        """Two texels a direction, looked up between their centres: exactly linear from 0 to 1, and clamped beyond."""
        names = {
            "ramplr": [["valuel", "valuer"]] * 2,
            "ramptb": [["valuet"] * 2, ["valueb"] * 2],
            "ramp4": [["valuetl", "valuetr"], ["valuebl", "valuebr"]],
        }[kind.removeprefix("ND_").split("_")[0]]
        texels = [[self.numbers(self.pattern_or(node, n, (0.0,) * width), n) for n in row] for row in names]
        return self._drawn(node, np.array(texels), "clamp", ((0.5, 0.25), (0.5, 0.25)))

    def _split(self, node: Any, kind: str, output: str, width: int) -> Pattern:
        names = ("valuel", "valuer") if kind.startswith("ND_splitlr") else ("valueb", "valuet")
        low, high = (self.pattern_or(node, name, (0.0,) * width) for name in names)
        center = self.number(self.pattern_or(node, "center", (0.5,)), "center")
        row = ((np.arange(SPLIT) + 0.5) / SPLIT >= center).astype(np.float64)
        texels = row[None, :, None] if names[0] == "valuel" else row[::-1, None, None]
        return self._chosen(low, high, self._drawn(node, texels, "clamp", ((1.0, 0.0), (1.0, 0.0))), node)

    def _checkerboard(self, node: Any, kind: str, output: str, width: int) -> Pattern:
        first, second = self.pattern_or(node, "color1", (1.0,) * 3), self.pattern_or(node, "color2", (0.0,) * 3)
        tiling = self.numbers(self.pattern_or(node, "uvtiling", (8.0, 8.0)), "uvtiling")
        offset = self.numbers(self.pattern_or(node, "uvoffset", (0.0, 0.0)), "uvoffset")
        cells = np.kron(np.array([[0.0, 1.0], [1.0, 0.0]])[::-1], np.ones((CELL, CELL)))[..., None]
        # The picture holds two cells in each direction.
        lines = ((0.5 * tiling[0], -0.5 * offset[0]), (0.5 * tiling[1], -0.5 * offset[1]))
        return self._chosen(second, first, self._drawn(node, cells, "repeat", lines), node)

    def _chosen(self, low: Pattern, high: Pattern, share: Pattern, node: Any) -> Pattern:
        name = f"{self.kind(node)} {node.GetPath()}"
        return self.folded(lambda a, b, s: a * (1.0 - s) + b * s, [low, high, share], {0, 1, 2}, name)

    def _drawn(self, node: Any, texels: Any, wrap: str, lines: Any) -> Pattern:
        """A picture of our own, shape (rows, columns, n), looked up at scale * coordinate + offset in s and t."""
        column, before = texture_coordinates(self, node, False)
        (a, b), (c, d) = lines
        rows = np.diag([a, c]) @ np.array(before) + np.array([[0.0, 0.0, b], [0.0, 0.0, d]])
        pixels = np.zeros((*texels.shape[:2], 3 if texels.shape[2] == 2 else texels.shape[2]), np.float32)
        pixels[..., : texels.shape[2]] = texels
        width = texels.shape[2]
        source = Picture(Texture({FIRST_TILE: pixels}), column, transform_of(rows), wrap, wrap)
        return Pattern(np.zeros(width), np.ones(width), tuple(range(width)), source)

    def width_of_input(self, node: Any, name: str) -> int:
        """The components of an input by its type; 0 where it is not there."""
        found = node.GetInput(name)
        return width_of(found.GetAttr()) if found else 0


def _matched(patterns: Sequence[Pattern | None], math: NodeMath) -> list[Pattern]:
    """The operands of a node of arithmetic as its function takes them: vectors of their number of components, and
    where it takes numbers alone, numbers or vectors of one length."""
    found = [pattern for pattern in patterns if pattern is not None]
    lengths = [len(default) for default in math.inputs.values()]
    if max(lengths) == 1:
        widest = max(pattern.width for pattern in found)
        return [pattern if pattern.width == 1 else pattern.resized(widest) for pattern in found]
    # Colours may have an alpha.
    return [
        pattern if length == 3 and pattern.width == 4 and place == 0 else pattern.resized(length)
        for place, (pattern, length) in enumerate(zip(found, lengths, strict=True))
    ]


def preview_kind(kind: str) -> str:
    """UsdPreviewSurface's own name of one of its nodes in MaterialX, such as ND_UsdUVTexture_23."""
    name = kind.removeprefix("ND_")
    head, _, last = name.rpartition("_")
    name = head if last.isdigit() else name
    readers = {"vector2": "float2", "vector3": "float3", "vector4": "float4"}
    head, _, last = name.rpartition("_")
    return f"{head}_{readers[last]}" if last in readers else name


def _first_word(kind: str) -> str:
    """The category of a node definition whose category is one word; "" for what is none of MaterialX's."""
    return kind.removeprefix("ND_").split("_")[0] if kind.startswith("ND_") else ""


def is_pattern_node(kind: str) -> bool:
    """Whether a MaterialXNetwork knows a node, if only its mean or where it looks."""
    word = _first_word(kind)
    return word in READERS or word in MEANS or word in GEOMETRY or kind.startswith("ND_Usd") or bool(category_of(kind))


READERS: dict[str, Callable[[MaterialXNetwork, Any, str, str, int], Pattern | None]] = {
    "image": MaterialXNetwork._image,
    "tiledimage": MaterialXNetwork._image,
    "normalmap": MaterialXNetwork._normal_map,
    "separate2": MaterialXNetwork._component,
    "separate3": MaterialXNetwork._component,
    "separate4": MaterialXNetwork._component,
    "extract": MaterialXNetwork._component,
    "convert": MaterialXNetwork._converted,
    "combine2": MaterialXNetwork._combined,
    "combine3": MaterialXNetwork._combined,
    "combine4": MaterialXNetwork._combined,
    "swizzle": MaterialXNetwork._swizzled,
    "geompropvalue": MaterialXNetwork._primvar,
    "geomcolor": MaterialXNetwork._primvar,
    "texcoord": MaterialXNetwork._coordinates_of,
    "place2d": MaterialXNetwork._coordinates_of,
    "rotate2d": MaterialXNetwork._coordinates_of,
    "ramplr": MaterialXNetwork._ramp,
    "ramptb": MaterialXNetwork._ramp,
    "ramp4": MaterialXNetwork._ramp,
    "splitlr": MaterialXNetwork._split,
    "splittb": MaterialXNetwork._split,
    "checkerboard": MaterialXNetwork._checkerboard,
}
# What the library has no graph for.
GEOMETRY = ("position", "normal", "tangent", "bitangent")
