"""Primvars of a skinned mesh that are directions: normals and tangents turn with the points that they belong to.

UsdSkel skins the attribute `normals` of one value a point or corner, and nothing else. So `primvars:normals`, which go
before it, become `normals` ahead of the skinning; tangents are turned here.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Usd, UsdGeom, UsdSkel, Vt

from warpmis.usd.reading import PxrError, Reading, is_array

FloatArray = NDArray[np.float64]

TANGENTS = ("tangents", "bitangents")


def prepare_directions(root: Any, reading: Reading) -> None:
    """Writes what is above of all meshes that are skinned below a SkelRoot into the stage's edit target."""
    cache, predicate = UsdSkel.Cache(), Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)
    cache.Populate(root, predicate)
    for binding in cache.ComputeSkelBindings(root, predicate):
        skeleton = cache.GetSkelQuery(binding.GetSkeleton())
        for target in binding.GetSkinningTargets():
            prim = target.GetPrim()
            if not prim.IsA(UsdGeom.Mesh) or prim.IsInstanceProxy() or target.IsRigidlyDeformed():
                continue
            try:
                _write_normals(prim, reading)
                if any(UsdGeom.PrimvarsAPI(prim).HasPrimvar(name) for name in TANGENTS):
                    turns = point_turns(target, skeleton, reading)
                    if turns is not None:
                        _write_tangents(prim, turns, reading)
            except PxrError:
                reading.warn(prim.GetPath(), "its normals and tangents cannot be skinned")


def _write_normals(prim: Any, reading: Reading) -> None:
    """The mesh's normals as the attribute that UsdSkel skins, of one value a point or corner."""
    mesh = UsdGeom.Mesh(prim)
    primvar = UsdGeom.PrimvarsAPI(prim).GetPrimvar("normals")
    is_primvar = bool(primvar and primvar.HasAuthoredValue())
    attribute = primvar.GetAttr() if is_primvar else mesh.GetNormalsAttr()
    interpolation = str(primvar.GetInterpolation() if is_primvar else mesh.GetNormalsInterpolation())
    if not is_primvar and interpolation not in ("uniform", "constant"):
        return
    values = reading.vectors(attribute)
    indices = reading.indices(primvar.GetIndicesAttr()) if is_primvar and primvar.IsIndexed() else None
    spread = _spread(mesh, values, indices, interpolation, reading)
    if spread is None:
        return
    values, interpolation = spread
    mesh.GetNormalsAttr().Set(Vt.Vec3fArray.FromNumpy(values.astype(np.float32)))
    mesh.SetNormalsInterpolation(interpolation)
    if is_primvar:
        attribute.Block()


def _spread(
    mesh: Any, values: FloatArray, indices: Any, interpolation: str, reading: Reading
) -> tuple[FloatArray, str] | None:
    """Values without indices, of one value a point or corner; None where their number does not fit."""
    if indices is not None:
        if not len(indices) or indices.min() < 0 or indices.max() >= len(values):
            return None
        values = values[indices]
    counts = reading.indices(mesh.GetFaceVertexCountsAttr())
    corners = int(counts.sum()) if (counts >= 0).all() else 0
    expected = {"constant": 1, "uniform": len(counts), "faceVarying": corners}
    if not len(values) or len(values) != expected.get(interpolation, len(reading.vectors(mesh.GetPointsAttr()))):
        return None
    if interpolation == "constant":
        return np.repeat(values, corners, axis=0), "faceVarying"
    if interpolation == "uniform":
        return np.repeat(values, counts, axis=0), "faceVarying"
    return values, interpolation


def point_turns(target: Any, skeleton: Any, reading: Reading) -> FloatArray | None:
    """What skinning does to a direction at each point, a row vector in the mesh's space, shape (n, 3, 3); None where
    the mesh cannot be skinned.

    Skinning is affine at each point, so its linear part is what it does to the axes less what it does to the origin.
    """
    prim, time = target.GetPrim(), reading.time
    count = len(reading.vectors(UsdGeom.Mesh(prim).GetPointsAttr()))
    influences, joints = target.ComputeVaryingJointInfluences(count, time), skeleton.ComputeSkinningTransforms(time)
    mapper = target.GetJointMapper()
    if mapper and joints:
        joints = mapper.RemapTransforms(joints)
    if not influences or not joints:
        return None
    indices, weights = influences
    if not _is_sound(indices, weights, count * target.GetNumInfluencesPerComponent(), len(joints)):
        return None
    moved = []
    for corner in ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)):
        points = Vt.Vec3fArray(count, Gf.Vec3f(*corner))
        UsdSkel.SkinPoints(
            target.GetSkinningMethod(), Gf.Matrix4d(target.GetGeomBindTransform(time)), joints, indices, weights,
            target.GetNumInfluencesPerComponent(), points,
        )  # fmt: skip
        moved.append(np.asarray(points, np.float64))
    in_skeleton = np.stack([end - moved[0] for end in moved[1:]], axis=1)
    transforms = UsdGeom.XformCache(time)
    to_mesh = (
        transforms.GetLocalToWorldTransform(skeleton.GetPrim()) * transforms.GetLocalToWorldTransform(prim).GetInverse()
    )
    return in_skeleton @ np.array(to_mesh)[:3, :3]


def _is_sound(indices: Any, weights: Any, count: int, joints: int) -> bool:
    """Whether there are so many influences, each of a joint that there is."""
    found = np.asarray(indices)
    if not count or len(found) != count or len(weights) != count:
        return False
    return bool(found.min() >= 0 and found.max() < joints)


def _write_tangents(prim: Any, turns: FloatArray, reading: Reading) -> None:
    mesh = UsdGeom.Mesh(prim)
    for name in TANGENTS:
        primvar = UsdGeom.PrimvarsAPI(prim).GetPrimvar(name)
        if not primvar:
            continue
        authored = reading.value(primvar.GetAttr())
        values = np.asarray(authored)
        is_sound = is_array(authored) and values.dtype.kind == "f" and values.ndim == 2
        if not is_sound or values.shape[1] not in (3, 4):
            reading.warn(primvar.GetAttr().GetPath(), "it is not skinned: it is of the wrong type")
            continue
        indices = reading.indices(primvar.GetIndicesAttr()) if primvar.IsIndexed() else None
        spread = _spread(mesh, values.astype(np.float64), indices, str(primvar.GetInterpolation()), reading)
        if spread is None:
            continue
        values, interpolation = spread
        corners = reading.indices(mesh.GetFaceVertexIndicesAttr())
        rows = corners if interpolation == "faceVarying" else np.arange(len(turns))
        if len(rows) != len(values) or (len(rows) and (rows.min() < 0 or rows.max() >= len(turns))):
            continue
        turned = np.einsum("nj,njk->nk", values[:, :3], turns[rows])
        _overwrite(primvar, np.concatenate([turned, values[:, 3:]], axis=1), interpolation, reading)


def _overwrite(primvar: Any, values: FloatArray, interpolation: str, reading: Reading) -> None:
    """New values of a primvar, of its own type, without indices."""
    authored = reading.value(primvar.GetAttr())
    if primvar.IsIndexed():
        primvar.BlockIndices()
    primvar.Set(type(authored).FromNumpy(values.astype(np.asarray(authored).dtype)))
    primvar.SetInterpolation(interpolation)
