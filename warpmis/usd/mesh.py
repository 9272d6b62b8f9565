"""UsdGeomMesh: polygons, holes, orientation and normals, with what is broken left out and said so."""

from __future__ import annotations

from typing import Any

import numpy as np
from pxr import UsdGeom

from warpmis.usd.geometry import FloatArray, IntArray, Surface, flat_surface
from warpmis.usd.polygons import Polygons, corner_crosses, triangulate
from warpmis.usd.reading import Reading


def read_mesh(prim: Any, reading: Reading) -> Surface | None:
    """The triangles of a UsdGeomMesh in its own space, or None where nothing of it can be rendered.

    A mesh with subdivisionScheme "none" or "bilinear" is a polygonal one: authored normals count for "none" alone,
    and without them it is flat. A subdivision cage is rendered as its polygons with vertex normals averaged from the
    corners' cross products.
    """
    mesh = UsdGeom.Mesh(prim)
    polygons = _read_polygons(mesh, reading)
    if not polygons.usable.any():
        return None
    corners, faces = triangulate(polygons)
    left_handed = reading.get(mesh.GetOrientationAttr()) == UsdGeom.Tokens.leftHanded
    scheme = str(reading.get(mesh.GetSubdivisionSchemeAttr(), "catmullClark"))
    normals: tuple[FloatArray, IntArray] | None = None
    if scheme == "none":
        normals = _authored_normals(mesh, polygons, corners, faces, reading)
    elif scheme != "bilinear":
        reading.warn(prim.GetPath(), f"{scheme} subdivision is not refined yet; rendered as the cage's polygons")
        normals = _vertex_normals(polygons, left_handed), polygons.indices[corners]
    triangles = polygons.indices[corners]
    if left_handed:
        triangles, corners = triangles[:, ::-1], corners[:, ::-1]
        normals = normals and (normals[0], normals[1][:, ::-1])
    if normals is None:
        return flat_surface(polygons.points, triangles, faces, corners)
    return Surface(polygons.points, triangles, faces, *normals, corners)


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
    holes = reading.indices(mesh.GetHoleIndicesAttr())
    usable[holes[(holes >= 0) & (holes < len(counts))]] = False
    return Polygons(points, counts, indices, usable)


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


def _vertex_normals(polygons: Polygons, left_handed: bool) -> FloatArray:
    """Sum over the corners at each point of (next - p) x (previous - p), shape (n, 3), not normalised."""
    corner, cross, _ = corner_crosses(polygons, np.flatnonzero(polygons.usable))
    point = polygons.indices[corner]
    sums = [np.bincount(point, cross[:, axis], minlength=len(polygons.points)) for axis in range(3)]
    return np.stack(sums, axis=-1).astype(np.float64) * (-1.0 if left_handed else 1.0)


def _authored_normals(
    mesh: Any, polygons: Polygons, corners: IntArray, faces: IntArray, reading: Reading
) -> tuple[FloatArray, IntArray] | None:
    """Authored normals, shape (m, 3), and their row for each triangle corner, shape (f, 3); None without any.

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
    element = {
        "constant": np.zeros_like(corners),
        "uniform": np.broadcast_to(faces[:, None], corners.shape),
        "faceVarying": corners,
    }.get(interpolation, polygons.indices[corners])
    expected = {
        "constant": 1,
        "uniform": len(polygons.counts),
        "faceVarying": len(polygons.indices),
    }.get(interpolation, len(polygons.points))
    found = len(indices) or len(values)
    if found != expected:
        reading.warn(mesh.GetPath(), f"{found} {interpolation} normals left out: {expected} are needed")
        return None
    if len(indices) and (indices.min() < 0 or indices.max() >= len(values)):
        reading.warn(mesh.GetPath(), f"normals left out: their indices lie outside the {len(values)} values")
        return None
    return values, indices[element] if len(indices) else element
