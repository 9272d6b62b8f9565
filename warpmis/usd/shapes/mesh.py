"""UsdGeomMesh: polygons, holes, orientation and normals, with what is broken left out and said so."""

from __future__ import annotations

from typing import Any

import numpy as np
from pxr import UsdGeom

from warpmis.usd.authored import read_authored
from warpmis.usd.reading import Reading, consistent_counts
from warpmis.usd.shapes.polygons import Polygons, triangulate
from warpmis.usd.shapes.refined_mesh import RefinedMesh, refined_mesh
from warpmis.usd.shapes.surfaces import FloatArray, IntArray, Surface, flat_surface

REFINED_NOTE = (
    "it has normals but no subdivisionScheme: by the schema it is a catmullClark surface, and its normals are "
    'not used; author subdivisionScheme = "none" for polygons'
)


def read_mesh(prim: Any, matrices: FloatArray, reading: Reading) -> Surface | None:
    """The triangles of a UsdGeomMesh in its own space, or None where nothing of it can be rendered.

    Authored normals count for subdivisionScheme "none" alone; "bilinear" is flat, and so is "none" without them. Of
    other schemes the normals are averaged over the refined polygons, or over the cage's where it is not refined.

    Args:
        matrices: local to world, shape (k, 4, 4); where it looks largest says how often it is worth refining.
    """
    mesh = UsdGeom.Mesh(prim)
    authored = _read_polygons(mesh, reading)
    if not authored.usable.any():
        return None
    scheme = str(reading.get(mesh.GetSubdivisionSchemeAttr(), "catmullClark"))
    if not mesh.GetSubdivisionSchemeAttr().HasAuthoredValue() and _authors_normals(mesh):
        reading.note(REFINED_NOTE, prim.GetPath())
    refined = refined_mesh(mesh, authored, scheme, _holes(mesh, authored, reading), matrices, reading)
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
        return flat_surface(polygons.points, triangles, faces, corners, refined)
    return Surface(polygons.points, triangles, faces, normals[0], normals[1][corners], corners, refined)


def _authors_normals(mesh: Any) -> bool:
    primvar = UsdGeom.PrimvarsAPI(mesh.GetPrim()).GetPrimvar("normals")
    return bool(mesh.GetNormalsAttr().HasAuthoredValue() or (primvar and primvar.HasAuthoredValue()))


def _read_polygons(mesh: Any, reading: Reading) -> Polygons:
    """Points and faces, with the faces that cannot be rendered marked; one warning for each reason."""
    path = mesh.GetPath()
    points = reading.vectors(mesh.GetPointsAttr())
    indices = reading.indices(mesh.GetFaceVertexIndicesAttr())
    counts = reading.indices(mesh.GetFaceVertexCountsAttr())
    counts = consistent_counts(counts, len(indices), ("faceVertexCounts", "faceVertexIndices", "faces"), path, reading)
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


def _authored_normals(mesh: Any, refined: RefinedMesh, reading: Reading) -> tuple[FloatArray, IntArray] | None:
    """Authored normals, shape (m, 3), and the row of each of the polygons' corners, shape (c,); None without any."""
    interpolation = str(mesh.GetNormalsInterpolation())
    normals = read_authored(mesh.GetPrim(), "normals", interpolation, refined.elements, reading)
    return None if normals is None else refined.primvar(*normals)
