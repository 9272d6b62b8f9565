"""The ids of each pixel: those of the first surface that a ray through the pixel's center hits."""

from dataclasses import replace

import warp as wp

from warpmis.device.kernel_factory import KernelFunction, kernel_factory
from warpmis.device.views import CameraView, SceneView
from warpmis.kernels import rng
from warpmis.kernels.camera import make_camera
from warpmis.kernels.hit import NO_INSTANCE
from warpmis.kernels.intersect import MAX_TRANSPARENT, make_intersect
from warpmis.kernels.material import make_material
from warpmis.scene.features import Features


@kernel_factory
def make_identify(features: Features) -> KernelFunction:
    """The kernel for one set of effects: (prim, place, face) of each pixel, -1 where it sees no surface."""
    camera_ray = make_camera(replace(features, depth_of_field=False))
    intersect = make_intersect(features)
    materials = make_material(features)

    def identify(first_pixel: int, scene: SceneView, camera: CameraView, ids: wp.array(dtype=wp.vec3i)):
        pixel = first_pixel + wp.tid()
        ids[pixel] = wp.vec3i(-1, -1, -1)
        ray = camera_ray(camera, rng.RngKey(), pixel, 0.5, 0.5)
        start = ray.origin
        remaining = ray.reach
        for _surface in range(MAX_TRANSPARENT):
            hit = intersect.closest_hit(scene, start, ray.direction)
            if hit.distance >= remaining:
                return
            is_visible = bool(True)
            if wp.static(features.opacity):
                is_visible = materials.at(scene, hit.triangle, hit.instance, hit.u, hit.v).opacity > 0.0
            if is_visible:
                prim = scene.prims[hit.triangle]
                place = scene.copies[hit.triangle]
                if wp.static(features.instances):
                    if hit.instance != NO_INSTANCE:
                        prim = scene.instances[hit.instance].prim
                        place = scene.instances[hit.instance].copy
                ids[pixel] = wp.vec3i(prim, place, scene.faces[hit.triangle])
                return
            remaining -= hit.distance
            start = hit.p - hit.ng * hit.offset

    return identify
