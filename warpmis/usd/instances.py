"""What stands where: the stage's hierarchy with its transforms, visibility, purposes and instances."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from warpmis.usd.reading import PxrError, Reading, one_line
from warpmis.usd.shapes.instance_primvars import InstanceScope, Scopes
from warpmis.usd.visibility import Shown, shown_below

FloatArray = NDArray[np.float64]

# Prototypes may stand under an `over` or a `class`, so that they are not rendered on their own.
SCENE_PRIMS = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)
PROTOTYPE_PRIMS = Usd.TraverseInstanceProxies(Usd.PrimIsActive & Usd.PrimIsLoaded & Usd.PrimHasDefiningSpecifier)

# What pxr makes an instance's transform and mask of.
INSTANCE_ATTRIBUTES = (
    *("ids", "invisibleIds", "positions", "orientations", "orientationsf", "scales"),
    *("velocities", "accelerations", "angularVelocities"),
)


@dataclass(frozen=True, eq=False)
class Placement:
    """A prim to be rendered, and where: once for each matrix.

    Attributes:
        matrices: local to world, USD's row-vector convention, shape (k, 4, 4); k > 1 under a PointInstancer.
        scopes: the PointInstancers that it stands there by, the innermost first.
    """

    prim: Any
    matrices: FloatArray
    scopes: Scopes = ()


@dataclass(frozen=True, eq=False)
class _Visit:
    """A prim that is still to be visited: the matrices are its parent's."""

    prim: Any
    matrices: FloatArray
    above: Shown
    predicate: Any
    scopes: Scopes


def placements(reading: Reading) -> Iterator[Placement]:
    """Every prim that is active, defined, visible and of a wanted purpose, in the stage's order.

    Native instances appear as instance proxies. A PointInstancer appears as its prototypes' prims, with one matrix for
    each instance (of nested instancers: for each combination); the prims below it are not rendered by themselves.
    A prim whose transform is not finite is left out with everything below it.
    """
    transforms = UsdGeom.XformCache(reading.time)
    root = reading.stage.GetPseudoRoot()
    top = root.GetFilteredChildren(SCENE_PRIMS)
    pending = [_Visit(prim, np.eye(4)[None], Shown(), SCENE_PRIMS, ()) for prim in top][::-1]
    while pending:
        visit = pending.pop()
        try:
            found, children = _visited(visit, transforms, reading)
        except PxrError as error:
            reading.warn(visit.prim.GetPath(), f"left out: {one_line(error)}")
            continue
        pending += reversed(children)
        if found is not None:
            yield found


def _visited(visit: _Visit, transforms: Any, reading: Reading) -> tuple[Placement | None, list[_Visit]]:
    """The prim's placement, if it is to be rendered, and the visits that follow from it."""
    prim = visit.prim
    shown = shown_below(prim, visit.above, reading)
    if shown is None:
        return None, []
    matrices = _world_matrices(prim, visit.matrices, transforms, reading)
    if not np.isfinite(matrices).all():
        reading.warn(prim.GetPath(), "left out with everything below it: its transform is not finite")
        return None, []
    if prim.IsA(UsdGeom.PointInstancer):
        return None, _instancer_visits(visit, shown, matrices, reading)
    children = [
        _Visit(child, matrices, shown, visit.predicate, visit.scopes)
        for child in prim.GetFilteredChildren(visit.predicate)
    ]
    return (Placement(prim, matrices, visit.scopes) if shown.is_rendered(reading) else None), children


def _world_matrices(prim: Any, parent: FloatArray, transforms: Any, reading: Reading) -> FloatArray:
    """Local to world for each of the parent's matrices, shape (k, 4, 4)."""
    if not prim.IsA(UsdGeom.Xformable):
        return parent
    local, resets = transforms.GetLocalTransformation(prim)
    matrix = np.array(local)
    if np.array_equal(matrix, np.eye(4)):
        reading.get(UsdGeom.Xformable(prim).GetXformOpOrderAttr())  # pxr leaves out silently what is no list of tokens
    if resets:
        return np.broadcast_to(matrix, parent.shape)
    return matrix @ parent


def _instancer_visits(visit: _Visit, shown: Shown, matrices: FloatArray, reading: Reading) -> list[_Visit]:
    """One visit for each prototype that has instances, with the instances' matrices as its parent's."""
    path = visit.prim.GetPath()
    if path in [scope.instancer.GetPath() for scope in visit.scopes]:
        reading.warn(path, "left out: it is one of its own prototypes")
        return []
    instancer = UsdGeom.PointInstancer(visit.prim)
    prototypes = reading.targets(instancer.GetPrototypesRel(), "its instances are left out")
    which, instances, numbers = _instances(instancer, len(prototypes), reading)
    count = len(reading.indices(instancer.GetProtoIndicesAttr()))
    visits = []
    for number in np.unique(which):
        prototype = reading.stage.GetPrimAtPath(prototypes[number])
        if not prototype:
            continue
        if not prototype.IsActive():
            reading.warn(path, f"its prototype {prototypes[number]} is not active; its instances are left out")
            continue
        own = instances[which == number]
        world = (own[None] @ matrices[:, None]).reshape(-1, 4, 4)
        instance = np.tile(numbers[which == number], len(matrices))
        outer = np.repeat(np.arange(len(matrices)), len(own))
        scope = InstanceScope(visit.prim, prototype.GetPath(), instance, count)
        scopes = (scope, *(one.of_places(outer) for one in visit.scopes))
        visits.append(_Visit(prototype, world, shown, PROTOTYPE_PRIMS, scopes))
    return visits


def _instances(
    instancer: Any, prototypes: int, reading: Reading
) -> tuple[NDArray[np.int64], FloatArray, NDArray[np.int64]]:
    """Of the instances to be rendered: prototype index, shape (k,), transform, shape (k, 4, 4), and number, shape (k,).

    invisibleIds and inactiveIds are left out; so are instances without a prototype or with a transform that is not
    finite, with a warning.
    """
    path = instancer.GetPath()
    which = reading.indices(instancer.GetProtoIndicesAttr())
    for name in INSTANCE_ATTRIBUTES:  # pxr leaves out silently what is of the wrong type
        reading.get(instancer.GetPrim().GetAttribute(name))
    if not len(which):
        return which, np.empty((0, 4, 4)), which
    computed = instancer.ComputeInstanceTransformsAtTime(
        reading.time,
        reading.time,
        UsdGeom.PointInstancer.ExcludeProtoXform,
        UsdGeom.PointInstancer.IgnoreMask,
    )
    matrices = np.asarray(computed, np.float64).reshape(-1, 4, 4)
    if len(matrices) != len(which):
        reading.warn(path, f"left out: {len(which)} protoIndices, but {len(matrices)} transforms could be computed")
        return which[:0], np.empty((0, 4, 4)), which[:0]
    mask = np.array(instancer.ComputeMaskAtTime(reading.time), bool)
    shown = mask if len(mask) == len(which) else np.ones(len(which), bool)
    known = (which >= 0) & (which < prototypes)
    finite = np.isfinite(matrices).all(axis=(1, 2))
    for bad, reason in ((~known, f"their protoIndices lie outside the {prototypes} prototypes"),
                        (known & ~finite, "their transforms are not finite")):  # fmt: skip
        if (bad & shown).any():
            reading.warn(path, f"{int((bad & shown).sum())} instances left out: {reason}")
    keep = shown & known & finite
    return which[keep], matrices[keep], np.flatnonzero(keep)
