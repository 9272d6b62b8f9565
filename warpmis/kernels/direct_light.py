"""Direct light: by a light sample, by a delta light, or by a ray that meets a mesh light."""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import DELTA_DISTANT, MaterialView, SceneView
from warpmis.kernels.bsdf.surface import Surface
from warpmis.kernels.hit import Hit
from warpmis.kernels.light.distant import INFINITE_DISTANCE
from warpmis.kernels.light.mesh_light import pdf_mesh
from warpmis.kernels.light.records import Receiver
from warpmis.kernels.light.table import SHADOW_END
from warpmis.kernels.mis import balance_weight
from warpmis.kernels.shading_frame import Frame, luminance, to_local
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})


def make_direct_light(
    features: Features, surface: SimpleNamespace, lights: SimpleNamespace, intersect: SimpleNamespace
) -> SimpleNamespace:
    """Functions for one set of effects: from_delta_light, from_light_sample, from_mesh_light."""

    @wp.struct
    class DirectLight:
        """Light that a vertex sends on from a light sample, and the rays that it took.

        share: the BSDF's density of its direction, over that of BSDF and lights together.
        """

        radiance: wp.vec3
        rays: int
        share: float

    @wp.func
    def from_delta_light(scene: SceneView, r: Receiver, frame: Frame, ng: wp.vec3, s: Surface, u: float) -> DirectLight:
        """One of the delta lights, chosen by what it would bring unoccluded."""
        total = float(0.0)
        chosen = int(-1)
        wi_chosen = wp.vec3(0.0, 0.0, 0.0)
        distance_chosen = float(0.0)
        importance = float(0.0)
        irradiance = wp.vec3(0.0, 0.0, 0.0)
        left = u
        for i in range(scene.delta_light_count):
            light = scene.delta_lights[i]
            wi = light.vector
            distance = float(INFINITE_DISTANCE)
            falloff = float(1.0)
            if light.kind != DELTA_DISTANT:
                to_light = light.vector - r.x
                distance = wp.length(to_light)
                wi = to_light / wp.max(distance, 1.0e-20)
                falloff = 1.0 / wp.max(distance * distance, 1.0e-20)
            brings = light.luminance * falloff * wp.max(wp.dot(frame.n, wi), 0.0)
            if wp.static(features.controlled):
                factor = lights.control.factor(scene, scene.light_count + i, r, wi)
                brings = luminance(wp.cw_mul(light.intensity, factor)) * falloff * wp.max(wp.dot(frame.n, wi), 0.0)
            if brings > 0.0:
                # Reservoir of one: the chosen light is kept or replaced, and `left` is uniform again after either.
                total += brings
                p = brings / total
                if left < p or chosen < 0:
                    left = left / p
                    chosen = i
                    wi_chosen = wi
                    distance_chosen = distance
                    importance = brings
                    irradiance = light.intensity * falloff
                    if wp.static(features.controlled):
                        irradiance = wp.cw_mul(irradiance, factor)
                else:
                    left = (left - p) / (1.0 - p)
        direct = DirectLight()
        if chosen < 0 or wp.dot(wi_chosen, ng) <= 0.0:
            return direct
        scattering = surface.evaluate(s, to_local(frame, wi_chosen))
        f_cos = scattering.f_cos
        if wp.static(features.light_response):
            f_cos = wp.cw_mul(f_cos, lights.control.response(scene, scene.light_count + chosen, scattering.diffuse))
        through = intersect.transmittance(
            scene, scene.light_count + chosen, r.x, wi_chosen, distance_chosen * SHADOW_END
        )
        direct.radiance = wp.cw_mul(wp.cw_mul(f_cos, irradiance), through) * (total / importance)
        direct.rays = 1
        return direct

    @wp.func
    def from_light_sample(
        scene: SceneView, r: Receiver, frame: Frame, ng: wp.vec3, s: Surface, u: wp.vec4
    ) -> DirectLight:
        """Next-event estimation: one light sample, weighted against the BSDF's density."""
        direct = DirectLight()
        towards = lights.sample(scene, r, u)
        if towards.pdf_solid_angle <= 0.0 or wp.dot(towards.wi, ng) <= 0.0:
            return direct
        scattering = surface.evaluate(s, to_local(frame, towards.wi))
        if luminance(scattering.f_cos) <= 0.0:
            return direct
        direct.share = balance_weight(scattering.pdf_solid_angle, towards.pdf_solid_angle)
        if wp.static(features.controlled):
            towards.radiance = wp.cw_mul(towards.radiance, lights.control.factor(scene, r.chosen, r, towards.wi))
            if wp.static(features.light_response):
                response = lights.control.response(scene, r.chosen, scattering.diffuse)
                towards.radiance = wp.cw_mul(towards.radiance, response)
        through = intersect.transmittance(scene, r.chosen, r.x, towards.wi, towards.distance * SHADOW_END)
        weight = balance_weight(towards.pdf_solid_angle, scattering.pdf_solid_angle) / towards.pdf_solid_angle
        direct.radiance = wp.cw_mul(wp.cw_mul(scattering.f_cos, towards.radiance), through) * weight
        direct.rays = 1
        return direct

    @wp.func
    def from_mesh_light(
        scene: SceneView, r: Receiver, hit: Hit, material: MaterialView, wi: wp.vec3, distance: float, pdf_bsdf: float
    ) -> wp.vec3:
        """What arrives at r of the light of the surface that was hit, against wi, which the BSDF drew with this density
        and weighs against the lights'; a density of 0: nothing else could have found it."""
        index = scene.triangles[hit.triangle].light
        if index < 0 or (hit.outside == 0 and material.double_sided == 0):
            return wp.vec3(0.0, 0.0, 0.0)
        emission = material.emission
        if wp.static(features.controlled):
            factor = lights.control.factor(scene, index, r, wi)
            if wp.static(features.light_response):
                if r.prim > 0:
                    factor = wp.cw_mul(factor, lights.control.response(scene, index, r.diffuse))
            emission = wp.cw_mul(emission, factor)
        if pdf_bsdf <= 0.0:
            return emission
        light = scene.lights[index]
        of_light = pdf_mesh(light, hit.ng, wi, distance) * lights.importance(scene, light, r)
        return emission * balance_weight(pdf_bsdf, lights.density(of_light, r.total))

    return SimpleNamespace(
        from_delta_light=from_delta_light,
        from_light_sample=from_light_sample,
        from_mesh_light=from_mesh_light,
    )
