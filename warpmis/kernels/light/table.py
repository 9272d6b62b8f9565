"""The lights of a scene as one sampler of directions, specialised to the kinds that the scene holds."""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import CYLINDER, DISK, DISTANT, DOME, MESH, RECT, SPHERE, LightView, SceneView
from warpmis.features import Features
from warpmis.kernels.light.choice import light_importance
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
from warpmis.kernels.light.mesh import hit_emitter_triangle, make_mesh
from warpmis.kernels.light.records import LightHit, LightSample
from warpmis.kernels.light.rect import hit_rect, sample_rect
from warpmis.kernels.light.sphere import hit_sphere, sample_sphere
from warpmis.kernels.mis import balance_weight

wp.set_module_options({"enable_backward": False})

# A shadow ray stops this share of the way short of its light, so that a surface behind the light is no occluder.
SHADOW_END = wp.constant(0.9999)


@wp.struct
class Receiver:
    """The point that asks for light, with what normalises the choice among the lights seen from it.

    total is the sum of all lights' importances; 0 where no light can be seen. A single light needs no choice.
    """

    x: wp.vec3
    n: wp.vec3
    total: float


@wp.struct
class RayLight:
    """The light that a ray meets, mesh lights left out (they are surfaces).

    radiance: sum over the analytic lights and the dome seen along the ray; weighted: the same with each light's MIS
    weight against the density given; pdf_solid_angle: density of the light strategy for the ray's direction, counting
    also lights hidden behind the surface that the ray hits; hits: number of analytic lights seen.
    """

    radiance: wp.vec3
    weighted: wp.vec3
    pdf_solid_angle: float
    hits: int


def make_lights(features: Features) -> SimpleNamespace:
    """Light functions for the kinds in `features`: receiver, sample, hit, gather."""
    mesh = make_mesh(features)

    @wp.func
    def receiver(scene: SceneView, x: wp.vec3, n: wp.vec3) -> Receiver:
        r = Receiver()
        r.x = x
        r.n = n
        if scene.light_count == 1:
            r.total = 1.0
            return r
        for i in range(scene.light_count):
            r.total += light_importance(scene.lights[i], x, n)
        return r

    @wp.func
    def choice_probability(scene: SceneView, light: LightView, r: Receiver) -> float:
        if scene.light_count == 1:
            return 1.0
        if r.total <= 0.0:
            return 0.0
        return light_importance(light, r.x, r.n) / r.total

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
    def sample(scene: SceneView, r: Receiver, u: wp.vec4) -> LightSample:
        """Choose a light by importance with u[0], then a direction towards it; the density holds both choices."""
        if scene.light_count == 1:
            return sample_light(scene, scene.lights[0], r, u)
        target = u[0] * r.total
        chosen = int(-1)
        importance = float(0.0)
        reached = float(0.0)
        for i in range(scene.light_count):
            of_light = light_importance(scene.lights[i], r.x, r.n)
            # The last light with any importance stays chosen if rounding lets the sum fall short of the target.
            if of_light > 0.0:
                chosen = i
                importance = of_light
                reached += of_light
                if reached > target:
                    break
        s = LightSample()
        if chosen >= 0:
            s = sample_light(scene, scene.lights[chosen], r, u)
            s.pdf_solid_angle = s.pdf_solid_angle * importance / r.total
        return s

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
        """Density of the mesh lights' samplers for wi: every emissive triangle on the line counts, hidden or not."""
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
                pdf += h.pdf_solid_angle * choice_probability(scene, light, r)
        return pdf

    @wp.func
    def gather(scene: SceneView, r: Receiver, wi: wp.vec3, near: float, far: float, pdf: float) -> RayLight:
        """Analytic lights on the stretch (near, far] of the ray from r.x; INFINITE_DISTANCE: no surface ends it.

        `pdf` is the density of the strategy that drew wi, which the light strategy is weighted against.
        """
        ray = RayLight()
        for i in range(scene.light_count):
            light = scene.lights[i]
            h = hit(light, r.x, wi)
            radiance = light.radiance
            if wp.static(features.dome_picture):
                if light.kind == DOME and scene.dome.rows > 0:
                    uv = dome_uv(scene.dome.to_dome * wi)
                    h.distance = INFINITE_DISTANCE
                    h.pdf_solid_angle = dome_pdf(scene.dome, uv)
                    if far >= INFINITE_DISTANCE:
                        radiance = dome_radiance(scene.dome, uv)
            if wp.static(features.dome_constant):
                if light.kind == DOME and scene.dome.rows == 0:
                    h.distance = INFINITE_DISTANCE
                    h.pdf_solid_angle = pdf_dome_constant(r.n, wi)
            if h.distance > 0.0:
                of_light = h.pdf_solid_angle * choice_probability(scene, light, r)
                ray.pdf_solid_angle += of_light
                # A light flush with a surface shines: hence the tolerance, the same as the shadow ray's.
                if h.distance * SHADOW_END <= far and h.distance * SHADOW_END > near:
                    ray.radiance += radiance
                    ray.weighted += radiance * balance_weight(pdf, of_light)
                    if h.distance < INFINITE_DISTANCE:
                        ray.hits += 1
        return ray

    return SimpleNamespace(
        receiver=receiver,
        choice_probability=choice_probability,
        sample=sample,
        sample_light=sample_light,
        hit=hit,
        gather=gather,
        pdf_emitter_triangles=pdf_emitter_triangles,
    )
