"""A mesh's polygons as they are rendered, refined if it is a subdivision surface, and the way of its primvars there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from warpmis.usd.reading import Reading
from warpmis.usd.shapes.polygons import Polygons, corner_crosses, corner_neighbours
from warpmis.usd.shapes.subdiv.cage import hides_border, read_cage
from warpmis.usd.shapes.subdiv.masks import BILINEAR, CATMULL_CLARK, CATMULL_CLARK_SMOOTH_TRIANGLES, LOOP, Scheme
from warpmis.usd.shapes.subdiv.refinement import Refinement
from warpmis.usd.shapes.surfaces import FloatArray, IntArray
from warpmis.usd.sight import largest_places, sampled, worthwhile_levels

# A mesh is not refined to more faces than this: a million quadrilaterals once, a quarter of a million twice.
MAX_FACES = 1 << 22


@dataclass(frozen=True, eq=False)
class RefinedMesh:
    """The polygons to render of one mesh.

    Attributes:
        polygons: as authored, or of the refinement, with those marked usable that are shown.
        faces: the authored face that each polygon lies in, shape (m',).
        authored: the polygons as authored.
        refinement: of the authored faces that are sound; None for a mesh that is rendered as authored.
        sound_corners: the authored corner of each of the refinement's cage, shape (c,).
        limit_normals: of a smooth refinement, any length, shape (k, 3), and the row of each corner, shape (c',).
    """

    polygons: Polygons
    faces: IntArray
    authored: Polygons
    refinement: Refinement | None = None
    sound_corners: IntArray | None = None
    limit_normals: tuple[FloatArray, IntArray] | None = None

    @property
    def elements(self) -> Mapping[str, int]:
        """As of a PrimvarCarrier, whose places are the polygons' corners."""
        numbers = {"constant": 1, "uniform": len(self.authored.counts), "faceVarying": len(self.authored.indices)}
        return numbers | dict.fromkeys(("vertex", "varying"), len(self.authored.points))

    def primvar(self, values: FloatArray, indices: IntArray, interpolation: str) -> tuple[FloatArray, IntArray]:
        """As of a PrimvarCarrier, the row of each of the polygons' corners having the shape (c',)."""
        if self.refinement is None or interpolation in ("constant", "uniform"):
            rows = self._elements(interpolation)
            return values, indices[rows] if len(indices) else rows
        if interpolation == "faceVarying":
            rows = indices if len(indices) else equal_rows(values)
            return self.refinement.face_varying(values, rows[self.sound_corners])
        at_points = values[indices] if len(indices) else values
        refined = self.refinement.varying if interpolation == "varying" else self.refinement.points
        return refined(at_points), self.polygons.indices

    def _elements(self, interpolation: str) -> IntArray:
        """The element that each corner has its value from, where values are not refined, shape (c',)."""
        match interpolation:
            case "constant":
                return np.zeros(len(self.polygons.indices), np.int64)
            case "uniform":
                return np.repeat(self.faces, self.polygons.counts)
            case "faceVarying":
                return np.arange(len(self.polygons.indices))
            case _:
                return self.polygons.indices

    def smooth_normals(self) -> tuple[FloatArray, IntArray]:
        """The limit surface's normals or, unrefined, averages over the polygons about a point; rows as `primvar`'s."""
        if self.limit_normals is not None:
            return self.limit_normals
        corner, cross, _ = corner_crosses(self.polygons, np.flatnonzero(self.polygons.usable))
        point, number = self.polygons.indices[corner], len(self.polygons.points)
        sums = [np.bincount(point, cross[:, axis], minlength=number) for axis in range(3)]
        return np.stack(sums, axis=-1), self.polygons.indices


def equal_rows(values: FloatArray) -> IntArray:
    """For every row of `values` the first one that is equal to it, shape (v,)."""
    key = np.zeros(len(values), np.int64)
    for column in values.T:
        distinct, inverse = np.unique(column, return_inverse=True)
        _, key = np.unique(key * len(distinct) + inverse, return_inverse=True)
    first = np.zeros(int(key.max(initial=-1)) + 1, np.int64)
    first[key[::-1]] = np.arange(len(values))[::-1]
    return first[key]


def refined_mesh(
    mesh: Any, polygons: Polygons, scheme_name: str, holes: IntArray, matrices: FloatArray, reading: Reading
) -> RefinedMesh:
    """The mesh refined as often as the reading says and can be seen, or as it is authored.

    Args:
        polygons: those usable that are sound.
        holes: faces that shape the surface but are not shown, in range.
        matrices: local to world, shape (k, 4, 4).
    """
    scheme = _scheme(mesh, polygons, scheme_name, reading)
    shown = polygons.usable.copy()
    shown[holes] = False
    sound = np.flatnonzero(polygons.usable)
    levels = 0 if scheme is None else _levels(mesh, scheme, polygons, matrices, reading)
    corners = np.flatnonzero(np.repeat(polygons.usable, polygons.counts))
    # What interpolateBoundary makes holes is not shown, either, of a mesh that is too small to be refined.
    if scheme is None or (levels == 0 and (reading.levels == 0 or not hides_border(mesh, reading))):
        return RefinedMesh(replace(polygons, usable=shown), np.arange(len(shown)), polygons)
    cage, hidden = read_cage(mesh, polygons.counts[sound], polygons.indices[corners], len(polygons.points), reading)
    if levels == 0:
        shown[sound] &= ~hidden
        return RefinedMesh(replace(polygons, usable=shown), np.arange(len(shown)), polygons)
    linear = str(reading.get(mesh.GetFaceVaryingLinearInterpolationAttr(), "cornersPlus1"))
    refinement = Refinement(cage, scheme, levels, linear)
    normals: tuple[FloatArray, IntArray] | None = None
    if scheme is BILINEAR:  # which is flat
        points = refinement.points(polygons.points)
    else:
        points, normals = refinement.surface(polygons.points)
    finest = refinement.finest
    refined = Polygons(points, finest.counts, finest.indices, (shown[sound] & ~hidden)[refinement.parents])
    return RefinedMesh(refined, sound[refinement.parents], polygons, refinement, corners, normals)


def _scheme(mesh: Any, polygons: Polygons, name: str, reading: Reading) -> Scheme | None:
    """How the mesh is refined; None for one of polygons."""
    if name == "none":
        return None
    if name == "bilinear":
        return BILINEAR
    if name == "loop":
        if (polygons.counts[polygons.usable] != 3).any():
            reading.warn(mesh.GetPath(), "loop subdivision needs triangles; the cage is rendered")
            return None
        return LOOP
    if name != "catmullClark":
        reading.warn(mesh.GetPath(), f"subdivisionScheme {name} is not known; catmullClark is used")
    rule = str(reading.get(mesh.GetTriangleSubdivisionRuleAttr(), "catmullClark"))
    return CATMULL_CLARK_SMOOTH_TRIANGLES if rule == "smooth" else CATMULL_CLARK


def _levels(mesh: Any, scheme: Scheme, polygons: Polygons, matrices: FloatArray, reading: Reading) -> int:
    """How often to refine: the reading's levels, but none whose faces are smaller than a pixel, or too many."""
    counts = polygons.counts[polygons.usable]
    levels = reading.levels
    if reading.sight is not None and levels:
        children = np.full(len(counts), 4) if scheme is LOOP else counts
        levels = _visible_levels(polygons, children, matrices, reading)
    first = 4 * len(counts) if scheme is LOOP else int(counts.sum())
    most = levels
    while levels > 0 and first * 4 ** (levels - 1) > MAX_FACES:
        levels -= 1
    if levels < most:
        times = "once" if levels == 1 else f"{levels} times"
        how = times if levels else "not at all"
        reading.warn(mesh.GetPath(), f"refined {how}, not {most} times: it would have over {MAX_FACES} faces")
    return levels


def _visible_levels(polygons: Polygons, children: IntArray, matrices: FloatArray, reading: Reading) -> int:
    """How many levels give faces no smaller than a pixel where the mesh looks largest.

    Args:
        children: how many faces the first level makes of each usable one.
    """
    faces = np.flatnonzero(polygons.usable)
    rows = sampled(len(faces))
    corner, _, after, row = corner_neighbours(polygons, faces[rows])
    here, there = polygons.points[polygons.indices[corner]], polygons.points[polygons.indices[after]]
    low, high = here.min(axis=0), here.max(axis=0)
    levels = 0
    for matrix in largest_places(matrices, (low + high) / 2, float(np.linalg.norm(high - low)) / 2, reading.sight):
        a, b = (points @ matrix[:3, :3] + matrix[3, :3] for points in (here, there))
        begin = np.flatnonzero(np.diff(row, prepend=-1))
        centers = np.add.reduceat(a, begin) / np.diff(begin, append=len(a))[:, None]
        twice = np.add.reduceat(np.cross(a - centers[row], b - centers[row]), begin)
        area = 0.5 * np.linalg.norm(twice, axis=1) * reading.sight.pixels(centers) ** 2
        levels = max(levels, worthwhile_levels(area / children[rows], reading.levels))
    return levels
