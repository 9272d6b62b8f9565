"""Nodes of MaterialX's standard library that are graphs of others: the graph is written out for each node.

A graph lies on a stage of its own, below the node's path. What its interface takes, the node's inputs give.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from typing import Any

from pxr import Sdf, Usd

from warpmis.usd.materials.mtlx_writer import DocumentWriter, standard_library


@cache
def library_graph(kind: str) -> tuple[Any, Any] | None:
    """A node definition of the standard library and the graph that implements it; None where there is none, or where
    MaterialX is not installed."""
    if not kind.startswith("ND_"):
        return None
    try:
        library = standard_library()
    except ImportError:
        return None
    definition = library.getNodeDef(kind)
    graph = definition.getImplementation() if definition else None
    return (definition, graph) if graph is not None and graph.getCategory() == "nodegraph" else None


def is_library_surface(kind: str) -> bool:
    """Whether a surface shader is a graph of the library."""
    found = library_graph(kind)
    return found is not None and found[0].getType() == "surfaceshader"


@dataclass(eq=False)
class LibraryGraphs:
    """The graphs that one network has met.

    Attributes:
        graphs: by the path of the node.
        bound: the node that gives an interface's input, by the path of that input.
        stages: those that hold the graphs, kept alive here.
    """

    graphs: dict[Any, Any] = field(default_factory=dict)
    bound: dict[Any, Any] = field(default_factory=dict)
    stages: list[Any] = field(default_factory=list)

    def of(self, node: Any, kind: str) -> Any:
        """The graph that a node stands for; None where the library has none."""
        found = library_graph(kind)
        if found is None:
            return None
        definition, graph = found
        path = node.GetPath().AppendChild("_graph")
        if path not in self.graphs:
            layer = Sdf.Layer.CreateAnonymous("graph.usda")
            stage = Usd.Stage.Open(layer)
            self.stages.append(stage)
            written = DocumentWriter(stage, "", standard_library()).definition(definition, graph, path)
            self.graphs[path] = written
            self.bound |= {each.GetAttr().GetPath(): node for each in written.GetInputs()}
        return self.graphs[path]

    def output(self, node: Any, kind: str, name: str) -> Any:
        """The output of a node within the graph that gives an output of the node that it stands for; None without."""
        graph = self.of(node, kind)
        output = None if graph is None else graph.GetOutput(name)
        return source_within(output) if output else None

    def interface(self, attribute: Any) -> Any:
        """The node whose input an interface's input stands for; None for any other attribute."""
        return self.bound.get(attribute.GetPath())


def source_within(port: Any) -> Any:
    """What an input or output of a graph's stage is connected to, or its own attribute if it has a value, or None."""
    attribute = port.GetAttr()
    paths = port.GetRawConnectedSourcePaths()
    if paths:
        return attribute.GetStage().GetAttributeAtPath(paths[0])
    return attribute if attribute.HasAuthoredValue() else None
