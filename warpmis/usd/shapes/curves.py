"""UsdGeomBasisCurves as triangles: tubes, or ribbons where normals are authored."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pxr import UsdGeom

from warpmis.usd.authored import Authored, read_authored
from warpmis.usd.reading import Reading, consistent_counts
from warpmis.usd.shapes.curve_segments import BASES, Segments, cut
from warpmis.usd.shapes.surfaces import FloatArray, IntArray, Surface, reversed_surface
from warpmis.usd.shapes.thin_widths import thin_widths
from warpmis.usd.shapes.transported_normals import transported_normals, unit
from warpmis.usd.sight import largest_places, sampled

BoolArray = NDArray[np.bool_]

# Pieces of a cubic segment and sides of a tube: for curves too many for more, and by the reading's levels. Normals make
# few sides look round.
COARSEST = (1, 3)
DETAILS = ((2, 4), (4, 6), (8, 8), (12, 12))
# Curves are cut into fewer pieces where they would have more triangles than this.
MAX_TRIANGLES = 1 << 22
# Two segments whose tangents have at least this cosine pass smoothly into each other; others meet in a kink.
SMOOTH_COSINE = 0.97


# What is larger in the picture are too few segments to say how finely all are made.
LARGEST = 0.95


class Strands(NamedTuple):
    """What is authored along curves."""

    widths: Authored
    normals: Authored | None


@dataclass(frozen=True, eq=False)
class Samples:
    """Points along curves, curve after curve.

    Attributes:
        positions, tangents: shape (s, 3); tangents are of length 1, or 0 where a curve stands still.
        widths: shape (s,).
        normals: authored ones, shape (s, 3), or None.
        curve: shape (s,).
        first: the first sample of the same curve, shape (s,).
        following: the sample after, -1 at an open end, shape (s,).
        carrier: brings primvars to the samples.
    """

    positions: FloatArray
    tangents: FloatArray
    widths: FloatArray
    normals: FloatArray | None
    curve: IntArray
    first: IntArray
    following: IntArray
    carrier: CurveElements


@dataclass(frozen=True, eq=False)
class CurveElements:
    """The carrier (surfaces.PrimvarCarrier) of the primvars of curves, whose places are the samples.

    Attributes:
        t: parameters of each segment's samples, shape (p,); kept: which of them count, shape (g, p).
    """

    segments: Segments
    t: FloatArray
    kept: BoolArray

    @property
    def elements(self) -> Mapping[str, int]:
        return self.segments.elements

    def primvar(self, values: FloatArray, indices: IntArray, interpolation: str) -> tuple[FloatArray, IntArray]:
        found = _along(self.segments, Authored(values, indices, interpolation), self.t)[self.kept]
        return found, np.arange(len(found))


def read_curves(prim: Any, matrices: FloatArray, reading: Reading) -> Surface | None:
    """The triangles of a UsdGeomBasisCurves in its own space, its curves being their faces; None without any.

    Args:
        matrices: local to world, shape (k, 4, 4).
    """
    curves = UsdGeom.BasisCurves(prim)
    points = reading.vectors(curves.GetPointsAttr())
    counts = reading.indices(curves.GetCurveVertexCountsAttr())
    names = ("curveVertexCounts", "points", "curves")
    counts = consistent_counts(counts, len(points), names, prim.GetPath(), reading)
    basis = "linear" if reading.get(curves.GetTypeAttr()) == "linear" else str(reading.get(curves.GetBasisAttr()))
    if basis not in BASES:
        reading.warn(prim.GetPath(), f"left out: its basis {basis} is not known")
        return None
    wrap = str(reading.get(curves.GetWrapAttr(), "nonperiodic"))
    points = points[: counts.sum()]
    segments = cut(counts, basis, wrap)
    segments = segments.of_curves(_sound_curves(prim, counts, points, segments, reading))
    if not len(segments.curve):
        return None
    widths = read_authored(prim, "widths", str(curves.GetWidthsInterpolation()), segments.elements, reading)
    normals = read_authored(prim, "normals", str(curves.GetNormalsInterpolation()), segments.elements, reading)
    if widths is None:
        widths = thin_widths(prim, points, matrices, reading)
    pieces, sides = _detail(prim, segments, points, Strands(widths, normals), matrices, reading)
    samples = _sampled(segments, points, widths, normals, pieces)
    surface = _tubes(samples, sides) if samples.normals is None else _ribbons(samples, samples.normals)
    left_handed = reading.get(curves.GetOrientationAttr()) == UsdGeom.Tokens.leftHanded
    return reversed_surface(surface) if left_handed else surface


def _sound_curves(prim: Any, counts: IntArray, points: FloatArray, segments: Segments, reading: Reading) -> BoolArray:
    """Which curves can be rendered, shape (n,), with a warning for each reason why others cannot."""
    curve = np.repeat(np.arange(len(counts)), counts)
    finite = np.ones(len(counts), bool)
    finite[curve[~np.isfinite(points).all(axis=1)]] = False
    whole = (np.bincount(segments.curve, minlength=len(counts)) > 0) | (counts == 0)
    for bad, reason in ((~finite, "they use points that are not finite"),
                        (~whole, "their numbers of vertices do not fit the basis and wrap")):  # fmt: skip
        if bad.any():
            reading.warn(prim.GetPath(), f"{int(bad.sum())} curves left out: {reason}")
    return finite & whole


def _detail(
    prim: Any, segments: Segments, points: FloatArray, authored: Strands, matrices: FloatArray, reading: Reading
) -> tuple[int, int]:
    """Pieces of a segment and sides of a tube (1 for a ribbon), as many as are asked for and can be seen.

    Fewer, with a warning, where there would be too many triangles.
    """
    normals = authored.normals
    straight = segments.basis == "linear" and (normals is None or normals.interpolation in ("constant", "uniform"))
    along, around = _visible_levels(segments, points, authored.widths, matrices, reading)
    asked = min(max(along, around), reading.levels)
    for level in (*range(asked, -1, -1), -1):
        limit = COARSEST if level < 0 else DETAILS[level]
        pieces = 1 if straight else min(limit[0], DETAILS[along][0])
        sides = min(limit[1], DETAILS[around][1]) if normals is None else 1
        if 2 * len(segments.curve) * pieces * sides <= MAX_TRIANGLES:
            break
    if level != asked:
        reading.warn(prim.GetPath(), f"its {len(segments.curve)} segments are rendered in less detail than asked for")
    return pieces, sides


def _visible_levels(
    segments: Segments, points: FloatArray, widths: Authored, matrices: FloatArray, reading: Reading
) -> tuple[int, int]:
    """The levels of DETAILS for pieces and for sides: the reading's, but no level beyond what can be seen.

    Pieces are two pixels long at least and sides one pixel wide, where the curves look largest.
    """
    if reading.sight is None or not reading.levels:
        return reading.levels, reading.levels
    rows = sampled(len(segments.curve))
    some = replace(segments, control=segments.control[rows], curve=segments.curve[rows])
    ends = some.vertex(points, np.array([0.0, 0.5, 1.0]))
    low, high = ends.min(axis=(0, 1)), ends.max(axis=(0, 1))
    width = float(np.abs(np.nan_to_num(widths.values)).max())
    along = around = 0
    for matrix in largest_places(matrices, (low + high) / 2, float(np.linalg.norm(high - low)) / 2, reading.sight):
        world = ends @ matrix[:3, :3] + matrix[3, :3]
        pixels = reading.sight.pixels(world[:, 1])
        scale = float(np.linalg.norm(matrix[:3, :3])) / np.sqrt(3.0)
        lengths = np.linalg.norm(np.diff(world, axis=1), axis=-1).sum(axis=1) * pixels
        for level in range(1, reading.levels + 1):
            pieces, sides = DETAILS[level]
            along = max(along, level if np.quantile(lengths, LARGEST) >= 2.0 * pieces else 0)
            around = max(around, level if np.pi * width * scale * np.quantile(pixels, LARGEST) >= sides else 0)
    return along, around


def _sampled(
    segments: Segments, points: FloatArray, widths: Authored, normals: Authored | None, pieces: int
) -> Samples:
    """Every segment's ends and the points between its pieces, where two that join smoothly share the one between."""
    t = np.linspace(0.0, 1.0, pieces + 1)
    positions = segments.vertex(points, t)
    tangents = _unit_tangents(positions, segments.vertex(points, t, derivative=True))
    before = segments.preceding
    cosine = np.einsum("ij,ij->i", tangents[before, -1], tangents[:, 0])
    joined = (before >= 0) & (cosine >= SMOOTH_COSINE)
    tangents[before[joined], -1] = unit(tangents[before[joined], -1] + tangents[joined, 0])
    kept = np.abs(tangents).max(axis=-1) > 0.0
    kept[joined, 0] = False
    curve = np.repeat(segments.curve, len(t)).reshape(kept.shape)[kept]
    first = np.searchsorted(curve, curve)
    following = np.arange(1, len(curve) + 1)
    last = np.append(curve[1:] != curve[:-1], True)[: len(curve)]
    following[last] = first[last] if segments.periodic else -1
    return Samples(
        positions=positions[kept],
        tangents=tangents[kept],
        widths=_along(segments, widths, t)[kept][:, 0],
        normals=_along(segments, normals, t)[kept] if normals else None,
        curve=curve,
        first=first,
        following=following,
        carrier=CurveElements(segments, t, kept),
    )


def _unit_tangents(positions: FloatArray, derivatives: FloatArray) -> FloatArray:
    """Directions at samples, shape (g, s, 3): of the chords where the derivative vanishes, 0 where these do too."""
    chords = np.diff(positions, axis=1)
    chords = np.concatenate([chords, chords[:, -1:]], axis=1)
    speed = np.linalg.norm(derivatives, axis=-1, keepdims=True)
    return unit(np.where(speed > 1e-6 * speed.max(axis=1, keepdims=True), derivatives, chords))


def _along(segments: Segments, authored: Authored, t: FloatArray) -> FloatArray:
    """Authored values at the parameters `t` of every segment, shape (g, len(t), k)."""
    values, interpolation = authored.flattened, authored.interpolation
    if interpolation == "vertex":
        return segments.vertex(values, t)
    if interpolation in ("constant", "uniform"):
        rows = segments.curve if interpolation == "uniform" else np.zeros_like(segments.curve)
        return np.broadcast_to(values[rows][:, None], (len(rows), len(t), values.shape[1]))
    return segments.varying(values, t)


def _tubes(samples: Samples, sides: int) -> Surface:
    """Open tubes, their fronts outside."""
    normal = transported_normals(samples.tangents, samples.first, samples.following)[:, None]
    binormal = np.cross(samples.tangents, normal[:, 0])[:, None]
    angle = (2.0 * np.pi * np.arange(sides) / sides)[:, None]
    outwards = np.cos(angle) * normal + np.sin(angle) * binormal
    radius = 0.5 * np.where(samples.widths > 0.0, samples.widths, 0.0)[:, None, None]
    points = samples.positions[:, None] + radius * outwards
    side = np.arange(sides)
    strips = np.flatnonzero(samples.following >= 0)
    here, there = strips[:, None] * sides, samples.following[strips][:, None] * sides
    return _strips(samples, strips, here + side, here + (side + 1) % sides, there + side, there + (side + 1) % sides,
                   points.reshape(-1, 3), outwards.reshape(-1, 3))  # fmt: skip


def _ribbons(samples: Samples, normals: FloatArray) -> Surface:
    """Flat bands as wide as the curve, their fronts towards the authored normals."""
    side = unit(np.cross(samples.tangents, normals))
    reach = 0.5 * np.where(samples.widths > 0.0, samples.widths, 0.0)[:, None] * side
    points = np.stack([samples.positions - reach, samples.positions + reach], axis=1).reshape(-1, 3)
    facing = np.repeat(np.cross(side, samples.tangents), 2, axis=0)
    strips = np.flatnonzero(samples.following >= 0)
    here, there = 2 * strips[:, None], 2 * samples.following[strips][:, None]
    return _strips(samples, strips, here, here + 1, there, there + 1, points, facing)


def _strips(
    samples: Samples,
    strips: IntArray,
    a: IntArray,
    b: IntArray,
    c: IntArray,
    d: IntArray,
    points: FloatArray,
    normals: FloatArray,
) -> Surface:
    """Two triangles for each quadrilateral a b d c, shape (strips, sides) each; points and normals share their rows."""
    triangles = np.stack([np.stack([a, b, d], axis=-1), np.stack([a, d, c], axis=-1)], axis=-2)
    triangles = triangles.reshape(-1, 3)
    faces = np.repeat(samples.curve[strips], 2 * a.shape[1])
    sample = triangles // max(1, len(points) // max(1, len(samples.positions)))
    return Surface(points, triangles, faces, normals, triangles, sample, samples.carrier)
