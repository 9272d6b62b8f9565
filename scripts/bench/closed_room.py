"""A closed room of many triangles: six bumpy walls about a camera and a lamp, so that every ray hits one of them."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdLux, Vt

HEIGHT_OF_BUMPS = 0.02


def write_closed_room(path: Path, triangles: int) -> None:
    """The cube from -1 to 1; at least so many triangles, that share the points of a wall, and close at its edges."""
    side = math.ceil(math.sqrt(triangles / 12)) + 1
    vertex = np.arange(side * side, dtype=np.int32).reshape(side, side)
    quads = np.stack([vertex[:-1, :-1], vertex[:-1, 1:], vertex[1:, 1:], vertex[1:, :-1]], axis=-1).reshape(-1, 4)
    v, u = np.divmod(np.arange(side * side), side) / np.float64(side - 1)
    # 0 along the edges, where walls meet.
    bumps = HEIGHT_OF_BUMPS * np.sin(25.0 * np.pi * u) * np.sin(25.0 * np.pi * v)
    stage = Usd.Stage.CreateNew(str(path))
    for axis in range(3):
        for wall in (-1.0, 1.0):
            points = np.empty((side * side, 3))
            points[:, axis] = wall * (1.0 - np.abs(bumps))
            points[:, (axis + 1) % 3], points[:, (axis + 2) % 3] = 2.0 * u - 1.0, 2.0 * v - 1.0
            mesh = UsdGeom.Mesh.Define(stage, f"/Room/Wall{axis}{'Low' if wall < 0.0 else 'High'}")
            mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.astype(np.float32)))
            mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(quads.reshape(-1)))
            mesh.CreateFaceVertexCountsAttr(Vt.IntArray(len(quads), 4))
            mesh.CreateSubdivisionSchemeAttr("none")
            mesh.CreateDisplayColorAttr([Gf.Vec3f(0.7, 0.7, 0.7)])
    lamp = UsdLux.SphereLight.Define(stage, "/Room/Lamp")
    lamp.CreateRadiusAttr(0.2)
    lamp.CreateIntensityAttr(10.0)
    lamp.AddTranslateOp().Set(Gf.Vec3d(0.3, 0.5, -0.2))
    camera = UsdGeom.Camera.Define(stage, "/Room/Camera")
    camera.CreateHorizontalApertureAttr(24.0)
    camera.CreateVerticalApertureAttr(24.0)
    camera.CreateFocalLengthAttr(15.0)
    camera.AddTranslateOp().Set(Gf.Vec3d(0.1, -0.1, 0.9))
    stage.Save()
