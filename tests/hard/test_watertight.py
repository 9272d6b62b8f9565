"""Closed meshes are closed: no ray and no path gets out, wherever it aims."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import warp as wp
from hard.closed_meshes import (
    ALONG_AXES,
    ANYWHERE,
    AT_EDGES,
    AT_VERTICES,
    MESHES,
    count_leaks_of_mesh,
    cube,
    leaks,
    uploaded,
    uploaded_in_places,
)

from warpmis.device.mesh import padded_boxes, watertight_meshes
from warpmis.device.upload import DeviceScene

# Where thousands of triangles meet, or lie in one place, a ray has them all to test.
RAYS = {"spindle": 2_000, "each face a thousand times": 1_000}
AIMS = {"anywhere": ANYWHERE, "at edges": AT_EDGES, "at vertices": AT_VERTICES}


@cache
def scene_of(name: str) -> DeviceScene:
    return uploaded(MESHES[name])


@pytest.mark.parametrize("aim", AIMS)
@pytest.mark.parametrize("name", MESHES)
def test_no_ray_gets_out(name: str, aim: str) -> None:
    assert leaks(scene_of(name), RAYS.get(name, 100_000), AIMS[aim]) == [0, 0, 0]


@pytest.mark.parametrize("name", ["cube", "cube of squares", "each face a thousand times"])
def test_no_ray_along_an_axis_gets_out(name: str) -> None:
    """In the planes of the squares' sides, along rows of edges and through vertices."""
    assert leaks(scene_of(name), RAYS.get(name, 100_000), ALONG_AXES, inner=0.999) == [0, 0, 0]


@pytest.mark.parametrize(("size", "at"), [(1e-6, 0.0), (1e6, 0.0), (1.0, 50.0)])
def test_no_ray_gets_out_of_a_small_large_or_distant_cube(size: float, at: float) -> None:
    """Up to the distance from which on a stage is moved to the origin (usd/origin.py: FAR)."""
    points, triangles = cube()
    scene = uploaded((points * size + at, triangles))
    for aim in AIMS.values():
        assert leaks(scene, 100_000, aim, center=(at, at, at), inner=0.05 * size) == [0, 0, 0]


# Turned and stretched, mirrored, small: about no particular axis.
ROTATION = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
PLACES = {
    "turned": ROTATION,
    "stretched": ROTATION @ np.diag([3.0, 0.5, 1.0]) @ ROTATION,
    "mirrored": np.diag([1.0, -1.0, 1.0]) @ ROTATION,
    "small": 1e-3 * ROTATION,
}


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("name", ["cube", "cube of squares", "ball"])
def test_no_ray_gets_out_of_an_instance(name: str, place: str) -> None:
    """Also where the scene is much larger than the instance, since another stands far away."""
    linear, center = PLACES[place], np.array([3.0, -2.0, 5.0])
    scene = uploaded_in_places(MESHES[name], np.stack([linear, np.eye(3)]), np.stack([center, [30.0, 0.0, 0.0]]))
    size = np.linalg.svd(linear)[1].min()
    for aim in AIMS.values():
        assert leaks(scene, 100_000, aim, center=center, inner=0.05 * size) == [0, 0, 0]


@pytest.mark.slow
@pytest.mark.parametrize("aim", AIMS)
@pytest.mark.parametrize("name", ["cube turned", "ball"])
def test_no_ray_of_a_hundred_million_gets_out(name: str, aim: str) -> None:
    """Twenty million times a ray, a shadow ray and a path of three."""
    assert leaks(scene_of(name), 20_000_000, AIMS[aim]) == [0, 0, 0]


def tight_boxes(points: np.ndarray, triangles: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
    corners = points[triangles]
    return corners.min(axis=1), corners.max(axis=1)


def test_boxes_of_the_triangles_own_size_leak(monkeypatch: pytest.MonkeyPatch) -> None:
    """The naive form loses one in a hundred of the rays that aim at an edge."""
    monkeypatch.setattr("warpmis.device.wide_tree.padded_boxes", tight_boxes)
    rays, shadow_rays, _ = leaks(uploaded(cube()), 100_000, AT_EDGES)
    assert rays > 100
    assert shadow_rays > 100


@pytest.mark.parametrize("aim", AIMS)
@pytest.mark.parametrize("name", ["cube", "cube turned", "ball"])
def test_no_ray_gets_out_of_the_tree_for_a_gpu(name: str, aim: str) -> None:
    """Warp's mesh, here on the CPU: in boxes of its triangles' own size it loses as many."""
    scene = uploaded(MESHES[name])
    points, triangles = scene.view.points.numpy(), scene.view.indices.numpy()
    meshes, _rows = watertight_meshes(points, triangles, [0, len(triangles)], [2.0 * np.abs(points).max()])
    scene.view.mesh = meshes[0].id
    assert leaks(scene, 50_000, AIMS[aim], kernel=count_leaks_of_mesh) == [0, 0, 0]


def test_the_tree_for_a_gpu_leaks_in_boxes_of_its_own() -> None:
    scene = uploaded(cube())
    points = wp.array(scene.view.points.numpy(), dtype=wp.vec3, device="cpu")
    mesh = wp.Mesh(points, wp.array(scene.view.indices.numpy().ravel(), dtype=wp.int32, device="cpu"))
    scene.view.mesh = mesh.id
    assert leaks(scene, 100_000, AT_EDGES, kernel=count_leaks_of_mesh)[0] > 100


def test_boxes_hold_their_triangles_and_more() -> None:
    points, triangles = cube()
    low, high = padded_boxes(points.astype(np.float32), triangles)
    corners = points[triangles]
    assert (low < corners.min(axis=1)).all()
    assert (high > corners.max(axis=1)).all()
    assert (corners.min(axis=1) - low).max() < 1e-5
