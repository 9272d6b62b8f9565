"""Stages authored in the tests, and numbers taken from the scenes they load as."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Usd

from warpmis.scene import Scene
from warpmis.usd import load_stage

HEADER = "#usda 1.0\n"

# A unit square in the xy plane, wound counter-clockwise seen from +Z.
SQUARE = """
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
"""


def stage_of(text: str) -> Any:
    """An in-memory stage of a layer's text without its header; `def X "a" { ... }` may stand on one line."""
    stage = Usd.Stage.CreateInMemory()
    assert stage.GetRootLayer().ImportFromString(HEADER + text)
    return stage


def load(text: str, **options: Any) -> Scene:
    """`load_stage` of a layer's text."""
    return load_stage(stage_of(text), **options)


def corners(scene: Scene) -> NDArray[np.float64]:
    """Triangle corners, shape (F, 3, 3)."""
    return scene.geometry.points[scene.geometry.triangles].astype(np.float64)


def vector_areas(scene: Scene) -> NDArray[np.float64]:
    """Area times front normal of each triangle, shape (F, 3)."""
    p = corners(scene)
    return 0.5 * np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])


def area(scene: Scene) -> float:
    return float(np.linalg.norm(vector_areas(scene), axis=1).sum())


def volume(scene: Scene) -> float:
    """Enclosed volume, positive where all fronts are outside."""
    return float(np.einsum("fi,fi->", corners(scene).mean(axis=1), vector_areas(scene))) / 3.0


def shading_normals(scene: Scene) -> NDArray[np.float64]:
    """Normals at the triangle corners, shape (F, 3, 3); the triangles must not be flat."""
    assert (scene.geometry.normal_indices >= 0).all()
    return scene.geometry.normals[scene.geometry.normal_indices].astype(np.float64)


def centers(scene: Scene) -> dict[str, NDArray[np.float64]]:
    """Middle of each prim's box, by path, for prims that appear once."""
    points, prims = corners(scene), scene.geometry.prims
    return {
        prim.path: (points[prims == i].min(axis=(0, 1)) + points[prims == i].max(axis=(0, 1))) / 2
        for i, prim in enumerate(scene.prims)
    }


def check_invariants(scene: Scene) -> None:
    """What scene.py promises of every Geometry."""
    g = scene.geometry
    assert g.points.dtype == g.normals.dtype == np.float32
    assert g.triangles.dtype == g.normal_indices.dtype == g.materials.dtype == g.prims.dtype == np.int32
    assert g.triangles.shape == g.normal_indices.shape == (len(g.materials), 3) == (len(g.prims), 3)
    if not len(g.triangles):
        return
    assert np.isfinite(g.points).all()
    assert g.triangles.min() >= 0
    assert g.triangles.max() < len(g.points)
    assert g.materials.max() < len(scene.materials)
    assert g.prims.max() < len(scene.prims)
    fronts = vector_areas(scene)
    assert (fronts != 0).any(axis=1).all()
    smooth = (g.normal_indices >= 0).all(axis=1)
    assert (g.normal_indices[~smooth] == -1).all()
    normals = g.normals[g.normal_indices[smooth]].astype(np.float64)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1.0, atol=1e-5)
    assert (np.einsum("fcj,fj->fc", normals, fronts[smooth]) > 0).all()


def mentions(scene: Scene, *words: str) -> bool:
    """Whether exactly one warning holds all the words."""
    return sum(all(word in line for word in words) for line in scene.warnings) == 1
