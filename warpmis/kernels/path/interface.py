"""The path's way through a dielectric interface, and the light samples that a rough one takes.

The strategies of learning and the spatial cache take no part here. Light is found by the interface's own sampling and
by light samples on either side, which share it by the balance heuristic. A light sample looks to the one or the other
side with probability 1/2, so all that is evaluated for it counts twice, its density against the light's too.
"""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import MaterialView, SceneView
from warpmis.kernels import rng
from warpmis.kernels.bsdf.dielectric import evaluate_interface, is_rough_interface, sample_interface
from warpmis.kernels.bsdf.surface import Scattering
from warpmis.kernels.direct_light import make_direct_light
from warpmis.kernels.hit import Hit
from warpmis.kernels.light.records import Receiver, Response
from warpmis.kernels.shading_frame import Frame, to_local
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})

SIDES = wp.constant(2.0)


@wp.struct
class OneSide:
    """A rough interface for a fixed wo (local, wo[2] > 0), as a light sample sees it that looks beyond it or not."""

    material: MaterialView
    wo: wp.vec3
    is_front: bool
    is_beyond: bool


@wp.struct
class InterfaceVertex:
    """As Vertex, of one side: ng points there."""

    ng: wp.vec3
    frame: Frame
    surface: OneSide
    u_light: wp.vec4
    u_delta: float


@wp.func
def evaluate_side(s: OneSide, wi: wp.vec3) -> Scattering:
    scattering = Scattering()
    if (wi[2] < 0.0) == s.is_beyond:
        of_interface = evaluate_interface(s.material, s.wo, wi, s.is_front)
        scattering.f_cos = SIDES * of_interface.f_cos
        scattering.pdf_solid_angle = SIDES * of_interface.pdf
    return scattering


def make_interface(
    features: Features,
    PathState: type,
    lights: SimpleNamespace,
    intersect: SimpleNamespace,
    specular: SimpleNamespace,
    contributions: SimpleNamespace,
    sampler: SimpleNamespace,
) -> SimpleNamespace:
    """The function cross."""
    side = SimpleNamespace(evaluate=evaluate_side)
    direct_light = make_direct_light(features, side, lights, intersect, InterfaceVertex)

    @wp.func
    def receiver_on(
        scene: SceneView, path: wp.ref[PathState], hit: wp.ref[Hit], vertex: wp.ref[InterfaceVertex]
    ) -> Receiver:
        """The interface as lights on the vertex' side know it."""
        n = wp.where(vertex.surface.is_beyond, -vertex.frame.n, vertex.frame.n)
        prim = int(0)
        if wp.static(features.controlled):
            prim = lights.control.prim_of(scene, hit)
        x, u = hit.p + vertex.ng * hit.offset, vertex.u_light
        receiver = lights.receiver(scene, x, n, prim, u[0], u[1], Response())
        if wp.static(features.absorption):
            receiver.absorption = medium_on(path, hit, vertex.surface.material, vertex.surface.is_beyond)
        return receiver

    @wp.func
    def medium_on(path: wp.ref[PathState], hit: wp.ref[Hit], material: MaterialView, is_beyond: bool) -> wp.vec3:
        """Absorption on the near or the far side."""
        if not is_beyond or material.thin_walled:
            return path.receiver.absorption
        return wp.where(hit.is_front, material.absorption, wp.vec3(0.0, 0.0, 0.0))

    @wp.func
    def look(vertex: wp.ref[InterfaceVertex], hit: wp.ref[Hit], is_beyond: bool):
        """Turn the vertex to one side."""
        vertex.surface.is_beyond = is_beyond
        vertex.ng = wp.where(is_beyond, -hit.ng, hit.ng)

    @wp.func
    def add_light_samples(scene: SceneView, path: wp.ref[PathState], hit: wp.ref[Hit], vertex: wp.ref[InterfaceVertex]):
        """Of the lights, and of the delta lights, on the vertex' side."""
        receiver = receiver_on(scene, path, hit, vertex)
        contributions.scatter(path, wp.vec3(0.0, 0.0, 0.0), vertex.surface.is_beyond)
        from_light = direct_light.from_light_sample(scene, receiver, vertex)
        radiance = wp.cw_mul(path.beta, from_light.radiance)
        path.L += radiance
        path.shadow_rays += from_light.rays
        contributions.light_sample(scene, path, radiance, from_light.diffuse, from_light.light)
        if wp.static(features.delta_light):
            from_delta = direct_light.from_delta_light(scene, receiver, vertex)
            radiance = wp.cw_mul(path.beta, from_delta.radiance)
            path.L += radiance
            path.shadow_rays += from_delta.rays
            contributions.light_sample(scene, path, radiance, from_delta.diffuse, from_delta.light)

    @wp.func
    def cross(
        scene: SceneView,
        path: wp.ref[PathState],
        hit: wp.ref[Hit],
        material: MaterialView,
        frame: Frame,
        wo: wp.vec3,
        u_choice: float,
        key: rng.RngKey,
        step: int,
    ) -> bool:
        """Reflect or refract the path; False where it ends there."""
        vertex = InterfaceVertex()
        is_rough = bool(False)
        if wp.static(features.rough_transmission):
            is_rough = is_rough_interface(material)
            if is_rough:
                vertex.frame = frame
                vertex.surface.material = material
                vertex.surface.wo = wo
                vertex.surface.is_front = hit.is_front
                vertex.u_light = sampler.independent_of_step(key, step, rng.LIGHT)
                u = sampler.independent_of_step(key, step, rng.DELTA_LIGHT)
                vertex.u_delta = u[0]
                look(vertex, hit, u[2] < 0.5)
                add_light_samples(scene, path, hit, vertex)
        s = sample_interface(material, wo, hit.is_front, u_choice, sampler.independent_of_step(key, step, rng.SCATTER))
        path.beta = wp.cw_mul(path.beta, s.weight)
        absorption = path.receiver.absorption
        if s.is_refracted:
            path.origin = hit.p - hit.ng * hit.offset
            if wp.static(features.absorption):
                absorption = medium_on(path, hit, material, True)
        if is_rough:
            look(vertex, hit, s.is_refracted)
        specular.leave(scene, path, hit, frame, s.wi)
        if wp.static(features.rough_transmission):
            if is_rough:
                # Lights that the ray meets have been looked for on this side.
                path.receiver = receiver_on(scene, path, hit, vertex)
                path.weighs_emission = True
                path.pdf = evaluate_side(vertex.surface, to_local(frame, path.wi)).pdf_solid_angle
        if wp.static(features.absorption):
            path.receiver.absorption = absorption
        contributions.scatter(path, wp.vec3(0.0, 0.0, 0.0), s.is_refracted)
        cosine = wp.dot(path.wi, hit.ng)
        return wp.length_sq(s.wi) > 0.0 and wp.where(s.is_refracted, cosine < 0.0, cosine > 0.0)

    return SimpleNamespace(cross=cross)
