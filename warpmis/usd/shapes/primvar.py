"""Primvars at the corners of triangles, whatever their interpolation."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpmis.usd.color_space import linear_color
from warpmis.usd.reading import Reading
from warpmis.usd.shapes.instance_primvars import Scopes, instance_values, source_of_primvar
from warpmis.usd.shapes.surfaces import FloatArray, IntArray, Surface


@dataclass(frozen=True)
class PrimvarRead:
    """A primvar that a material reads; without a name, or where a prim lacks it, `fallback`.

    Attributes:
        channels: with them, what is read is scale * component + bias of these components; without, all as they are.
    """

    name: str
    fallback: tuple[float, ...]
    channels: tuple[int, ...] = ()
    scale: tuple[float, ...] = ()
    bias: tuple[float, ...] = ()

    @property
    def width(self) -> int:
        """How many components are read."""
        return len(self.channels) or len(self.fallback)

    def of(self, values: FloatArray) -> FloatArray:
        """What is read of the primvar's values, shape (n, components), as shape (n, width)."""
        if not self.channels:
            return values
        return np.asarray(values[:, list(self.channels)] * np.array(self.scale) + np.array(self.bias))


@dataclass(eq=False)
class PrimvarColumns:
    """The primvars that one material reads, side by side as columns of Geometry.primvars."""

    reads: dict[PrimvarRead, int] = field(default_factory=dict)
    width: int = 0

    def column(self, read: PrimvarRead) -> int:
        """The first column of a primvar, which is added where it is not in yet."""
        if read not in self.reads:
            self.reads[read] = self.width
            self.width += read.width
        return self.reads[read]


@dataclass(frozen=True, eq=False)
class Elements:
    """Values of a primvar on one gprim, shape (n, width), without any where there are none that can be used.

    Attributes:
        rows: the row of each triangle corner, shape (f, 3) or (1, 1).
        of_places: whether the rows are the gprim's places instead, as a PointInstancer gives them, shape (k, width).
    """

    values: FloatArray
    rows: IntArray = field(default_factory=lambda: np.zeros((1, 1), np.int64))
    of_places: bool = False


def corner_primvars(
    prim: Any, surface: Surface, columns: PrimvarColumns, scopes: Scopes, reading: Reading
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """All columns of one material on one gprim: at the corners, shape (f, 3, width), and at the places, (k, width).

    In the former a column is NaN that the latter have; in the latter the others are 0.
    """
    block = np.empty((len(surface.faces), 3, columns.width), np.float32)
    places = np.zeros((len(scopes[0].instance) if scopes else 0, columns.width), np.float32)
    for read, column in columns.reads.items():
        own = slice(column, column + read.width)
        values, of_places = corner_values(prim, surface, read, scopes, reading)
        block[..., own] = np.nan if of_places else values
        if of_places:
            places[:, own] = values
    return block, places


def corner_values(
    prim: Any, surface: Surface, read: PrimvarRead, scopes: Scopes, reading: Reading
) -> tuple[NDArray[Any], bool]:
    """A primvar at every triangle corner, shape (f, 3, width) or one that broadcasts to it, or, where it is told so, at
    every place, shape (k, width).

    What is missing or broken is the fallback, with a warning; a value that is not finite silently so.
    """
    fallback = np.array(read.fallback)
    if not read.name:
        return read.of(fallback[None])[0], False
    found = primvar_elements(prim, surface, read.name, len(read.fallback), scopes, reading)
    if not len(found.values):
        shown = ", ".join(f"{number:g}" for number in read.fallback)
        reading.warn(prim.GetPath(), f"its material reads primvars:{read.name}, which it lacks; {shown} is used")
        return read.of(fallback[None])[0], False
    finite = np.abs(found.values) < np.finfo(np.float32).max
    values = read.of(np.where(finite, found.values, fallback)).astype(np.float32)
    return (values, True) if found.of_places else (values[found.rows], False)


def primvar_elements(prim: Any, surface: Surface, name: str, width: int, scopes: Scopes, reading: Reading) -> Elements:
    """The primvar's values. Constant primvars are inherited, and instances have those of their instancers.

    Values of the wrong type or number are left out with a warning.
    """
    nothing = Elements(np.empty((0, width)))
    source = source_of_primvar(prim, name, scopes)
    if source is None:
        return nothing
    if source.scope is not None:
        values = instance_values(source, width, reading)
        return Elements(values, of_places=len(values) > 1)
    primvar = source.primvar
    values = np.asarray(reading.value(primvar.GetAttr()))
    if values.dtype.kind not in "fiu" or values.size % width or (values.ndim == 2 and values.shape[1] != width):
        reading.warn(primvar.GetAttr().GetPath(), "left out: it is of the wrong type")
        return nothing
    values = linear_color(primvar.GetAttr(), values.astype(np.float64).reshape(-1, width), reading)
    indices = reading.indices(primvar.GetIndicesAttr()) if primvar.IsIndexed() else np.arange(len(values))
    if len(indices) and (indices.min() < 0 or indices.max() >= len(values)):
        message = f"primvars:{name} is left out: its indices lie outside the {len(values)} values"
        reading.warn(prim.GetPath(), message)
        return nothing
    return Elements(*_at_corners(prim, surface, name, values[indices], str(primvar.GetInterpolation()), reading))


def _at_corners(
    prim: Any, surface: Surface, name: str, values: FloatArray, interpolation: str, reading: Reading
) -> tuple[FloatArray, IntArray]:
    """Values of a primvar without indices, and the row of each corner. A single value holds for the whole prim."""
    constant = np.zeros((1, 1), np.int64)
    if len(values) <= 1:
        return values, constant
    if interpolation == "constant":
        reading.warn(prim.GetPath(), f"primvars:{name} is constant but has {len(values)} values; the first is used")
        return values[:1], constant
    if surface.carrier is None:
        reading.warn(prim.GetPath(), f"{name} varies over a {prim.GetTypeName()}; its mean is used")
        return values.mean(axis=0, keepdims=True), constant
    elements = surface.carrier.elements
    interpolation = interpolation if interpolation in elements else "vertex"
    expected = elements[interpolation]
    if len(values) != expected:
        message = f"{len(values)} {interpolation} values of primvars:{name} are left out: {expected} are needed"
        reading.warn(prim.GetPath(), message)
        return values[:0], constant
    values, rows = surface.carrier.primvar(values, np.empty(0, np.int64), interpolation)
    return values, rows[surface.corners]
