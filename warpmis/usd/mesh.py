"""UsdGeomMesh: polygons, holes, orientation and normals, with what is broken left out and said so."""

from __future__ import annotations

from typing import Any

import numpy as np
from pxr import UsdGeom

from warpmis.usd.geometry import FloatArray, IntArray, Surface, flat_surface
from warpmis.usd.polygons import Polygons, triangulate
from warpmis.usd.reading import Reading
from warpmis.usd.refined_mesh import RefinedMesh, refined_mesh


def read_mesh(prim: Any, reading: Reading) -> Surface | None:
    """The triangles of a UsdGeomMesh in its own space, or None where nothing of it can be rendered.

    Authored normals count for subdivisionScheme "none" alone; "bilinear" is flat, and so is "none" without them. Of
    other schemes the normals are averaged over the refined polygons, or over the cage's where it is not refined.
    """
    mesh = UsdGeom.Mesh(prim)
    authored = _read_polygons(mesh, reading)
    if not authored.usable.any():
        return None
    scheme = str(reading.get(mesh.GetSubdivisionSchemeAttr(), "catmullClark"))
    refined = refined_mesh(mesh, authored, scheme, _holes(mesh, authored, reading), reading)
    polygons = refined.polygons
    corners, polygon = triangulate(polygons)
    left_handed = reading.get(mesh.GetOrientationAttr()) == UsdGeom.Tokens.leftHanded
    normals: tuple[FloatArray, IntArray] | None = None
    if scheme == "none":
        normals = _authored_normals(mesh, refined, reading)
    elif scheme != "bilinear":
        values, rows = refined.smooth_normals()
        normals = -values if left_handed else values, rows
    triangles = polygons.indices[corners]
    if left_handed:
        corners, triangles = corners[:, ::-1], triangles[:, ::-1]
    faces = refined.faces[polygon]
    if normals is None:
        return flat_surface(polygons.points, triangles, faces)
    return Surface(polygons.points, triangles, faces, normals[0], normals[1][corners])


def _read_polygons(mesh: Any, reading: Reading) -> Polygons:
    """Points and faces, with the faces that cannot be rendered marked; one warning for each reason."""
    path = mesh.GetPath()
    points = reading.vectors(mesh.GetPointsAttr())
    indices = reading.indices(mesh.GetFaceVertexIndicesAttr())
    counts = _consistent_counts(reading.indices(mesh.GetFaceVertexCountsAttr()), len(indices), path, reading)
    usable = counts >= 3
    face = np.repeat(np.arange(len(counts)), counts)
    indices = indices[: len(face)]

    def drop(bad_corners: Any, reason: str) -> None:
        bad = np.zeros(len(counts), bool)
        bad[face[bad_corners]] = True
        number = int((bad & usable).sum())
        if number:
            reading.warn(path, f"{number} faces left out: {reason}")
        usable[bad] = False

    outside = np.asarray((indices < 0) | (indices >= len(points)))
    drop(outside, f"their faceVertexIndices lie outside the {len(points)} points")
    if outside.any():
        indices = np.where(outside, 0, indices)
    if len(points):
        drop(~np.isfinite(points[indices]).all(axis=1), "they use points that are not finite")
        points = np.where(np.isfinite(points), points, 0.0)
    return Polygons(points, counts, indices, usable)


def _holes(mesh: Any, polygons: Polygons, reading: Reading) -> IntArray:
    holes = reading.indices(mesh.GetHoleIndicesAttr())
    return holes[(holes >= 0) & (holes < len(polygons.counts))]


def _consistent_counts(counts: IntArray, corners: int, path: object, reading: Reading) -> IntArray:
    """The longest run of faceVertexCounts from the start that is not negative and has all its corners."""
    consistent = np.logical_and.accumulate(counts >= 0) & (np.cumsum(counts) <= corners)
    number = int(np.logical_and.accumulate(consistent).sum()) if len(counts) else 0
    if number < len(counts) or counts.sum() != corners:
        reading.warn(
            path,
            f"faceVertexCounts add up to {counts.sum()} but there are {corners} faceVertexIndices; "
            f"the first {number} faces are used",
        )
    return counts[:number]


def _authored_normals(mesh: Any, refined: RefinedMesh, reading: Reading) -> tuple[FloatArray, IntArray] | None:
    """Authored normals, shape (m, 3), and the row of each of the polygons' corners, shape (c,); None without any.

    primvars:normals goes before `normals`; values of the wrong number are left out with a warning.
    """
    primvar = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("normals")
    indices = np.empty(0, np.int64)
    if primvar and primvar.HasAuthoredValue():
        values, interpolation = reading.vectors(primvar.GetAttr()), str(primvar.GetInterpolation())
        if primvar.IsIndexed():
            indices = reading.indices(primvar.GetIndicesAttr())
    else:
        values, interpolation = reading.vectors(mesh.GetNormalsAttr()), str(mesh.GetNormalsInterpolation())
    if not len(values):
        return None
    expected = {
        "constant": 1,
        "uniform": len(refined.authored.counts),
        "faceVarying": len(refined.authored.indices),
    }.get(interpolation, len(refined.authored.points))
    found = len(indices) or len(values)
    if found != expected:
        reading.warn(mesh.GetPath(), f"{found} {interpolation} normals left out: {expected} are needed")
        return None
    if len(indices) and (indices.min() < 0 or indices.max() >= len(values)):
        reading.warn(mesh.GetPath(), f"normals left out: their indices lie outside the {len(values)} values")
        return None
    return refined.primvar(values, indices, interpolation)
