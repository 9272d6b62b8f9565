"""References to MaterialX files, which usd-core cannot open: the stage composed again with the file's materials there.

No layer is changed. A stack of layers with such a reference gets an anonymous layer above it that deletes the reference
and adds one to the translated file. What refers to that stack is led to the new layer in the same way.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pxr import Ar, Sdf

from warpmis.usd.materials.mtlx_document import MtlxError, mtlx_layer
from warpmis.usd.reading import MTLX_ERROR

SUFFIX = ".mtlx"
ARCS = {"references": Sdf.ReferenceListOp, "payload": Sdf.PayloadListOp}
LISTS = ("explicitItems", "prependedItems", "appendedItems", "addedItems")


def has_mtlx_errors(stage: Any) -> bool:
    """Whether composition failed to open a MaterialX file."""
    return any(MTLX_ERROR.search(str(error)) for error in stage.GetCompositionErrors())


class MtlxArcs:
    """Finds the arcs to MaterialX files in the layers that a stage uses, and makes the layers that replace them.

    Attributes:
        reasons: why files cannot be read, by their identifier.
        replacements: the layer in the place of each file and of each stack, by the identifier of the file or of the
            stack's root; None for one that stays.
    """

    def __init__(self) -> None:
        self.reasons: dict[str, str] = {}
        self.replacements: dict[str, Any] = {}

    def above(self, root: Any) -> Any:
        """The layer to use instead of a stack's root layer, or None where no arc of the stack is to be replaced."""
        if root.identifier not in self.replacements:
            self.replacements[root.identifier] = None  # a circle of references ends here
            overlay = Sdf.Layer.CreateAnonymous(root.GetDisplayName(), Sdf.FileFormat.FindById("usda"))
            sublayers = [self._target(path) for path in _sublayers(root)]
            if self._replace_arcs(root, overlay) or any(sublayers):
                _copy_metadata(root, overlay)
                overlay.subLayerPaths = [root.identifier, *filter(None, sublayers)]
                self.replacements[root.identifier] = overlay
        return self.replacements[root.identifier]

    def _replace_arcs(self, root: Any, overlay: Any) -> bool:
        """Adds to the overlay what leads all arcs of a stack elsewhere that must be; whether there are any."""
        any_replaced = False
        for layer in _stack(root):
            targets = {path: self._target(layer.ComputeAbsolutePath(path)) for path in _files(layer)}
            if not any(targets.values()):
                continue
            any_replaced = True
            for path, key, operation in _arcs(layer):
                _replace_in(overlay, path, key, operation, layer, targets)
        return any_replaced

    def _target(self, identifier: str) -> str:
        """The identifier of the layer in the place of a file; "" for one that stays."""
        if is_mtlx(identifier):
            layer = self._translated(identifier)
        else:
            found = Sdf.Layer.Find(identifier)
            layer = self.above(found) if found else None
        return layer.identifier if layer else ""

    def _translated(self, identifier: str) -> Any:
        if identifier not in self.replacements:
            self.replacements[identifier] = None
            resolved = str(Ar.GetResolver().Resolve(identifier))
            if resolved:
                try:
                    self.replacements[identifier] = mtlx_layer(resolved)
                except MtlxError as error:
                    self.reasons[identifier] = str(error)
            else:
                self.reasons[identifier] = "it does not exist"
        return self.replacements[identifier]


def is_mtlx(identifier: str) -> bool:
    """Whether a path names a MaterialX file, perhaps one within a package."""
    return identifier.rstrip("]").lower().endswith(SUFFIX)


def _files(layer: Any) -> list[str]:
    """The files that a layer's references and payloads name, as authored."""
    return [path for path in layer.GetCompositionAssetDependencies() if path and path not in list(layer.subLayerPaths)]


def _sublayers(root: Any) -> list[str]:
    """The MaterialX files that are sublayers in a stack."""
    found = [layer.ComputeAbsolutePath(path) for layer in _stack(root) for path in layer.subLayerPaths]
    return [path for path in found if is_mtlx(path)]


def _stack(root: Any) -> Iterator[Any]:
    """A layer and its sublayers, each once, as far as they are open."""
    pending, seen = [root], set()
    while pending:
        layer = pending.pop(0)
        if layer.identifier in seen:
            continue
        seen.add(layer.identifier)
        yield layer
        found = (Sdf.Layer.Find(layer.ComputeAbsolutePath(path)) for path in layer.subLayerPaths)
        pending += [each for each in found if each]


def _arcs(layer: Any) -> list[tuple[Any, str, Any]]:
    """Path, kind and list operation of all references and payloads, those within variants included."""
    found: list[tuple[Any, str, Any]] = []

    def visit(path: Any) -> None:
        if path.IsPrimPath() or path.IsPrimVariantSelectionPath():
            spec = layer.GetObjectAtPath(path)
            found.extend((path, key, spec.GetInfo(key)) for key in ARCS if spec.HasInfo(key))

    layer.Traverse(Sdf.Path.absoluteRootPath, visit)
    return found


def _replace_in(overlay: Any, path: Any, key: str, operation: Any, layer: Any, targets: dict[str, str]) -> None:
    """Deletes all items of an operation of which one is replaced, and adds them again in their order."""
    items = {name: list(getattr(operation, name)) for name in LISTS}
    if not any(targets.get(item.assetPath) for each in items.values() for item in each):
        return
    spec = Sdf.CreatePrimInLayer(overlay, path)
    known = spec.GetInfo(key) if spec.HasInfo(key) else ARCS[key]()
    changed = ARCS[key]()
    anchored = [_led_to(item, layer.ComputeAbsolutePath(item.assetPath)) for each in items.values() for item in each]
    changed.deletedItems = [*known.deletedItems, *(item for item in anchored if item not in known.deletedItems)]
    for name, new in (
        ("prependedItems", ("explicitItems", "prependedItems", "addedItems")),
        ("appendedItems", LISTS[2:3]),
    ):
        replaced = [
            _led_to(item, targets.get(item.assetPath) or layer.ComputeAbsolutePath(item.assetPath))
            for each in new
            for item in items[each]
        ]
        setattr(
            changed, name, [*getattr(known, name), *(item for item in replaced if item not in getattr(known, name))]
        )
    spec.SetInfo(key, changed)


def _led_to(item: Any, path: str) -> Any:
    """A reference or payload to another file; one within its own stack stays."""
    if not item.assetPath:
        return item
    if isinstance(item, Sdf.Payload):
        return Sdf.Payload(path, item.primPath, item.layerOffset)
    return Sdf.Reference(path, item.primPath, item.layerOffset, item.customData)


def _copy_metadata(source: Any, target: Any) -> None:
    """A layer's metadata, which sublayers do not pass on."""
    for key in set(source.pseudoRoot.ListInfoKeys()) - {"subLayers", "subLayerOffsets"}:
        target.pseudoRoot.SetInfo(key, source.pseudoRoot.GetInfo(key))
