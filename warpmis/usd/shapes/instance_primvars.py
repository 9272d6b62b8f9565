"""Primvars of PointInstancers: each instance has a value at its root, which what is below inherits.

Reference: UsdGeomPointInstancer, "Primvars on PointInstancer": constant and uniform primvars hold for all instances; of
the others each instance has its own value.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import UsdGeom

from warpmis.usd.color_space import linear_color
from warpmis.usd.reading import Reading

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class InstanceScope:
    """A PointInstancer that a prim is placed by.

    Attributes:
        instancer: its prim.
        root: path of its prototype that the prim is in.
        instance: for each place of the prim the number of its instance, shape (k,).
        count: how many instances the instancer has.
    """

    instancer: Any
    root: Any
    instance: IntArray
    count: int

    def of_places(self, rows: Any) -> InstanceScope:
        """The same for some of the places."""
        return replace(self, instance=self.instance[rows])


# The innermost first, as the prim is seen from.
Scopes = tuple[InstanceScope, ...]


@dataclass(frozen=True, eq=False)
class Source:
    """Where a prim's primvar is authored: by `scope`'s instancer; without a scope, on the prim or above it."""

    primvar: Any
    scope: InstanceScope | None = None


def source_of_primvar(prim: Any, name: str, scopes: Scopes) -> Source | None:
    """The opinion nearest to the prim: its own, one inherited in the prototype, the instancer's, and so on outwards.

    Where none of these is, one that the prototype inherits where it stands, then one that the instancer inherits.
    """
    at = prim
    for scope in scopes:
        found = _nearest(at, prim, scope.root, name)
        if found is not None:
            return Source(found)
        found = UsdGeom.PrimvarsAPI(scope.instancer).GetPrimvar(name)
        if found and found.HasAuthoredValue():
            return Source(found, scope)
        at = scope.instancer.GetParent()
    for one in (prim, *(scope.instancer for scope in scopes[-1:])):
        found = UsdGeom.PrimvarsAPI(one).FindPrimvarWithInheritance(name)
        if found and found.HasValue():
            return Source(found)
    return None


def _nearest(at: Any, prim: Any, root: Any, name: str) -> Any:
    """The primvar of `prim` or of a prim above it, from `at` up to `root`, of which a constant one is inherited."""
    while at and at.GetPath().HasPrefix(root):
        found = UsdGeom.PrimvarsAPI(at).GetPrimvar(name)
        if found and found.HasAuthoredValue() and (at == prim or str(found.GetInterpolation()) == "constant"):
            return found
        at = at.GetParent()
    return None


def instance_values(source: Source, width: int, reading: Reading) -> FloatArray:
    """The value at each place of a primvar that an instancer authors, shape (k, width); (1, width) where it is the same
    for all, and (0, width), with a warning, where its type or number is wrong."""
    assert source.scope is not None
    primvar, scope = source.primvar, source.scope
    path, nothing = primvar.GetAttr().GetPath(), np.empty((0, width))
    raw = np.asarray(reading.value(primvar.GetAttr()))
    if raw.dtype.kind not in "fiu" or raw.size < width or (raw.ndim == 2 and raw.shape[1] != width):
        reading.warn(path, "left out: it is of the wrong type")
        return nothing
    elements = raw.reshape(-1, raw.shape[1]) if raw.ndim == 2 else raw.reshape(-1, width if raw.ndim == 0 else 1)
    interpolation, size = str(primvar.GetInterpolation()), max(int(primvar.GetElementSize()), 1)
    if interpolation in ("constant", "uniform"):
        rows = elements.reshape(1, -1)
        if rows.shape[1] > width:
            reading.warn(path, f"it is {interpolation} but has {len(elements)} values; the first is used")
    else:
        rows = elements[: len(elements) // size * size].reshape(len(elements) // size, -1)
    if rows.shape[1] < width:
        reading.warn(path, "left out: it is of the wrong type")
        return nothing
    values = linear_color(primvar.GetAttr(), rows[:, :width].astype(np.float64), reading)
    indices = reading.indices(primvar.GetIndicesAttr()) if primvar.IsIndexed() else np.arange(len(values))
    if len(indices) and (indices.min() < 0 or indices.max() >= len(values)):
        reading.warn(path, f"left out: its indices lie outside the {len(values)} values")
        return nothing
    if interpolation in ("constant", "uniform"):
        return np.asarray(values[indices[:1]])
    if len(indices) != scope.count:
        reading.warn(path, f"{len(indices)} {interpolation} values are left out: {scope.count} are needed")
        return nothing
    return np.asarray(values[indices[scope.instance]])
