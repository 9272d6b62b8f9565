"""A MaterialX file as a layer of UsdShade materials, as USD's own plugin for such files lays them out.

/MaterialX/Materials holds a Material for each of the file's, with its nodes and node graphs below it. Nodes that the
file defines itself, and nodes of the standard library that nobody here knows, become the graphs that implement them.
Reference: Smythe, Stone et al. (2024), "MaterialX Specification" 1.39; OpenUSD's usdMtlx.
"""

from __future__ import annotations

import os
from typing import Any

from pxr import Sdf, Usd

from warpmis.usd.materials.bsdf_nodes import is_bsdf_node
from warpmis.usd.materials.image import PictureError, asset_bytes
from warpmis.usd.materials.materialx import is_materialx
from warpmis.usd.materials.materialx_network import is_pattern_node
from warpmis.usd.materials.mtlx_writer import MATERIALS, ROOT, DocumentWriter, standard_library

INSTALL = 'it needs MaterialX: pip install "warpmis[materialx]"'
# Nodes that graphs replace; a file with more contains itself.
MAX_FLATTENED = 4000


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
        document.setDataLibrary(standard_library())
        flattening = Flattening()
        for graph in [document, *(graph for graph in own if not graph.getNodeDefString())]:
            graph.flattenSubgraphs(filter=flattening)
        if flattening.count > MAX_FLATTENED:
            raise MtlxError(f"more than {MAX_FLATTENED} nodes stand for graphs, or one for itself")
    except (*failures, PictureError, UnicodeDecodeError) as error:
        raise MtlxError(" ".join(str(error).split())) from None
    return document


class Flattening:
    """Says of each node whether it is replaced by a graph: where it can be and must be, and up to so many."""

    def __init__(self) -> None:
        self.count = 0

    def __call__(self, node: Any) -> bool:
        definition = node.getNodeDef()
        kind = definition.getName() if definition else ""
        if not kind or is_materialx(kind) or is_pattern_node(kind) or is_bsdf_node(kind):
            return False
        self.count += 1
        return self.count <= MAX_FLATTENED
