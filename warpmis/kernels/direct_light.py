"""Direct light: by a light sample, by a delta light, or by a ray that meets a mesh light."""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import MaterialView, SceneView
from warpmis.kernels.hit import Hit
from warpmis.kernels.light.delta_light import make_delta_light
from warpmis.kernels.light.mesh_light import pdf_mesh
from warpmis.kernels.light.records import NO_LIGHT, Receiver
from warpmis.kernels.light.table import SHADOW_END
from warpmis.kernels.mis import balance_weight
from warpmis.kernels.path.state import Vertex
from warpmis.kernels.shading_frame import luminance, to_local
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})

# In place of the density of a ray that the camera or a mirror has sent: its emission has the weight 1.
UNWEIGHTED = wp.constant(0.0)


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
    """Functions for one set of effects: from_delta_light, from_light_sample, from_mesh_light."""
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

    @wp.func
    def from_mesh_light(
        scene: SceneView,
        r: wp.ref[Receiver],
        hit: wp.ref[Hit],
        material: MaterialView,
        wi: wp.vec3,
        distance: float,
        pdf_bsdf: float,
    ) -> wp.vec3:
        """The emission of the surface that the ray from r along wi has hit, weighted for a ray that the BSDF drew with
        this density. UNWEIGHTED in its place: no light sample could have found it."""
        index = scene.triangles[hit.triangle].light
        if index == NO_LIGHT or (hit.outside == 0 and material.double_sided == 0):
            return wp.vec3(0.0, 0.0, 0.0)
        emission = material.emission
        if wp.static(features.controlled):
            factor = lights.control.factor(scene, index, r, wi)
            if wp.static(features.light_response):
                if r.is_surface:
                    factor = wp.cw_mul(factor, lights.control.response(scene, index, r.diffuse))
            emission = wp.cw_mul(emission, factor)
        if pdf_bsdf <= UNWEIGHTED:
            return emission
        light = scene.lights[index]
        of_light = pdf_mesh(light, hit.ng, wi, distance) * lights.importance(scene, light, r)
        return emission * balance_weight(pdf_bsdf, lights.density(of_light, r.total))

    return SimpleNamespace(
        from_delta_light=from_delta_light,
        from_light_sample=from_light_sample,
        from_mesh_light=from_mesh_light,
    )
