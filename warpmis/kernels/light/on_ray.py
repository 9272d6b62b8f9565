"""The lights that a ray meets: their radiance, and the densities with which light samples would have found them."""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import DOME, MESH, SceneView
from warpmis.kernels.intersect import make_intersect
from warpmis.kernels.light.choice import density, importance
from warpmis.kernels.light.distant import INFINITE_DISTANCE
from warpmis.kernels.light.dome import dome_pdf, dome_radiance, dome_uv, pdf_dome_constant
from warpmis.kernels.light.mesh_light import hit_emitter_triangle
from warpmis.kernels.light.records import Receiver
from warpmis.kernels.mis import balance_weight
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})

# A shadow ray stops this share of the way short of its light, so that a surface behind the light is no occluder.
SHADOW_END = wp.constant(0.9999)


@wp.struct
class LightsOnRay:
    """The lights that a ray meets, but for mesh lights, which are surfaces.

    radiance: sum over the analytic lights and the dome seen along the ray; weighted: the same with each light's MIS
    weight against the density given; hits: number of analytic lights seen. finite, infinite: sums of density times
    importance for the ray's direction, over the lights at a distance and at infinity, counting also those hidden
    behind the surface that the ray hits.
    """

    radiance: wp.vec3
    weighted: wp.vec3
    finite: float
    infinite: float
    hits: int


@wp.func
def pdf_emitter_triangles(scene: SceneView, r: Receiver, wi: wp.vec3) -> float:
    """Density times importance of the mesh lights for wi: every triangle on the line counts, hidden or not."""
    pdf = float(0.0)
    if scene.emitter_bvh == wp.uint64(0):
        return pdf
    query = wp.bvh_query_ray(scene.emitter_bvh, r.x, wi)
    slot = int(0)
    while wp.bvh_query_next(query, slot):
        triangle = scene.emitter_triangles[slot]
        light = scene.lights[scene.triangles[triangle].light]
        h = hit_emitter_triangle(scene, light, triangle, r.x, wi)
        if h.distance > 0.0:
            pdf += h.pdf_solid_angle * importance(scene, light, r)
    return pdf


def make_on_ray(features: Features, kinds: SimpleNamespace, control: SimpleNamespace) -> wp.Function:
    """The function gather."""
    intersect = make_intersect(features)

    @wp.func
    def gather(scene: SceneView, r: Receiver, wi: wp.vec3, near: float, far: float, pdf: float) -> LightsOnRay:
        """Analytic lights on the stretch (near, far] of the ray from r.x; INFINITE_DISTANCE: no surface ends it.

        `pdf` is the density of the strategy that drew wi, which the light strategy is weighted against.
        """
        ray = LightsOnRay()
        for i in range(scene.light_count):
            light = scene.lights[i]
            h = kinds.hit(light, r.x, wi)
            if r.drawn_pdf > 0.0 and r.drawn == i and light.kind != MESH:
                h.distance = r.drawn_distance
                h.pdf_solid_angle = r.drawn_pdf
            radiance = light.radiance
            if wp.static(features.dome_picture):
                if light.kind == DOME and scene.dome.rows > 0:
                    uv = dome_uv(scene.dome.to_dome * wi)
                    h.distance = INFINITE_DISTANCE
                    h.pdf_solid_angle = dome_pdf(scene.dome, uv)
                    if far >= INFINITE_DISTANCE:
                        radiance = dome_radiance(scene.dome, uv)
                    if wp.static(features.shadow_links):
                        radiance = dome_radiance(scene.dome, uv)
            if wp.static(features.dome_constant):
                if light.kind == DOME and scene.dome.rows == 0:
                    h.distance = INFINITE_DISTANCE
                    h.pdf_solid_angle = pdf_dome_constant(r.n, wi)
            if h.distance > 0.0:
                of_light = h.pdf_solid_angle * importance(scene, light, r)
                if i < scene.finite_light_count:
                    ray.finite += of_light
                else:
                    ray.infinite += of_light
                if wp.static(features.shadow_links):
                    if r.is_surface and intersect.has_shadow_link(scene, i):  # the camera does not see through
                        # What ends the ray tells nothing of this light's shadows: found on the first stretch, or never.
                        through = intersect.transmittance(scene, i, r.x, wi, h.distance * SHADOW_END)
                        radiance = wp.cw_mul(radiance, through)
                        h.distance = wp.where(near == 0.0, 0.5 * far, 0.0)
                # A light flush with a surface shines: hence the tolerance, the same as the shadow ray's.
                if h.distance * SHADOW_END <= far and h.distance * SHADOW_END > near:
                    if wp.static(features.controlled):
                        radiance = wp.cw_mul(radiance, control.factor(scene, i, r, wi))
                        if wp.static(features.light_response):
                            if r.is_surface:
                                radiance = wp.cw_mul(radiance, control.response(scene, i, r.diffuse))
                    ray.radiance += radiance
                    ray.weighted += radiance * balance_weight(pdf, density(of_light, r.total))
                    if h.distance < INFINITE_DISTANCE:
                        ray.hits += 1
        return ray

    return gather
