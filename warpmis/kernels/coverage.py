"""What the camera sees in each pixel, and how much of it: prims with their materials, weighted by the samples' rays.

A surface that lets light through takes its share of a ray, and leaves the rest to what is behind it.
"""

import warp as wp

from warpmis.device.kernel_factory import KernelFunction, kernel_factory
from warpmis.device.views import CameraView, RoundView, SceneView
from warpmis.kernels import rng
from warpmis.kernels.camera import make_camera
from warpmis.kernels.hit import Hit
from warpmis.kernels.intersect import make_intersect
from warpmis.kernels.material import make_material
from warpmis.kernels.sampler import make_sampler
from warpmis.kernels.shading_frame import luminance, to_local
from warpmis.kernels.shadow import MAX_TRANSPARENT
from warpmis.kernels.trace import random_key
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})

# Different surfaces that a pixel can hold; of more, those seen last are left out.
SLOTS = wp.constant(16)
NO_PRIM = wp.constant(-1)


@wp.func
def add_share(surfaces: wp.array2d(dtype=wp.vec2i), shares: wp.array2d(dtype=float), row: int, key: wp.vec2i, w: float):
    """Add w to the row's share of a surface."""
    for slot in range(SLOTS):
        held = surfaces[row, slot]
        if held[0] == NO_PRIM:
            surfaces[row, slot] = key
            shares[row, slot] = w
            return
        if held[0] == key[0] and held[1] == key[1]:
            shares[row, slot] = shares[row, slot] + w
            return


@kernel_factory
def make_coverage(features: Features) -> KernelFunction:
    """The kernel for one set of effects: (prim, material) and sums of shares of the pixels from `begin` on."""
    camera_ray = make_camera(features)
    intersect = make_intersect(features)
    materials = make_material(features)
    sampler = make_sampler(features)

    @wp.func
    def share_that_passes(scene: SceneView, ray_direction: wp.vec3, hit: Hit) -> float:
        """The share of a ray's light that goes straight through the surface."""
        if wp.static(features.opacity):
            material = materials.at(scene, hit.triangle, hit.instance, hit.u, hit.v)
            frame = intersect.shading_frame(scene, hit, material, ray_direction)
            return luminance(intersect.transparency(scene, material, to_local(frame, -ray_direction)[2]))
        return 0.0

    def coverage(
        first: int,
        begin: int,
        scene: SceneView,
        camera: CameraView,
        round: RoundView,
        surfaces: wp.array2d(dtype=wp.vec2i),
        shares: wp.array2d(dtype=float),
    ):
        row = first + wp.tid()
        for slot in range(SLOTS):
            surfaces[row, slot] = wp.vec2i(NO_PRIM, NO_PRIM)
            shares[row, slot] = 0.0
        for k in range(round.first_sample, round.end_sample):
            key = random_key(round, begin + row, k)
            u = sampler.of_pixel(key, rng.CAMERA)
            ray = camera_ray(camera, key, begin + row, u[0], u[1])
            origin = ray.origin
            remaining = ray.reach
            weight = float(1.0)
            for _surface in range(MAX_TRANSPARENT):
                hit = intersect.closest_hit(scene, origin, ray.direction)
                if hit.distance >= remaining or weight <= 0.0:
                    break
                passes = share_that_passes(scene, ray.direction, hit)
                if passes < 1.0:
                    surface = wp.vec2i(
                        intersect.prim_at(scene, hit.instance, hit.triangle), scene.triangles[hit.triangle].material / 2
                    )
                    add_share(surfaces, shares, row, surface, weight * (1.0 - passes))
                weight = weight * passes
                remaining -= hit.distance
                origin = hit.p - hit.ng * hit.offset

    return coverage
