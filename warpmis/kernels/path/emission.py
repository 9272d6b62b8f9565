"""The emission that a path's ray meets, of the lights on its way and of the surface at its end.

A light sample of the vertex that the ray left could have found the same light: then the emission is weighted by the
balance heuristic (PathState.weighs_emission).
"""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import MaterialView, SceneView
from warpmis.kernels.hit import Hit
from warpmis.kernels.light.choice import density
from warpmis.kernels.light.met import keep_emission
from warpmis.kernels.light.on_ray import LightsOnRay
from warpmis.kernels.medium import transmittance
from warpmis.kernels.mis import balance_weight
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})


def make_emission(
    features: Features,
    PathState: type,
    lights: SimpleNamespace,
    record: SimpleNamespace,
    contributions: SimpleNamespace,
) -> SimpleNamespace:
    """Functions: add, of_lights, of_surface, arriving."""

    @wp.func
    def add(scene: SceneView, path: wp.ref[PathState], emission: wp.vec3):
        """Add an emission times the path's throughput."""
        radiance = wp.cw_mul(path.beta, emission)
        path.L += radiance
        record.emission(path, radiance)
        contributions.ray(scene, path)

    @wp.func
    def of_lights(path: wp.ref[PathState], on_ray: wp.ref[LightsOnRay]) -> wp.vec3:
        emission = on_ray.radiance
        if path.weighs_emission:
            emission = on_ray.weighted
        return emission

    @wp.func
    def controlled(scene: SceneView, path: wp.ref[PathState], light: int, emission: wp.vec3) -> wp.vec3:
        """What the light's controls make of it for the last vertex."""
        factor = lights.control.factor(scene, light, path.receiver, path.wi)
        if wp.static(features.light_response):
            if path.receiver.is_surface:
                factor = wp.cw_mul(factor, lights.control.response(scene, light, path.receiver.diffuse))
        return wp.cw_mul(emission, factor)

    @wp.func
    def arriving(path: wp.ref[PathState], hit: wp.ref[Hit], material: MaterialView) -> wp.vec3:
        """Share of light that the medium before the surface leaves over. Before a back face that is the surface's own,
        also for a camera within it. Reference: Beer's law."""
        absorption = path.receiver.absorption
        if not hit.is_front and material.transmission > 0.0:
            absorption = material.absorption
        return transmittance(absorption, hit.distance)

    @wp.func
    def of_surface(
        scene: SceneView, path: wp.ref[PathState], hit: wp.ref[Hit], material: MaterialView, distance: float
    ) -> wp.vec3:
        """That of a mesh light, `distance` from the last vertex; 0 of all other surfaces, and behind one-sided ones."""
        emitter = scene.triangles[hit.triangle].emitter
        if emitter < 0 or (not hit.is_front and not material.double_sided):
            return wp.vec3(0.0, 0.0, 0.0)
        emission = material.emission
        if wp.static(features.absorption):
            emission = wp.cw_mul(emission, arriving(path, hit, material))
        if wp.static(features.controlled):
            light = lights.light_of_emitter(scene, emitter, hit.instance)
            emission = controlled(scene, path, light, emission)
        if path.weighs_emission:
            of_light = lights.emitter_density(scene, path.receiver, emitter, hit.instance, hit.ng, path.wi, distance)
            emission = emission * balance_weight(path.pdf, density(of_light, path.receiver.total))
        if wp.static(features.keeps_light_apart):
            light = lights.light_of_emitter(scene, emitter, hit.instance)
            share = lights.control.diffuse_share(scene, light, path.receiver.diffuse)
            keep_emission(scene, path.receiver, light, emission, share)
        return emission

    return SimpleNamespace(add=add, of_lights=of_lights, of_surface=of_surface, arriving=arriving)
