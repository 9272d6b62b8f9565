"""A MaterialX file as a layer of UsdShade materials, as USD's own plugin for such files lays them out.

/MaterialX/Materials holds a Material for each of the file's, with its nodes and node graphs below it. Nodes that the
file defines itself, and nodes of the standard library that nobody here knows, become the graphs that implement them.
Reference: Smythe, Stone et al. (2024), "MaterialX Specification" 1.39; OpenUSD's usdMtlx.
"""

from __future__ import annotations

import os
from functools import cache
from typing import Any

from pxr import Ar, Sdf, Tf, Usd, UsdShade

from warpmis.usd.materials.bsdf_nodes import is_bsdf_node
from warpmis.usd.materials.image import PictureError, asset_bytes
from warpmis.usd.materials.materialx import is_materialx
from warpmis.usd.materials.materialx_network import is_pattern_node

ROOT = Sdf.Path("/MaterialX")
MATERIALS = ROOT.AppendChild("Materials")
CONTEXT = "mtlx"
INSTALL = 'it needs MaterialX: pip install "warpmis[materialx]"'
# Graphs within graphs; a file that needs more is taken for a circle.
MAX_FLATTENINGS = 8

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
COLORED = ("color3", "color4", "filename")


class MtlxError(ValueError):
    """A MaterialX file that cannot be read; the message says why."""


def mtlx_layer(resolved_path: str) -> Any:
    """An anonymous layer of a file's materials, whose default prim is /MaterialX.

    Raises:
        MtlxError: the file cannot be read, or MaterialX is not installed.
    """
    document = _document(resolved_path)
    # A stage does not keep its layers for others.
    layer = Sdf.Layer.CreateAnonymous(f"{os.path.basename(resolved_path)}.usda")
    stage = Usd.Stage.Open(layer)
    stage.SetDefaultPrim(stage.DefinePrim(ROOT))
    stage.DefinePrim(MATERIALS, "Scope")
    writer = DocumentWriter(stage, resolved_path, document)
    for node in document.getMaterialNodes():
        writer.material(node)
    return layer


@cache
def _library() -> Any:
    """MaterialX's standard library."""
    import MaterialX

    library = MaterialX.createDocument()
    MaterialX.loadLibraries(MaterialX.getDefaultDataLibraryFolders(), MaterialX.getDefaultDataSearchPath(), library)
    return library


def _document(resolved_path: str) -> Any:
    """A file, with what it includes, and with graphs in the place of nodes that are not known."""
    try:
        import MaterialX
    except ImportError:
        raise MtlxError(INSTALL) from None
    kinds = (
        "Exception",
        "ExceptionFileMissing",
        "ExceptionFoundCycle",
        "ExceptionOrphanedElement",
        "ExceptionParseError",
    )
    failures = tuple(getattr(MaterialX, kind) for kind in kinds)
    document = MaterialX.createDocument()
    try:
        if os.path.isfile(resolved_path):
            MaterialX.readFromXmlFile(document, resolved_path)
        else:
            MaterialX.readFromXmlString(document, asset_bytes(resolved_path).decode("utf-8"))
        own = document.getNodeGraphs()
        document.setDataLibrary(_library())
        for _ in range(MAX_FLATTENINGS):
            before = MaterialX.writeToXmlString(document)
            for graph in [document, *(graph for graph in own if not graph.getNodeDefString())]:
                graph.flattenSubgraphs(filter=_is_unknown)
            if MaterialX.writeToXmlString(document) == before:
                break
    except (*failures, PictureError, UnicodeDecodeError) as error:
        raise MtlxError(" ".join(str(error).split())) from None
    return document


def _is_unknown(node: Any) -> bool:
    """Whether a node can be replaced by a graph, and must be."""
    definition = node.getNodeDef()
    kind = definition.getName() if definition else ""
    return bool(kind) and not (is_materialx(kind) or is_pattern_node(kind) or is_bsdf_node(kind))


class DocumentWriter:
    """Writes a document's materials to a stage, each node once below each material that uses it."""

    def __init__(self, stage: Any, source: str, document: Any) -> None:
        self.stage = stage
        self.source = source
        self.document = document

    def material(self, node: Any) -> None:
        path = MATERIALS.AppendChild(_prim_name(node.getName()))
        material = UsdShade.Material.Define(self.stage, path)
        for each in node.getActiveInputs():
            kind = {"surfaceshader": "surface", "displacementshader": "displacement"}.get(each.getType())
            source = self._connection(each, path, self.document) if kind else None
            if source is not None:
                output = material.CreateOutput(f"{CONTEXT}:{kind}", Sdf.ValueTypeNames.Token)
                output.GetAttr().SetConnections([source])

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
            return None if graph is None else self._graph(graph, parent).AppendProperty(f"outputs:{_of(graph, output)}")
        node = scope.getNode(name) if name else None
        if node is None:
            return None
        return self._node(node, parent, scope).AppendProperty(f"outputs:{output or 'out'}")

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
            shader.CreateOutput(name, TYPES.get(kind, Sdf.ValueTypeNames.Token))
        for each in node.getActiveInputs():
            self._input(shader, each, parent, scope)
        return path

    def _graph(self, graph: Any, parent: Any) -> Any:
        """The path of a node graph, with all that its outputs depend on."""
        path = parent.AppendChild(_prim_name(graph.getName()))
        if self.stage.GetPrimAtPath(path):
            return path
        found = UsdShade.NodeGraph.Define(self.stage, path)
        for each in graph.getActiveInputs():
            self._input(found, each, parent, self.document)
        for each in graph.getActiveOutputs():
            output = found.CreateOutput(each.getName(), TYPES.get(each.getType(), Sdf.ValueTypeNames.Token))
            source = self._connection(each, path, graph)
            if source is not None:
                output.GetAttr().SetConnections([source])
        return path

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
            return int(numbers[0]) if kind == "integer" else numbers[0] if kind == "float" else tuple(numbers)
        except ValueError:
            return None

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
