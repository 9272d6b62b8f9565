"""The lights of a scene as one sampler of directions, specialised to the kinds that the scene holds."""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import CYLINDER, DISK, DISTANT, DOME, MESH, RECT, SPHERE, LightView, SceneView
from warpmis.kernels.intersect import make_intersect
from warpmis.kernels.light.choice import light_importance
from warpmis.kernels.light.control import make_control
from warpmis.kernels.light.cylinder import hit_cylinder, sample_cylinder
from warpmis.kernels.light.disk import hit_disk, sample_disk
from warpmis.kernels.light.distant import INFINITE_DISTANCE, hit_distant, sample_distant
from warpmis.kernels.light.dome import (
    dome_pdf,
    dome_radiance,
    dome_uv,
    pdf_dome_constant,
    sample_dome_constant,
    sample_dome_picture,
)
from warpmis.kernels.light.mesh_light import hit_emitter_triangle, make_mesh
from warpmis.kernels.light.records import NO_LIGHT, LightChoice, LightHit, LightSample, Receiver
from warpmis.kernels.light.rect import hit_rect, sample_rect
from warpmis.kernels.light.sphere import hit_sphere, sample_sphere
from warpmis.kernels.mis import balance_weight
from warpmis.kernels.rng import ONE_MINUS_EPSILON
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


def make_lights(features: Features) -> SimpleNamespace:
    """Light functions for the kinds in `features`: receiver, importance, sample, sample_range, hit, gather."""
    mesh = make_mesh(features)
    control = make_control(features)
    intersect = make_intersect(features)

    @wp.func
    def density(of_light: float, total: float) -> float:
        """Density among lights whose importances sum to `total`, from density times importance."""
        if total <= 0.0:
            return 0.0
        return of_light / total

    @wp.func
    def importance(scene: SceneView, light: LightView, r: Receiver) -> float:
        if scene.light_count == 1:
            return 1.0
        return light_importance(light, r.x, r.n)

    @wp.func
    def is_turned_away(scene: SceneView, r: Receiver) -> bool:
        """Whether there is a single light, which needs no choice, and it cannot reach r."""
        if scene.light_count != 1:
            return False
        return light_importance(scene.lights[0], r.x, r.n) <= 0.0

    @wp.func
    def choose(scene: SceneView, r: Receiver, first: int, end: int, total: float, u: float) -> LightChoice:
        """One of the lights first to end - 1, whose importances sum to `total`, in proportion to them."""
        c = LightChoice()
        c.light = NO_LIGHT
        target = u * total
        reached = float(0.0)
        for i in range(first, end):
            of_light = importance(scene, scene.lights[i], r)
            # The last light with any importance stays chosen if rounding lets the sum fall short of the target.
            if of_light > 0.0:
                c.light = i
                c.importance = of_light
                c.u_remapped = wp.clamp((target - reached) / of_light, 0.0, ONE_MINUS_EPSILON)
                reached += of_light
                if reached > target:
                    break
        return c

    @wp.func
    def receiver(scene: SceneView, x: wp.vec3, n: wp.vec3, u: float) -> Receiver:
        """Choose a light with u. Each light's part of the numbers is one interval, so that the remapped u is as evenly
        spread over the light's samples as u is over all."""
        r = Receiver()
        r.x = x
        r.n = n
        r.chosen = NO_LIGHT
        if is_turned_away(scene, r):
            return r
        for i in range(scene.light_count):
            of_light = importance(scene, scene.lights[i], r)
            if i < scene.finite_light_count:
                r.finite += of_light
            else:
                r.infinite += of_light
        r.total = r.finite + r.infinite
        choice = choose(scene, r, 0, scene.light_count, r.total, u)
        r.chosen = choice.light
        r.chosen_importance = choice.importance
        r.u_remapped = choice.u_remapped
        return r

    @wp.func
    def sample_light(scene: SceneView, light: LightView, r: Receiver, u: wp.vec4) -> LightSample:
        """A direction towards one light. Density: given that the light was chosen."""
        s = LightSample()
        if wp.static(features.rect_light):
            if light.kind == RECT:
                s = sample_rect(light, r.x, u[1], u[2])
        if wp.static(features.disk_light):
            if light.kind == DISK:
                s = sample_disk(light, r.x, u[1], u[2])
        if wp.static(features.sphere_light):
            if light.kind == SPHERE:
                s = sample_sphere(light, r.x, u[1], u[2])
        if wp.static(features.cylinder_light):
            if light.kind == CYLINDER:
                s = sample_cylinder(light, r.x, u[1], u[2])
        if wp.static(features.distant_light):
            if light.kind == DISTANT:
                s = sample_distant(light, u[1], u[2])
        if wp.static(features.dome_picture):
            if light.kind == DOME and scene.dome.rows > 0:
                s = sample_dome_picture(scene.dome, u[1], u[2])
        if wp.static(features.dome_constant):
            if light.kind == DOME and scene.dome.rows == 0:
                s = sample_dome_constant(scene.dome, r.n, u[1], u[2])
        if wp.static(features.mesh_light):
            if light.kind == MESH:
                s = mesh.sample(scene, light, r.x, u[3], u[1], u[2])
        return s

    @wp.func
    def sample_chosen(scene: SceneView, r: Receiver, chosen: int, chance: float, u: wp.vec4) -> LightSample:
        """A direction towards the light that was chosen with this chance, which the density holds; none of NO_LIGHT."""
        s = LightSample()
        if chosen != NO_LIGHT:
            s = sample_light(scene, scene.lights[chosen], r, u)
            s.light = chosen
            s.pdf_of_light = s.pdf_solid_angle
            s.pdf_solid_angle = s.pdf_of_light * chance
        return s

    @wp.func
    def sample(scene: SceneView, r: Receiver, u: wp.vec4) -> LightSample:
        """A direction towards the receiver's light. u[0] made that choice."""
        return sample_chosen(scene, r, r.chosen, r.chosen_importance / r.total, u)

    @wp.func
    def sample_range(scene: SceneView, r: Receiver, first: int, end: int, total: float, u: wp.vec4) -> LightSample:
        """The same among the lights first to end - 1, whose importances sum to `total`; u[0] chooses one, and
        remapped stands in for u[1]."""
        choice = choose(scene, r, first, end, total, u[0])
        v = wp.vec4(u[0], choice.u_remapped, u[2], u[3])
        return sample_chosen(scene, r, choice.light, choice.importance / total, v)

    @wp.func
    def hit(light: LightView, x: wp.vec3, wi: wp.vec3) -> LightHit:
        """Where the line from x along wi meets an analytic light, and that light's own density for wi."""
        h = LightHit()
        h.distance = -1.0
        if wp.static(features.rect_light):
            if light.kind == RECT:
                h = hit_rect(light, x, wi)
        if wp.static(features.disk_light):
            if light.kind == DISK:
                h = hit_disk(light, x, wi)
        if wp.static(features.sphere_light):
            if light.kind == SPHERE:
                h = hit_sphere(light, x, wi)
        if wp.static(features.cylinder_light):
            if light.kind == CYLINDER:
                h = hit_cylinder(light, x, wi)
        if wp.static(features.distant_light):
            if light.kind == DISTANT:
                h = hit_distant(light, wi)
        return h

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

    @wp.func
    def gather(scene: SceneView, r: Receiver, wi: wp.vec3, near: float, far: float, pdf: float) -> LightsOnRay:
        """Analytic lights on the stretch (near, far] of the ray from r.x; INFINITE_DISTANCE: no surface ends it.

        `pdf` is the density of the strategy that drew wi, which the light strategy is weighted against.
        """
        ray = LightsOnRay()
        for i in range(scene.light_count):
            light = scene.lights[i]
            h = hit(light, r.x, wi)
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
                    if r.is_surface and intersect.has_own_shadows(scene, i):  # the camera does not see through
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

    return SimpleNamespace(
        receiver=receiver,
        importance=importance,
        density=density,
        sample=sample,
        sample_range=sample_range,
        sample_light=sample_light,
        hit=hit,
        gather=gather,
        pdf_emitter_triangles=pdf_emitter_triangles,
        control=control,
    )
