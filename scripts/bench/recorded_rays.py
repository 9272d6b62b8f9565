"""The rays that a render traces, recorded, and a bare kernel that traces them again: the speed that Warp's mesh query
alone would reach on them."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpmis.device.mesh import watertight_meshes
from warpmis.device.upload import upload
from warpmis.device.views import CameraView, SceneView
from warpmis.kernels import rng
from warpmis.kernels.camera import make_camera
from warpmis.kernels.hit import Hit
from warpmis.kernels.intersect import make_intersect
from warpmis.kernels.path.li import make_path
from warpmis.scene import Scene
from warpmis.scene.features import Features, detect


@dataclass(frozen=True, eq=False)
class Rays:
    """Rays in the order in which they were traced: origins, unit directions, shape (n, 3); lengths, shape (n,), 1e30
    for rays that seek the closest surface, and the light's distance for shadow rays (below 1e29: no lights at
    infinity)."""

    origins: NDArray[np.float32]
    directions: NDArray[np.float32]
    lengths: NDArray[np.float32]


@wp.func
def record(scene: SceneView, origin: wp.vec3, wi: wp.vec3, length: float):
    """Append a ray. A scene without a dome leaves the dome's tables free to hold them."""
    slot = int(wp.atomic_add(scene.dome.marginal, 0, 0, 1.0))
    if slot < scene.dome.columns:
        scene.dome.picture[slot, 0] = origin
        scene.dome.picture[slot, 1] = wi
        scene.dome.conditional[slot, 0] = length


def recording_intersect(features: Features) -> SimpleNamespace:
    plain = make_intersect(features)
    closest_of, transmittance_of = plain.closest_hit, plain.transmittance

    @wp.func
    def closest_hit(scene: SceneView, origin: wp.vec3, wi: wp.vec3) -> Hit:
        record(scene, origin, wi, 1.0e30)
        return closest_of(scene, origin, wi)

    @wp.func
    def transmittance(scene: SceneView, light: int, origin: wp.vec3, wi: wp.vec3, distance: float) -> wp.vec3:
        record(scene, origin, wi, distance)
        return transmittance_of(scene, light, origin, wi, distance)

    plain.closest_hit, plain.transmittance = closest_hit, transmittance
    return plain


def record_rays(scene: Scene, samples: int, max_depth: int, capacity: int) -> Rays:
    """The rays of next-event estimation, pixel after pixel, one thread."""
    uploaded = upload(scene, "cpu")
    view = uploaded.view
    view.dome.columns = capacity
    view.dome.marginal = wp.zeros((1, 1), dtype=float, device="cpu")
    view.dome.picture = wp.zeros((capacity, 2), dtype=wp.vec3, device="cpu")
    view.dome.conditional = wp.zeros((capacity, 1), dtype=float, device="cpu")
    pixels = uploaded.camera.width * uploaded.camera.height
    run = recording_kernel(detect(scene).with_sampler("independent"))
    wp.launch(run, dim=pixels, inputs=[view, uploaded.camera, samples, max_depth], device="cpu")
    count = int(view.dome.marginal.numpy()[0, 0])
    if count > capacity:
        raise SystemExit(f"{count} rays do not fit into {capacity}; record fewer pixels or samples")
    rays = view.dome.picture.numpy()[:count]
    return Rays(rays[:, 0].copy(), rays[:, 1].copy(), view.dome.conditional.numpy()[:count, 0].copy())


def recording_kernel(features: Features) -> wp.Kernel:
    path = make_path(features, recording_intersect(features))
    camera_ray = make_camera(features)
    Li = path.Li
    vec_s = path.strategies.vec_s

    @wp.kernel(module="unique", enable_backward=False)
    def run(scene: SceneView, camera: CameraView, samples: int, max_depth: int):
        pixel = wp.tid()
        for k in range(samples):
            key = rng.RngKey()
            key.pixel = wp.uint32(pixel)
            key.sample = wp.uint32(k)
            u = rng.uniform4(key, rng.CAMERA)
            ray = camera_ray(camera, key, pixel, u[0], u[1])
            u_choice = rng.uniform4(key, rng.CHOICE)[0]
            Li(scene, ray, key, vec_s(), u_choice, max_depth)

    return run


def warp_mesh_of(view: SceneView) -> wp.Mesh:
    """The triangles of a scene on the CPU as a GPU would have them; the mesh keeps alive what it needs."""
    points, triangles = view.points.numpy(), view.indices.numpy()
    (mesh,), _rows = watertight_meshes(points, triangles, [0, len(triangles)], [float(np.ptp(points, axis=0).max())])
    return mesh


@wp.kernel(module="unique", enable_backward=False)
def bare_queries(
    mesh: wp.uint64,
    origins: wp.array(dtype=wp.vec3),
    directions: wp.array(dtype=wp.vec3),
    lengths: wp.array(dtype=float),
    hits: wp.array(dtype=float),
):
    """The closest surface for a path's ray, any surface for a shadow ray: what the trace kernel asks Warp for."""
    i = wp.tid()
    if lengths[i] < 1.0e29:
        hits[i] = wp.where(wp.mesh_query_ray_anyhit(mesh, origins[i], directions[i], lengths[i]), 1.0, 0.0)
    else:
        query = wp.mesh_query_ray(mesh, origins[i], directions[i], 1.0e30)
        hits[i] = query.t
