"""Closed meshes about the origin, and rays inside them that aim where meshes leak."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import scenes
import warp as wp
from numpy.typing import NDArray

from warpmis.device.upload import DeviceScene, upload
from warpmis.device.views import SceneView
from warpmis.kernels.intersect import make_intersect
from warpmis.kernels.light.distant import INFINITE_DISTANCE
from warpmis.kernels.shading_frame import frame_from_normal, to_world
from warpmis.scene.features import Features
from warpmis.scene.geometry import Geometry, Prototype

Mesh = tuple[NDArray[np.float64], NDArray[np.int32]]

ANYWHERE = wp.constant(0)
AT_EDGES = wp.constant(1)
AT_VERTICES = wp.constant(2)
ALONG_AXES = wp.constant(3)  # from a vertex's coordinates, in the planes of faces and through rows of edges
BOUNCES = wp.constant(3)


def make_count_leaks(tree: str) -> wp.Kernel:
    intersect = make_intersect(Features(instances=True, tree=tree))

    @wp.kernel(module="unique", enable_backward=False)
    def count_leaks(scene: SceneView, center: wp.vec3, inner: float, aim: int, seed: int, leaks: wp.array(dtype=int)):
        """Rays from about the centre, no farther than `inner` along any axis. leaks: those that meet nothing, shadow
        rays that meet nothing, and paths that get out within some bounces."""
        state = wp.rand_init(seed, wp.tid())
        o = center + (wp.vec3(wp.randf(state), wp.randf(state), wp.randf(state)) * 2.0 - wp.vec3(1.0, 1.0, 1.0)) * inner
        d = wp.sample_unit_sphere_surface(state)
        first = wp.where(scene.instance_count > 0, 1, 0)  # for there is a triangle far away then
        corners = scene.indices[wp.randi(state, first, scene.indices.shape[0])]
        a = scene.points[corners[0]]
        b = scene.points[corners[1]]
        if scene.instance_count > 0:
            a = scene.instances[0].linear * a + scene.instances[0].translation
            b = scene.instances[0].linear * b + scene.instances[0].translation
        along = wp.randf(state)
        if aim == AT_EDGES:
            d = wp.normalize(a * (1.0 - along) + b * along - o)
        elif aim == AT_VERTICES:
            d = wp.normalize(a - o)
        elif aim == ALONG_AXES:
            # What of the vertex lies within: lines of the grid, the faces' planes left out.
            for k in range(3):
                if wp.abs(a[k] - center[k]) < inner:
                    o[k] = a[k]
            axis = wp.randi(state, 0, 3)
            d = wp.vec3(0.0, 0.0, 0.0)
            d[axis] = wp.where(along < 0.5, -1.0, 1.0)
        if intersect.transmittance(scene, 0, o, d, INFINITE_DISTANCE)[0] > 0.0:
            wp.atomic_add(leaks, 1, 1)
        for bounce in range(BOUNCES):
            hit = intersect.closest_hit(scene, o, d)
            if hit.distance >= INFINITE_DISTANCE:
                wp.atomic_add(leaks, wp.where(bounce == 0, 0, 2), 1)
                return
            o = hit.p + hit.ng * hit.offset
            local = wp.sample_unit_hemisphere_surface(state)
            d = wp.normalize(to_world(frame_from_normal(hit.ng), wp.vec3(local[0], local[1], wp.max(local[2], 1.0e-6))))

    return count_leaks


count_leaks = make_count_leaks("wide")
count_leaks_of_mesh = make_count_leaks("warp")


def leaks(
    scene: DeviceScene,
    rays: int,
    aim: Any,
    center: Any = (0.0, 0.0, 0.0),
    inner: float = 0.05,
    kernel: wp.Kernel = count_leaks,
) -> list[int]:
    """Rays, shadow rays and paths that got out of a closed mesh."""
    counts = wp.zeros(3, dtype=int, device="cpu")
    batch = min(rays, 1 << 24)
    for first in range(0, rays, batch):
        inputs = [scene.view, wp.vec3(*center), inner, int(aim), first + 1, counts]
        wp.launch(kernel, dim=min(batch, rays - first), inputs=inputs, device="cpu")
    return [int(count) for count in counts.numpy()]


def uploaded(mesh: Mesh) -> DeviceScene:
    return upload(dataclasses.replace(scenes.room(), geometry=geometry_of(mesh)), "cpu")


def uploaded_in_places(mesh: Mesh, linear: NDArray[np.float64], translation: NDArray[np.float64]) -> DeviceScene:
    """The mesh as a prototype in places, shapes (k, 3, 3) and (k, 3), and nothing else."""
    none = np.zeros(len(linear), np.int32)
    prototype = Prototype(geometry_of(mesh), linear, translation, none, none)
    nothing = geometry_of((np.zeros((0, 3)), np.zeros((0, 3), np.int32)))
    return upload(dataclasses.replace(scenes.room(), geometry=nothing, prototypes=(prototype,)), "cpu")


def geometry_of(mesh: Mesh) -> Geometry:
    points, triangles = mesh
    return dataclasses.replace(
        scenes.room().geometry,
        points=points.astype(np.float32),
        triangles=triangles,
        normal_indices=np.full(triangles.shape, -1, np.int32),
        materials=np.zeros(len(triangles), np.int32),
        prims=np.zeros(len(triangles), np.int32),
    )


def cube(side: int = 16) -> Mesh:
    """From -1 to 1, each face of side x side squares, all vertices shared."""
    steps = np.linspace(-1.0, 1.0, side + 1)
    u, v = (grid.ravel() for grid in np.meshgrid(steps, steps, indexing="ij"))
    corner = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
    square = np.stack([corner, corner + side + 1, corner + side + 2, corner + 1], axis=1)
    points, faces = [], []
    for axis in range(3):
        for end in (-1.0, 1.0):
            face = np.zeros((len(u), 3))
            face[:, axis], face[:, axis - 2], face[:, axis - 1] = end, u, v
            faces.append(square + sum(map(len, points)))
            points.append(face)
    welded, index = np.unique(np.concatenate(points), axis=0, return_inverse=True)
    quads = index.ravel()[np.concatenate(faces)]
    return welded, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32)


def ball(side: int = 16) -> Mesh:
    points, triangles = cube(side)
    return points / np.linalg.norm(points, axis=1, keepdims=True), triangles


def turned(mesh: Mesh) -> Mesh:
    """About no particular axis."""
    rotation = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
    return mesh[0] @ rotation.T, mesh[1]


def spindle(count: int = 10_000) -> Mesh:
    """Two cones on one base: either tip is shared by `count` needles of triangles."""
    angle = 2.0 * np.pi * np.arange(count) / count
    rim = np.stack([np.cos(angle), np.zeros(count), np.sin(angle)], axis=1)
    ring, tip = np.arange(count), np.full(count, count)
    following = (ring + 1) % count
    triangles = np.concatenate([np.stack([ring, following, tip], axis=1), np.stack([following, ring, tip + 1], axis=1)])
    return np.concatenate([rim, [[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]]]), triangles.astype(np.int32)


MESHES = {
    "cube": cube(1),
    "cube of squares": cube(),
    "cube turned": turned(cube()),
    "ball": ball(),
    "spindle": spindle(),
    "each face a thousand times": (cube(1)[0], np.tile(cube(1)[1], (1000, 1))),
}
