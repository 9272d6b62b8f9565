"""UsdGeomBasisCurves cut into segments, and values along them: cubic or linear, from the curves' vertices.

Reference: the schema's tables of segment counts, of varying data and of phantom points.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from warpmis.usd.shapes.surfaces import FloatArray, IntArray

# Coefficients of 1, t, t^2, t^3 (rows) of each control vertex's weight (columns), and how far apart segments begin.
BASES = {
    "linear": (np.array([[1.0, 0.0], [-1.0, 1.0]]), 1),
    "bezier": (np.array([[1.0, 0, 0, 0], [-3, 3, 0, 0], [3, -6, 3, 0], [-1, 3, -3, 1]]), 3),
    "bspline": (np.array([[1.0, 4, 1, 0], [-3, 0, 3, 0], [3, -6, 3, 0], [-1, 3, -3, 1]]) / 6.0, 1),
    "catmullRom": (np.array([[0.0, 2, 0, 0], [-1, 0, 1, 0], [2, -5, 4, -1], [-1, 3, -3, 1]]) / 2.0, 1),
}


@dataclass(frozen=True, eq=False)
class Segments:
    """All segments of a batch of curves, curve after curve.

    Attributes:
        basis: a key of BASES.
        control: control vertices of each segment, as rows of `extended` values, shape (g, 2) or (g, 4).
        curve: the curve of each segment, ascending, shape (g,).
        local: the segment's number in its curve, shape (g,).
        varying_rows: rows of varying data at the begin and the end of each segment, shape (g, 2).
        vertices, mirrors: rows of the vertices, phantom ones among them: one is 2 P[vertex] - P[mirror], where any
            other one has itself for both; shape (v,).
        elements: how many values each interpolation needs.
        periodic: whether the last segment of a curve is followed by its first.
    """

    basis: str
    control: IntArray
    curve: IntArray
    local: IntArray
    varying_rows: IntArray
    vertices: IntArray
    mirrors: IntArray
    elements: dict[str, int]
    periodic: bool

    def of_curves(self, kept: NDArray[np.bool_]) -> Segments:
        """The segments of some of the curves."""
        rows = kept[self.curve]
        columns = {name: getattr(self, name)[rows] for name in ("control", "curve", "local", "varying_rows")}
        return replace(self, **columns)

    @property
    def preceding(self) -> IntArray:
        """The segment before of the same curve, -1 where there is none, shape (g,)."""
        before = np.arange(-1, len(self.curve) - 1)
        last = np.searchsorted(self.curve, self.curve, side="right") - 1
        return np.where(self.local > 0, before, last if self.periodic else -1)

    def vertex(self, values: FloatArray, t: FloatArray, derivative: bool = False) -> FloatArray:
        """Values of the vertices, shape (n, k), at the parameters `t` of every segment, shape (g, len(t), k)."""
        matrix = BASES[self.basis][0]
        power = np.arange(len(matrix))
        powers = power * t[:, None] ** np.maximum(power - 1, 0) if derivative else t[:, None] ** power
        extended = 2.0 * values[self.vertices] - values[self.mirrors]
        return np.einsum("tc,gck->gtk", powers @ matrix, extended[self.control])

    def varying(self, values: FloatArray, t: FloatArray) -> FloatArray:
        """Varying values, shape (n, k), at the parameters `t` of every segment, shape (g, len(t), k)."""
        begin, end = (values[rows][:, None] for rows in self.varying_rows.T)
        return begin + (end - begin) * t[:, None]


def segment_counts(counts: IntArray, basis: str, wrap: str) -> IntArray:
    """Segments of curves with these numbers of vertices, 0 where the number does not fit, shape (n,)."""
    step = BASES[basis][1]
    if basis == "linear":
        return np.where(counts >= 3, counts, 0) if wrap == "periodic" else np.maximum(counts - 1, 0)
    if wrap == "periodic":
        return np.where((counts >= 3) & (counts % step == 0), counts // step, 0)
    if wrap == "pinned" and basis != "bezier":
        return np.maximum(counts - 1, 0)
    return np.where((counts >= 4) & ((counts - 4) % step == 0), (counts - 4) // step + 1, 0)


def cut(counts: IntArray, basis: str, wrap: str) -> Segments:
    """The segments of curves with these numbers of vertices; those without a segment have none here."""
    number = segment_counts(counts, basis, wrap)
    step = BASES[basis][1]
    pinned = wrap == "pinned" and basis in ("bspline", "catmullRom")
    periodic = wrap == "periodic"
    curve = np.repeat(np.arange(len(counts)), number)
    local = _counted(number)
    vertices, mirrors, sizes = _with_phantoms(counts) if pinned else (np.arange(counts.sum()),) * 2 + (counts,)
    first = np.cumsum(sizes) - sizes
    control = local[:, None] * step + np.arange(2 if basis == "linear" else 4)
    if periodic:
        control %= sizes[curve, None]
    ends = number if periodic else np.where(number > 0, number + 1, 0)
    varying = np.stack([local, (local + 1) % np.maximum(ends[curve], 1)], axis=-1)
    return Segments(
        basis=basis,
        control=control + first[curve, None],
        curve=curve,
        local=local,
        varying_rows=varying + (np.cumsum(ends) - ends)[curve, None],
        vertices=vertices,
        mirrors=mirrors,
        elements={"constant": 1, "uniform": len(counts), "vertex": int(counts.sum())}
        | dict.fromkeys(("varying", "faceVarying"), int(ends.sum())),
        periodic=periodic,
    )


def _counted(number: IntArray) -> IntArray:
    """0, 1, ... number[i] - 1 for each i in turn."""
    return np.arange(number.sum()) - np.repeat(np.cumsum(number) - number, number)


def _with_phantoms(counts: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Vertices and mirrors of curves with a phantom vertex at both ends, and their new counts."""
    sizes = np.where(counts >= 2, counts + 2, 0)
    first = np.repeat(np.cumsum(counts) - counts, sizes)
    last = np.repeat(counts, sizes) - 1
    place = _counted(sizes) - 1
    mirror = np.where(place < 0, 1, np.where(place > last, last - 1, place))
    return first + np.clip(place, 0, last), first + mirror, sizes
