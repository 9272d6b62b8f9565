"""Rays leave a surface without meeting it again, and closed meshes are closed."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import scenes
import warp as wp

from warpmis.device.upload import upload
from warpmis.device.views import SceneView
from warpmis.kernels.intersect import make_intersect
from warpmis.kernels.light.distant import INFINITE_DISTANCE
from warpmis.kernels.shading_frame import frame_from_normal, to_world
from warpmis.kernels.warps import square_to_uniform_hemisphere
from warpmis.scene import Scene
from warpmis.scene.features import Features
from warpmis.scene.geometry import Geometry, Prototype

intersect = make_intersect(Features(instances=True))


@wp.kernel(enable_backward=False)
def leave(
    scene: SceneView, targets: wp.array(dtype=wp.vec3), origins: wp.array(dtype=wp.vec3), again: wp.array(dtype=int)
):
    """Hit a triangle, leave it in 64 directions down to grazing ones; count rays and hits on the same triangle."""
    i = wp.tid()
    state = wp.rand_init(7, i)
    hit = intersect.closest_hit(scene, origins[i], wp.normalize(targets[i] - origins[i]))
    if hit.distance >= INFINITE_DISTANCE:
        return
    start = hit.p + hit.ng * hit.offset
    for _k in range(64):
        local = square_to_uniform_hemisphere(wp.randf(state), wp.randf(state))
        steep = wp.pow(10.0, -4.0 * wp.randf(state))
        local = wp.normalize(wp.vec3(local[0], local[1], wp.max(local[2] * steep, 1.0e-6)))
        next_hit = intersect.closest_hit(scene, start, to_world(frame_from_normal(hit.ng), local))
        wp.atomic_add(again, 0, 1)
        if next_hit.distance >= INFINITE_DISTANCE:
            continue
        if next_hit.triangle == hit.triangle and next_hit.instance == hit.instance:
            wp.atomic_add(again, 1, 1)


def soup(points: np.ndarray) -> Geometry:
    """Triangles without shared vertices, of one material."""
    count = len(points) // 3
    return dataclasses.replace(
        scenes.room().geometry,
        points=points.astype(np.float32),
        triangles=np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
        normal_indices=np.full((count, 3), -1, dtype=np.int32),
        materials=np.zeros(count, dtype=np.int32),
        prims=np.zeros(count, dtype=np.int32),
    )


def met_again(scene: Scene, corners: np.ndarray, size: float) -> tuple[int, int]:
    """Rays that left one of the triangles (shape (n, 3, 3)), and how many of them met it again."""
    uploaded = upload(scene, "cpu")
    rng = np.random.default_rng(1)
    rays = 20000
    targets = np.einsum("nc,nci->ni", rng.dirichlet(np.ones(3), rays), corners[rng.integers(0, len(corners), rays)])
    origins = targets + 3.0 * size * rng.normal(size=(rays, 3))
    again = wp.zeros(2, dtype=int, device="cpu")
    inputs = [uploaded.view, wp.array(targets, dtype=wp.vec3), wp.array(origins, dtype=wp.vec3), again]
    wp.launch(leave, dim=rays, inputs=inputs, device="cpu")
    left, met = again.numpy()
    return int(left), int(met)


@pytest.mark.parametrize(("center", "size"), [(0.0, 1.0), (10.0, 1.0), (1000.0, 1.0), (0.0, 1e4), (0.0, 1e-4)])
def test_no_ray_meets_the_triangle_that_it_leaves(center: float, size: float) -> None:
    points = np.random.default_rng(0).normal(size=(300, 3)) * size + center
    scene = dataclasses.replace(scenes.room(), geometry=soup(points))
    left, met = met_again(scene, points.reshape(-1, 3, 3), size)
    assert left > 500_000
    assert met == 0


@pytest.mark.parametrize(
    ("center", "size", "stretch"),
    [(0.0, 1.0, 1.0), (1000.0, 1.0, 1.0), (0.0, 1e4, 10.0), (0.0, 1e-4, 10.0), (10.0, 1.0, 300.0), (10.0, 1.0, -30.0)],
)
def test_no_ray_meets_the_instances_triangle_that_it_leaves(center: float, size: float, stretch: float) -> None:
    """Places that turn, mirror, and stretch a thin prototype along a direction that is none of its axes."""
    rng = np.random.default_rng(0)
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    points = rng.normal(size=(30, 3)) / [stretch, 1.0, 1.0] @ axes
    turns = np.linalg.qr(rng.normal(size=(20, 3, 3)))[0]
    linear = size * turns @ np.diag([stretch, 1.0, 1.0]) @ axes
    translation = rng.normal(size=(20, 3)) * size + center
    prototype = Prototype(soup(points), linear, translation, np.zeros(20, np.int32), np.arange(20, dtype=np.int32))
    room = scenes.room()
    nothing = dataclasses.replace(soup(points[:0]), normals=room.geometry.normals)
    scene = dataclasses.replace(room, geometry=nothing, prototypes=(prototype,))
    placed = points @ linear.swapaxes(1, 2) + translation[:, None]
    left, met = met_again(scene, placed.reshape(-1, 3, 3), size)
    assert left > 500_000
    assert met == 0


@wp.kernel(enable_backward=False)
def leak(scene: SceneView, seed: int, escaped: wp.array(dtype=int)):
    """Count rays from inside a closed mesh that meet nothing."""
    i = wp.tid()
    state = wp.rand_init(seed, i)
    direction = wp.sample_unit_sphere_surface(state)
    hit = intersect.closest_hit(scene, wp.vec3(0.1, 1.1, 0.05), direction)
    if hit.distance >= INFINITE_DISTANCE:
        wp.atomic_add(escaped, 0, 1)


def test_no_ray_leaves_a_closed_room() -> None:
    uploaded = upload(scenes.room(), "cpu")
    escaped = wp.zeros(1, dtype=int, device="cpu")
    wp.launch(leak, dim=2_000_000, inputs=[uploaded.view, 3, escaped], device="cpu")
    assert escaped.numpy()[0] == 0
