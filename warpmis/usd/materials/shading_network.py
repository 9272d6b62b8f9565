"""What a shader's input is connected to: constants through interfaces, pictures, primvars, and the maps between."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from pxr import UsdShade

from warpmis.scene.texture import Lookup, PrimvarLookup, TextureLookup, Vec4
from warpmis.usd.color_space import AUTO, known_space, linear_color, space_of
from warpmis.usd.materials.texture import TextureReader
from warpmis.usd.reading import Reading
from warpmis.usd.shapes.primvar import PrimvarColumns, PrimvarRead

Transform = tuple[tuple[float, float, float], tuple[float, float, float]]

IDENTITY: Transform = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
WRAP_MODES = ("black", "clamp", "repeat", "mirror")
# A chain of more UsdTransform2d is taken for a circle.
MAX_TRANSFORMS = 16

# Components of the value that each primvar reader gives.
READER_WIDTHS = {
    "UsdPrimvarReader_float": 1,
    "UsdPrimvarReader_float2": 2,
    "UsdPrimvarReader_float3": 3,
    "UsdPrimvarReader_point": 3,
    "UsdPrimvarReader_normal": 3,
    "UsdPrimvarReader_vector": 3,
    "UsdPrimvarReader_float4": 4,
}


@dataclass(eq=False)
class ShadingNetwork:
    """The nodes behind one material's surface shader.

    Attributes:
        path: the material's, for warnings.
        columns: the primvars that the network reads, filled while it is read.
        pending: paths of the node outputs that are being read, so that a circle of connections ends.
    """

    path: Any
    reading: Reading
    textures: TextureReader
    columns: PrimvarColumns = field(default_factory=PrimvarColumns)
    pending: list[Any] = field(default_factory=list)

    def value(self, shader: Any, name: str, width: int) -> Any:
        """What an input takes: a constant of `width` components (1 or 3) or a single number, a lookup, or None.

        None is for the input's default: nothing is authored, or with a warning, what is connected is not known.
        """
        attribute = self.source(shader, name)
        if attribute is None or is_input(attribute):
            return self._numbers(attribute, width)
        node, output = UsdShade.Shader(attribute.GetPrim()), str(attribute.GetBaseName())
        kind = self.kind(node) if node else str(attribute.GetPrim().GetTypeName())
        if attribute.GetPath() in self.pending:
            self.reading.warn(self.path, f"{attribute.GetPath()} is connected to itself in a circle; it is not used")
            return None
        self.pending.append(attribute.GetPath())
        read, found = self.node_value(node, kind, output, width)
        self.pending.pop()
        if read:
            return found
        where = f"{kind} {attribute.GetPrim().GetPath()}"
        self.reading.warn(self.path, f"inputs:{name} is connected to {where}; its fallback is used")
        return self._numbers(attribute.GetPrim().GetAttribute("inputs:fallback"), width)

    def node_value(self, node: Any, kind: str, output: str, width: int) -> tuple[bool, Any]:
        """Whether a node of this kind is known, and what it gives: a lookup, a constant, or None."""
        if kind == "UsdUVTexture":
            return True, self._texture_lookup(node, output, width)
        if READER_WIDTHS.get(kind) in ((1,) if width == 1 else (3, 4)):
            return True, self._primvar_lookup(node, READER_WIDTHS[kind])
        return False, None

    def constant(self, shader: Any, name: str, default: Any) -> Any:
        """An input's constant of the default's type, through any interface connections; with a warning, `default` where
        it is of another type or no constant."""
        attribute = self.source(shader, name)
        if attribute is None:
            return default
        if is_input(attribute):
            return self.reading.get(attribute, default, like=default)
        self.reading.warn(shader.GetPath(), f"inputs:{name} must be constant; {default} is used")
        return default

    def _texture_lookup(self, node: Any, output: str, width: int) -> Any:
        """A lookup of a UsdUVTexture's output; its fallback, as a constant, where the picture cannot be read."""
        channels = output if output in ("r", "g", "b", "a") else "rgb" if width == 3 else "r"
        fallback = self._vec4(node, "fallback", None)
        texture = None
        file = self.source(node, "file")
        if file is not None and is_input(file):
            texture = self.textures.read(file, self._color_space(node, file))
        else:
            self.reading.warn(node.GetPath(), "the texture names no file; its fallback is used")
        if texture is None:
            return _component(fallback, channels)
        column, transform = self._coordinates(node, "st")
        return TextureLookup(
            texture=texture,
            column=column,
            channels=channels,
            transform=transform,
            wrap_s=self._token(node, "wrapS", WRAP_MODES, "black"),
            wrap_t=self._token(node, "wrapT", WRAP_MODES, "black"),
            scale=self._vec4(node, "scale", (1.0, 1.0, 1.0, 1.0)),
            bias=self._vec4(node, "bias", (0.0, 0.0, 0.0, 0.0)),
            fallback=fallback or (0.0, 0.0, 0.0, 1.0),
        )

    def _primvar_lookup(self, node: Any, components: int) -> Lookup | None:
        fallback = self.vector(node, "fallback", components, (0.0,) * components)
        name = self._name(node)
        return PrimvarLookup(self.columns.column(PrimvarRead(name, fallback))) if name else None

    def _coordinates(self, node: Any, name: str, depth: int = 0) -> tuple[int, Transform]:
        """Column of the texture coordinates that an input takes, and the map that they go through."""
        attribute = self.source(node, name)
        if attribute is not None and not is_input(attribute):
            source = UsdShade.Shader(attribute.GetPrim())
            kind = self.kind(source) if source else ""
            if kind == "UsdTransform2d" and depth < MAX_TRANSFORMS:
                column, before = self._coordinates(source, "in", depth + 1)
                return column, self._transform(source, before)
            if kind == "UsdPrimvarReader_float2":
                fallback = self.vector(source, "fallback", 2, (0.0, 0.0))
                return self.columns.column(PrimvarRead(self._name(source), fallback)), IDENTITY
            self.reading.warn(node.GetPath(), f"inputs:{name} is connected to {kind}; (0, 0) is used")
            return self.columns.column(PrimvarRead("", (0.0, 0.0))), IDENTITY
        constant = self.vector(node, name, 2, (0.0, 0.0))
        shown = f"({constant[0]:g}, {constant[1]:g})"
        self.reading.warn(node.GetPath(), f"inputs:{name} is not connected; every point is looked up at {shown}")
        return self.columns.column(PrimvarRead("", constant)), IDENTITY

    def _transform(self, node: Any, before: Transform) -> Transform:
        """UsdTransform2d after another map: scale, then rotation (counter-clockwise, degrees), then translation."""
        angle = np.radians(self.vector(node, "rotation", 1, (0.0,))[0])
        cosine, sine = np.cos(angle), np.sin(angle)
        scale = self.vector(node, "scale", 2, (1.0, 1.0))
        linear = np.array([[cosine, -sine], [sine, cosine]]) @ np.diag(scale)
        rows = linear @ np.array(before)
        rows[:, 2] += self.vector(node, "translation", 2, (0.0, 0.0))
        (a, b, c), (d, e, f) = rows.tolist()
        return (a, b, c), (d, e, f)

    def _color_space(self, node: Any, file: Any) -> str:
        """sourceColorSpace where it is authored, else the space of the file's attribute, else AUTO."""
        authored = str(self.constant(node, "sourceColorSpace", ""))
        if authored in ("", "useMetadata"):
            return space_of(file, AUTO, self.reading)
        found = known_space(authored)
        if found is None:
            self.reading.warn(node.GetPath(), f"sourceColorSpace {authored} is not known; {AUTO} is used")
        return found or AUTO

    def _name(self, node: Any) -> str:
        """The primvar that a reader reads."""
        name = str(self.constant(node, "varname", ""))
        if not name:
            self.reading.warn(node.GetPath(), "it names no primvar; its fallback is used")
        return name

    def _token(self, node: Any, name: str, allowed: tuple[str, ...], default: str) -> str:
        value = str(self.constant(node, name, default))
        if value not in allowed and value not in ("useMetadata", ""):
            self.reading.warn(node.GetPath(), f"{name} {value} is not known; {default} is used")
        return value if value in allowed else default

    def _vec4(self, node: Any, name: str, default: Vec4 | None) -> Any:
        return self.vector(node, name, 4, default)

    def vector(self, node: Any, name: str, components: int, default: Any) -> Any:
        """A constant of so many components, finite."""
        attribute = self.source(node, name)
        if attribute is not None and not is_input(attribute):
            self.reading.warn(node.GetPath(), f"inputs:{name} must be constant; {default} is used")
            return default
        value = self._numbers(attribute, components)
        if value is None:
            return default
        vector = np.broadcast_to(np.atleast_1d(np.asarray(value, np.float64)), components)
        if not np.isfinite(vector).all():
            self.reading.warn(node.GetPath(), f"inputs:{name} must be {components} finite numbers; it is not used")
            return default
        return tuple(vector.tolist())

    def _numbers(self, attribute: Any, width: int) -> Any:
        """A constant of `width` components as USD has it, or of one, which stands for all; None without one."""
        if not attribute:
            return None
        is_single = width == 1 or str(attribute.GetTypeName()) in ("float", "double", "half")
        value = self.reading.get(attribute, like=0.0 if is_single else np.zeros(width))
        return value if is_single else linear_color(attribute, value, self.reading)

    def kind(self, node: Any) -> str:
        """The identifier of a node's shader, "None" where it has none."""
        return str(self.reading.get(node.GetIdAttr()))

    def source(self, shader: Any, name: str) -> Any:
        """The attribute that gives an input its value: an input with a constant, or a node's output; None without any,
        with a warning where the input is connected to what does not exist."""
        shader_input = shader.GetInput(name)
        if not shader_input:
            return None
        producing = UsdShade.Utils.GetValueProducingAttributes(shader_input)
        if producing:
            return producing[0]
        for path in shader_input.GetRawConnectedSourcePaths():
            if not self.reading.stage.GetObjectAtPath(path):
                self.reading.warn(shader_input.GetAttr().GetPath(), f"it is connected to {path}, which does not exist")
        return None

    def node(self, shader: Any, name: str) -> Any:
        """The node that an input is connected to, or None."""
        attribute = self.source(shader, name)
        return None if attribute is None or is_input(attribute) else UsdShade.Shader(attribute.GetPrim())


def is_input(attribute: Any) -> bool:
    return bool(UsdShade.Utils.GetType(attribute.GetName()) == UsdShade.AttributeType.Input)


def _component(value: Vec4 | None, channels: str) -> Any:
    """The part of a texture's fallback that an output carries."""
    if value is None:
        return None
    return value[:3] if channels == "rgb" else value["rgba".index(channels)]
