"""The ids of each pixel: those of the first surface that a ray through the pixel's center hits."""

import warp as wp

from warpmis.device.kernel_factory import KernelFunction, kernel_factory
from warpmis.device.views import CameraView, SceneView
from warpmis.kernels.first_surface import make_first_surface
from warpmis.kernels.hit import NO_INSTANCE
from warpmis.kernels.light.distant import INFINITE_DISTANCE
from warpmis.scene.features import Features


@kernel_factory
def make_identify(features: Features) -> KernelFunction:
    """The kernel for one set of effects: (prim, place, face) of each pixel, -1 where it sees no surface."""
    first_surface = make_first_surface(features).first_surface

    def identify(first_pixel: int, scene: SceneView, camera: CameraView, ids: wp.array(dtype=wp.vec3i)):
        pixel = first_pixel + wp.tid()
        ids[pixel] = wp.vec3i(-1, -1, -1)
        hit = first_surface(scene, camera, pixel)
        if hit.distance < INFINITE_DISTANCE:
            prim = scene.prims[hit.triangle]
            place = scene.copies[hit.triangle]
            if wp.static(features.instances):
                if hit.instance != NO_INSTANCE:
                    prim = scene.instances[hit.instance].prim
                    place = scene.instances[hit.instance].copy
            ids[pixel] = wp.vec3i(prim, place, scene.faces[hit.triangle])

    return identify
