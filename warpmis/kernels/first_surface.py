"""The first surface that a ray through a pixel's centre hits and that is there at all."""

from dataclasses import replace
from types import SimpleNamespace

import warp as wp

from warpmis.device.kernel_factory import KernelFunction, kernel_factory
from warpmis.device.views import CameraView, SceneView
from warpmis.kernels import rng
from warpmis.kernels.camera import make_camera
from warpmis.kernels.hit import Hit
from warpmis.kernels.intersect import make_intersect
from warpmis.kernels.light.distant import INFINITE_DISTANCE
from warpmis.kernels.material import make_material
from warpmis.kernels.shadow import MAX_TRANSPARENT
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})

NO_SURFACE = wp.constant(-1)


def make_first_surface(features: Features) -> SimpleNamespace:
    """The function first_surface for one set of effects."""
    camera_ray = make_camera(replace(features, depth_of_field=False))
    intersect = make_intersect(features)
    materials = make_material(features)

    @wp.func
    def first_surface(scene: SceneView, camera: CameraView, pixel: int) -> Hit:
        """Its distance is INFINITE_DISTANCE where there is none."""
        ray = camera_ray(camera, rng.RngKey(), pixel, 0.5, 0.5)
        start = ray.origin
        remaining = ray.reach
        for _surface in range(MAX_TRANSPARENT):
            hit = intersect.closest_hit(scene, start, ray.direction)
            if hit.distance >= remaining:
                break
            is_visible = bool(True)
            if wp.static(features.opacity):
                is_visible = materials.at(scene, hit.triangle, hit.instance, hit.u, hit.v).opacity > 0.0
            if is_visible:
                return hit
            remaining -= hit.distance
            start = hit.p - hit.ng * hit.offset
        nothing = Hit()
        nothing.distance = INFINITE_DISTANCE
        return nothing

    return SimpleNamespace(first_surface=first_surface)


@kernel_factory
def make_locate_surface(features: Features) -> KernelFunction:
    """The kernel for one set of effects: of each pixel the triangle and the instance that it sees, rows of SceneView,
    the former -1 where it sees none; and the weights of the first two corners there."""
    first_surface = make_first_surface(features).first_surface

    def locate_surface(
        first: int,
        scene: SceneView,
        camera: CameraView,
        places: wp.array(dtype=wp.vec2i),
        weights: wp.array(dtype=wp.vec2),
    ):
        pixel = first + wp.tid()
        hit = first_surface(scene, camera, pixel)
        places[pixel] = wp.vec2i(hit.triangle, hit.instance)
        weights[pixel] = wp.vec2(hit.u, hit.v)
        if hit.distance >= INFINITE_DISTANCE:
            places[pixel] = wp.vec2i(NO_SURFACE, NO_SURFACE)

    return locate_surface
