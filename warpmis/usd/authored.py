"""`normals` and `widths`, which are primvars in all but name, and the primvars of those names, which go before them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from pxr import UsdGeom

from warpmis.usd.reading import Reading
from warpmis.usd.shapes.surfaces import FloatArray, IntArray


class Authored(NamedTuple):
    """Values, shape (n, k), their indices, shape (i,) or (0,) where there are none, and their interpolation."""

    values: FloatArray
    indices: IntArray
    interpolation: str

    @property
    def flattened(self) -> FloatArray:
        """One value for each element of the interpolation, shape (i or n, k)."""
        return self.values[self.indices] if len(self.indices) else self.values


def read_authored(
    prim: Any, name: str, interpolation: str, elements: Mapping[str, int], reading: Reading
) -> Authored | None:
    """The values of primvars:`name`, or of the attribute `name`; None where there are none that can be used.

    A single value holds for the whole prim. Values of a wrong number are left out with a warning.

    Args:
        interpolation: of the attribute.
        elements: how many values each interpolation needs.
    """
    attribute = prim.GetAttribute(name)
    primvar = UsdGeom.PrimvarsAPI(prim).GetPrimvar(name)
    indices = np.empty(0, np.int64)
    if primvar and primvar.HasAuthoredValue():
        attribute, interpolation = primvar.GetAttr(), str(primvar.GetInterpolation())
        if primvar.IsIndexed():
            indices = reading.indices(primvar.GetIndicesAttr())
    values = reading.vectors(attribute) if name == "normals" else reading.numbers(attribute)[:, None]
    if not len(values):
        return None
    found = len(indices) or len(values)
    interpolation = "constant" if found == 1 or interpolation not in elements else interpolation
    if found != elements[interpolation]:
        needed = elements[interpolation]
        reading.warn(prim.GetPath(), f"{found} {interpolation} {name} left out: {needed} are needed")
        return None
    if len(indices) and (indices.min() < 0 or indices.max() >= len(values)):
        reading.warn(prim.GetPath(), f"{name} left out: their indices lie outside the {len(values)} values")
        return None
    return Authored(values, indices, interpolation)
