"""Direct light at a vertex: by a light sample, or from a delta light."""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import SceneView
from warpmis.kernels.light.delta_light import make_delta_light
from warpmis.kernels.light.on_ray import SHADOW_END
from warpmis.kernels.light.records import NO_LIGHT, Receiver
from warpmis.kernels.medium import transmittance
from warpmis.kernels.path.state import Vertex
from warpmis.kernels.shading_frame import luminance, to_local
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})


@wp.struct
class DirectLight:
    """Light that a vertex scatters from a delta light, and the shadow rays that it took.

    light: row among all lights, then the delta lights; diffuse: the diffuse lobe's share of the radiance, per colour.
    """

    radiance: wp.vec3
    rays: int
    light: int
    diffuse: wp.vec3


@wp.struct
class ScatteredLight:
    """Light towards which a vertex has drawn, unoccluded.

    radiance: f cos L; pdf: the density with which the lights' sampler draws wi [1/sr]; pdf_bsdf: the BSDF's.
    diffuse: the diffuse lobe's share of the radiance, per colour.
    """

    wi: wp.vec3
    distance: float
    pdf: float
    pdf_bsdf: float
    radiance: wp.vec3
    diffuse: wp.vec3


def make_direct_light(
    features: Features,
    surface: SimpleNamespace,
    lights: SimpleNamespace,
    intersect: SimpleNamespace,
) -> SimpleNamespace:
    """Functions for one set of effects: from_delta_light, light_sample, shadowed."""
    sample_delta_light = make_delta_light(features, lights.control, lights.tree)

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
        if wp.static(features.absorption):
            direct.radiance = wp.cw_mul(direct.radiance, transmittance(r.absorption, s.distance))
        direct.rays = 1
        direct.light = index
        if wp.static(features.keeps_light_apart):
            direct.diffuse = lights.control.diffuse_share(scene, index, scattering.diffuse)
        return direct

    @wp.func
    def light_sample(scene: SceneView, r: wp.ref[Receiver], vertex: wp.ref[Vertex]) -> ScatteredLight:
        """A light sample before it is known whether anything stands in its way; pdf 0 where there is none."""
        scattered = ScatteredLight()
        towards = lights.sample(scene, r, vertex.u_light)
        if towards.pdf_solid_angle <= 0.0 or wp.dot(towards.wi, vertex.ng) <= 0.0:
            return scattered
        scattering = surface.evaluate(vertex.surface, to_local(vertex.frame, towards.wi))
        if luminance(scattering.f_cos) <= 0.0:
            return scattered
        if wp.static(features.controlled):
            towards.radiance = wp.cw_mul(towards.radiance, lights.control.factor(scene, r.choice.light, r, towards.wi))
            if wp.static(features.light_response):
                response = lights.control.response(scene, r.choice.light, scattering.diffuse)
                towards.radiance = wp.cw_mul(towards.radiance, response)
        scattered.wi = towards.wi
        scattered.distance = towards.distance
        scattered.pdf = towards.pdf_solid_angle
        scattered.pdf_bsdf = scattering.pdf_solid_angle
        scattered.radiance = wp.cw_mul(scattering.f_cos, towards.radiance)
        if wp.static(features.absorption):
            scattered.radiance = wp.cw_mul(scattered.radiance, transmittance(r.absorption, towards.distance))
        if wp.static(features.keeps_light_apart):
            scattered.diffuse = lights.control.diffuse_share(scene, r.choice.light, scattering.diffuse)
        return scattered

    @wp.func
    def shadowed(scene: SceneView, r: wp.ref[Receiver], light: wp.ref[ScatteredLight]) -> wp.vec3:
        """f cos L of a light sample by its shadow ray."""
        through = intersect.transmittance(scene, r.choice.light, r.x, light.wi, light.distance * SHADOW_END)
        return wp.cw_mul(light.radiance, through)

    return SimpleNamespace(
        from_delta_light=from_delta_light,
        light_sample=light_sample,
        shadowed=shadowed,
    )
