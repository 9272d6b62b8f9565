"""Opening a stage as the caller wants it, without a change to any layer of theirs.

What is chosen or computed goes into a session layer of our own, which is stronger than all others.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pxr import Sdf, Usd

from warpmis.errors import StageError
from warpmis.usd.materials.mtlx_document import MtlxError, mtlx_layer
from warpmis.usd.mtlx_arcs import MtlxArcs, is_mtlx
from warpmis.usd.reading import PxrError, one_line


def open_stage(
    path_or_stage: Any, variants: Sequence[str], mask: Sequence[str], session_layer: str | os.PathLike[str] | None
) -> Any:
    """A stage whose session layer may be edited: of a file, or of the same layers as the caller's stage.

    Args:
        variants: selections to make, such as "/World/Car{paint=red}", in order.
        mask: paths of the prims to load, with what is above and below them and what they refer to; none for all.
        session_layer: file of a layer that is stronger than the stage's.

    Raises:
        StageError: the file cannot be opened, or there is no such prim, variant set or variant.
    """
    if isinstance(path_or_stage, Usd.Stage):
        stage = _same_layers(path_or_stage, session_layer, mask)
    else:
        root = _root_layer(path_or_stage)
        above = [] if session_layer is None else [_layer(os.fspath(session_layer))]
        stage = _opened(root, _session_above(above), _population(mask))
    stage.SetEditTarget(stage.GetSessionLayer())
    for path in mask:
        if not stage.GetPrimAtPath(path):
            raise StageError("there is no such prim to mask", path)
    for selection in variants:
        _select(stage, selection)
    if mask:
        stage.ExpandPopulationMask()
    return stage


def with_mtlx(stage: Any) -> tuple[Any, dict[str, str]]:
    """The stage with translations in the place of MaterialX files that it could not open: itself, or one of our own
    whose session layer may be edited; and why files cannot be read, by their identifier."""
    arcs, own = MtlxArcs(), stage.GetSessionLayer()
    root, session = arcs.above(stage.GetRootLayer()), arcs.above(own) if own else None
    if root is None and session is None:
        return stage, arcs.reasons
    found = _opened(
        root or stage.GetRootLayer(),
        session or _session_above([own] if own else []),
        stage.GetPopulationMask(),
        stage.GetPathResolverContext(),
        stage.GetLoadRules(),
    )
    found.MuteAndUnmuteLayers(stage.GetMutedLayers(), [])
    found.SetEditTarget(found.GetSessionLayer())
    return found, arcs.reasons


def _same_layers(stage: Any, session_layer: str | os.PathLike[str] | None, mask: Sequence[str]) -> Any:
    """A stage of our own that composes as the caller's does, but for the session layer and the mask."""
    above = [] if session_layer is None else [_layer(os.fspath(session_layer))]
    own = stage.GetSessionLayer()
    session = _session_above([*above, own] if own else above)
    population = _population(mask) if mask else stage.GetPopulationMask()
    copy = _opened(stage.GetRootLayer(), session, population, stage.GetPathResolverContext(), stage.GetLoadRules())
    copy.MuteAndUnmuteLayers(stage.GetMutedLayers(), [])
    return copy


def _opened(root: Any, session: Any, population: Any, context: Any = None, load_rules: Any = None) -> Any:
    """The composed stage, with everything loaded unless there are rules."""
    try:
        where = (root, session) if context is None else (root, session, context)
        load = Usd.Stage.LoadAll if load_rules is None else Usd.Stage.LoadNone
        stage = Usd.Stage.OpenMasked(*where, population, load)
    except PxrError as error:
        raise StageError(f"the stage cannot be opened: {one_line(error)}", root.GetDisplayName()) from None
    if load_rules is not None:
        stage.SetLoadRules(load_rules)
    return stage


def _root_layer(path: str) -> Any:
    if is_mtlx(path) and os.path.exists(path):
        raise StageError("it holds materials alone: open a stage that refers to it", Path(path).name)
    try:
        layer = Sdf.Layer.FindOrOpen(path)
    except PxrError as error:
        raise StageError(f"the stage cannot be opened: {one_line(error)}", Path(path).name or path) from None
    if layer:
        return layer
    if not os.path.exists(path) and not Sdf.Layer.IsAnonymousLayerIdentifier(path):
        raise StageError("there is no such file", path)
    raise StageError("the stage cannot be opened", Path(path).name)


def _layer(path: str) -> Any:
    try:
        layer = mtlx_layer(path) if is_mtlx(path) and os.path.exists(path) else Sdf.Layer.FindOrOpen(path)
    except MtlxError as error:
        raise StageError(f"the session layer cannot be opened: {error}", Path(path).name) from None
    except PxrError as error:
        raise StageError(f"the session layer cannot be opened: {one_line(error)}", Path(path).name or path) from None
    if not layer:
        raise StageError("the session layer cannot be opened", path)
    return layer


def _session_above(layers: list[Any]) -> Any:
    """An empty session layer over `layers`, the strongest first, with their metadata: sublayers do not pass it on."""
    session = Sdf.Layer.CreateAnonymous("session.usda")
    session.subLayerPaths = [layer.identifier for layer in layers]
    for layer in reversed(layers):
        for key in set(layer.pseudoRoot.ListInfoKeys()) - {"subLayers", "subLayerOffsets"}:
            session.pseudoRoot.SetInfo(key, layer.pseudoRoot.GetInfo(key))
    return session


def _population(mask: Sequence[str]) -> Any:
    population = Usd.StagePopulationMask()
    for path in mask:
        if not Sdf.Path.IsValidPathString(path) or not (
            Sdf.Path(path).IsAbsolutePath() and Sdf.Path(path).IsAbsoluteRootOrPrimPath()
        ):
            raise StageError("a mask needs absolute prim paths", path)
        population.Add(path)
    return population if mask else Usd.StagePopulationMask.All()


def _select(stage: Any, selection: str) -> None:
    """Selects the variants of a path such as /Prim{set=variant}, or of several sets in turn."""
    valid = Sdf.Path.IsValidPathString(selection)
    path = Sdf.Path(selection) if valid else Sdf.Path.emptyPath
    choices = []
    while path.IsPrimVariantSelectionPath():
        choices.append(path.GetVariantSelection())
        path = path.GetParentPath()
    if not choices or not path.IsAbsolutePath() or path.ContainsPrimVariantSelection():
        raise StageError("a variant is selected as /Prim{set=variant}", selection)
    prim = stage.GetPrimAtPath(path)
    if not prim:
        raise StageError("there is no such prim to select a variant of", str(path))
    if prim.IsInstanceProxy():
        raise StageError("its variants cannot be selected: it is part of an instance", str(path))
    for set_name, variant in reversed(choices):
        sets = prim.GetVariantSets()
        if set_name not in sets.GetNames():
            known = ", ".join(sets.GetNames()) or "none"
            raise StageError(f"there is no variant set {set_name}; its variant sets: {known}", str(path))
        names = sets.GetVariantSet(set_name).GetVariantNames()
        if variant not in names:
            known = ", ".join(names) or "none"
            raise StageError(f"variant set {set_name} has no variant '{variant}'; it has: {known}", str(path))
        sets.GetVariantSet(set_name).SetVariantSelection(variant)
