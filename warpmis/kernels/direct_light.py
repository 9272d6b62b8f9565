"""Direct light at a vertex: by a light sample, or from a delta light."""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import SceneView
from warpmis.kernels.light.delta_light import make_delta_light
from warpmis.kernels.light.on_ray import SHADOW_END
from warpmis.kernels.light.records import NO_LIGHT, Receiver
from warpmis.kernels.mis import balance_weight
from warpmis.kernels.path.state import Vertex
from warpmis.kernels.shading_frame import luminance, to_local
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})


@wp.struct
class DirectLight:
    """Light that a vertex scatters from a light sample, and the shadow rays that it took.

    bsdf_share: the BSDF's density of its direction, over those of the BSDF and the lights together.
    """

    radiance: wp.vec3
    rays: int
    bsdf_share: float


def make_direct_light(
    features: Features, surface: SimpleNamespace, lights: SimpleNamespace, intersect: SimpleNamespace
) -> SimpleNamespace:
    """Functions for one set of effects: from_delta_light, from_light_sample."""
    sample_delta_light = make_delta_light(features, lights.control)

    @wp.func
    def from_delta_light(scene: SceneView, r: wp.ref[Receiver], vertex: wp.ref[Vertex]) -> DirectLight:
        """One of the delta lights, which no other strategy can find: with no weight."""
        direct = DirectLight()
        s = sample_delta_light(scene, r, vertex.u_delta)
        if s.index == NO_LIGHT or wp.dot(s.wi, vertex.ng) <= 0.0:
            return direct
        scattering = surface.evaluate(vertex.surface, to_local(vertex.frame, s.wi))
        f_cos = scattering.f_cos
        index = scene.light_count + s.index
        if wp.static(features.light_response):
            f_cos = wp.cw_mul(f_cos, lights.control.response(scene, index, scattering.diffuse))
        through = intersect.transmittance(scene, index, r.x, s.wi, s.distance * SHADOW_END)
        direct.radiance = wp.cw_mul(wp.cw_mul(f_cos, s.irradiance), through) * s.inverse_pmf
        direct.rays = 1
        return direct

    @wp.func
    def from_light_sample(scene: SceneView, r: wp.ref[Receiver], vertex: wp.ref[Vertex]) -> DirectLight:
        """Next-event estimation: one light sample, weighted against the BSDF's density."""
        direct = DirectLight()
        towards = lights.sample(scene, r, vertex.u_light)
        if towards.pdf_solid_angle <= 0.0 or wp.dot(towards.wi, vertex.ng) <= 0.0:
            return direct
        scattering = surface.evaluate(vertex.surface, to_local(vertex.frame, towards.wi))
        if luminance(scattering.f_cos) <= 0.0:
            return direct
        direct.bsdf_share = balance_weight(scattering.pdf_solid_angle, towards.pdf_solid_angle)
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

    return SimpleNamespace(from_delta_light=from_delta_light, from_light_sample=from_light_sample)
