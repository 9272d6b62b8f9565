"""Which faces of a mesh have a material of their own: its GeomSubsets of the family materialBind."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import UsdGeom, UsdShade

from warpmis.usd.reading import Reading

FAMILY = UsdShade.Tokens.materialBind


def material_subsets(prim: Any, reading: Reading) -> Iterator[tuple[Any, NDArray[np.int64]]]:
    """The prims of a mesh's subsets of faces, in the order of the stage, and their indices.

    A warning for each subset whose binding does not count: it is of another family, or not of faces.
    """
    for subset in UsdGeom.Subset.GetAllGeomSubsets(UsdGeom.Imageable(prim)):
        if _counts(subset, prim, reading):
            yield subset.GetPrim(), reading.indices(subset.GetIndicesAttr())


def _counts(subset: Any, prim: Any, reading: Reading) -> bool:
    path = subset.GetPath()
    family = str(reading.get(subset.GetFamilyNameAttr(), ""))
    if family != FAMILY:
        if UsdShade.MaterialBindingAPI(subset.GetPrim()).GetDirectBindingRel().HasAuthoredTargets():
            reading.warn(path, f"its binding is not used: its familyName is '{family}', not {FAMILY}")
        return False
    if not prim.IsA(UsdGeom.Mesh):
        reading.warn(path, f"subsets of a {prim.GetTypeName()} are not supported; its own material is used")
        return False
    element = str(reading.get(subset.GetElementTypeAttr(), "face"))
    if element != "face":
        reading.warn(path, f"left out: materials are bound to faces, not to elements of type {element}")
        return False
    return True


def claim(by_face: NDArray[np.int64], indices: NDArray[np.int64], number: int, path: object, reading: Reading) -> None:
    """Gives a subset's faces its number, also those of an earlier subset; by_face is shape (faces,), -1 for none.

    The schema forbids what lies outside and what two subsets have in common; both are warnings.
    """
    inside = indices[(indices >= 0) & (indices < len(by_face))]
    if len(inside) < len(indices):
        outside = len(indices) - len(inside)
        reading.warn(path, f"{outside} of its indices left out: they lie outside the {len(by_face)} faces")
    shared = int((by_face[np.unique(inside)] >= 0).sum())
    if shared:
        reading.warn(path, f"{shared} of its faces are in an earlier subset, too; the material of this one is used")
    by_face[inside] = number
