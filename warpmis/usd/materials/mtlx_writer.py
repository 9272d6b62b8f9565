"""MaterialX documents as UsdShade prims: materials, nodes and node graphs, as USD's own reader lays them out."""

from __future__ import annotations

import math
import os
from functools import cache
from typing import Any

from pxr import Ar, Sdf, Tf, UsdShade

ROOT = Sdf.Path("/MaterialX")
MATERIALS = ROOT.AppendChild("Materials")
CONTEXT = "mtlx"

TYPES = {
    "float": Sdf.ValueTypeNames.Float,
    "integer": Sdf.ValueTypeNames.Int,
    "boolean": Sdf.ValueTypeNames.Bool,
    "color3": Sdf.ValueTypeNames.Color3f,
    "color4": Sdf.ValueTypeNames.Color4f,
    "vector2": Sdf.ValueTypeNames.Float2,
    "vector3": Sdf.ValueTypeNames.Float3,
    "vector4": Sdf.ValueTypeNames.Float4,
    "string": Sdf.ValueTypeNames.String,
    "filename": Sdf.ValueTypeNames.Asset,
}
WIDTHS = {"color3": 3, "color4": 4, "vector2": 2, "vector3": 3, "vector4": 4}
COLORED = ("color3", "color4", "filename")


@cache
def standard_library() -> Any:
    """MaterialX's standard library, as a document.

    Raises:
        ImportError: MaterialX is not installed.
    """
    import MaterialX

    library = MaterialX.createDocument()
    MaterialX.loadLibraries(MaterialX.getDefaultDataLibraryFolders(), MaterialX.getDefaultDataSearchPath(), library)
    return library


# Nodes one behind the other; a chain that is longer ends there.
LONGEST_CHAIN = 100


class DocumentWriter:
    """Writes a document's materials to a stage, each node once below each material that uses it."""

    def __init__(self, stage: Any, source: str, document: Any) -> None:
        self.stage = stage
        self.source = source
        self.document = document
        self.depth = 0

    def material(self, node: Any) -> None:
        path = MATERIALS.AppendChild(_prim_name(node.getName()))
        material = UsdShade.Material.Define(self.stage, path)
        for each in node.getActiveInputs():
            kind = {"surfaceshader": "surface", "displacementshader": "displacement"}.get(each.getType())
            source = self._connection(each, path, self.document) if kind else None
            if source is not None:
                output = material.CreateOutput(f"{CONTEXT}:{kind}", Sdf.ValueTypeNames.Token)
                output.GetAttr().SetConnections([source])

    def definition(self, definition: Any, graph: Any, path: Any) -> Any:
        """The node graph of a node definition, with the definition's inputs and their defaults."""
        found = UsdShade.NodeGraph.Define(self.stage, path)
        for each in definition.getActiveInputs():
            self._input(found, each, path.GetParentPath(), self.document)
        self._outputs(found, graph, path)
        return found

    def _connection(self, element: Any, parent: Any, scope: Any) -> Any:
        """The path of the output that an input, or an output of a graph, is connected to; None for none.

        Args:
            parent: the path of the prim that holds the nodes of the element's `scope`, a graph or the document.
        """
        name, graph_name = element.getNodeName(), element.getNodeGraphString()
        output = element.getOutputString()
        if not name and not graph_name and output and (inner := scope.getOutput(output)) is not None:
            return self._connection(inner, parent, scope)
        if graph_name:
            graph = self.document.getNodeGraph(graph_name)
            return None if graph is None else self._graph(graph, parent).AppendProperty(_output(_of(graph, output)))
        node = scope.getNode(name) if name else None
        if node is None:
            return None
        return self._node(node, parent, scope).AppendProperty(_output(output or "out"))

    def _node(self, node: Any, parent: Any, scope: Any) -> Any:
        """The path of a node's shader."""
        path = parent.AppendChild(_prim_name(node.getName()))
        if self.stage.GetPrimAtPath(path):
            return path
        shader = UsdShade.Shader.Define(self.stage, path)
        definition = node.getNodeDef()
        shader.CreateIdAttr(definition.getName() if definition else f"ND_{node.getCategory()}_{node.getType()}")
        outputs = definition.getActiveOutputs() if definition else []
        for name, kind in {each.getName(): each.getType() for each in outputs}.items() or {("out", node.getType())}:
            shader.CreateOutput(_prim_name(name), TYPES.get(kind, Sdf.ValueTypeNames.Token))
        self.depth += 1
        for each in node.getActiveInputs() if self.depth <= LONGEST_CHAIN else ():
            self._input(shader, each, parent, scope)
        self.depth -= 1
        return path

    def _graph(self, graph: Any, parent: Any) -> Any:
        """The path of a node graph, with all that its outputs depend on."""
        path = parent.AppendChild(_prim_name(graph.getName()))
        if self.stage.GetPrimAtPath(path):
            return path
        found = UsdShade.NodeGraph.Define(self.stage, path)
        for each in graph.getActiveInputs():
            self._input(found, each, parent, self.document)
        self._outputs(found, graph, path)
        return path

    def _outputs(self, found: Any, graph: Any, path: Any) -> None:
        for each in graph.getActiveOutputs():
            output = found.CreateOutput(_prim_name(each.getName()), TYPES.get(each.getType(), Sdf.ValueTypeNames.Token))
            source = self._connection(each, path, graph)
            if source is not None:
                output.GetAttr().SetConnections([source])

    def _input(self, owner: Any, element: Any, parent: Any, scope: Any) -> None:
        """An input: connected to an output or to the graph's interface, or a value in its colour space."""
        kind = element.getType()
        attribute = owner.CreateInput(
            _prim_name(element.getName()), TYPES.get(kind, Sdf.ValueTypeNames.Token)
        ).GetAttr()
        if element.getInterfaceName():
            interface = parent.AppendProperty(f"inputs:{_prim_name(element.getInterfaceName())}")
            attribute.SetConnections([interface])
            return
        source = self._connection(element, parent, scope)
        if source is not None:
            attribute.SetConnections([source])
            return
        value = self._value(element, kind)
        if value is not None:
            attribute.Set(value)
            if kind in COLORED and element.getActiveColorSpace():
                attribute.SetColorSpace(element.getActiveColorSpace())

    def _value(self, element: Any, kind: str) -> Any:
        """A value as USD has it; None for an empty or broken one, and for a type that holds no value."""
        text = element.getResolvedValueString() or element.getValueString()
        if kind == "filename":
            return Sdf.AssetPath(self._file(text)) if text else None
        if kind == "string":
            return text
        if kind == "boolean":
            return text == "true"
        if kind not in TYPES or not text:
            return None
        try:
            numbers = [float(number) for number in text.split(",")]
        except ValueError:
            return None
        if len(numbers) != WIDTHS.get(kind, 1) or not all(map(math.isfinite, numbers)):
            return None
        return int(numbers[0]) if kind == "integer" else numbers[0] if kind == "float" else tuple(numbers)

    def _file(self, path: str) -> str:
        """A path that the MaterialX file names, from the place of that file on."""
        # Relative paths never mean a search path here, nor does a UDIM one have to exist.
        is_relative = not (os.path.isabs(path) or ":" in path or path.startswith("."))
        return str(
            Ar.GetResolver().CreateIdentifier(f"./{path}" if is_relative else path, Ar.ResolvedPath(self.source))
        )


def _of(graph: Any, output: str) -> str:
    """The name of a graph's output: the one that is asked for, or the first."""
    names = [each.getName() for each in graph.getActiveOutputs()]
    return output or next(iter(names), "out")


def _prim_name(name: str) -> str:
    return str(Tf.MakeValidIdentifier(name))


def _output(name: str) -> str:
    return f"outputs:{_prim_name(name)}"
