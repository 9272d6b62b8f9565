"""A vertex made ready: its BSDF, its lights, and the random numbers that it draws by."""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import MaterialView, SceneView
from warpmis.kernels import rng
from warpmis.kernels.bsdf.rough_interface import InterfaceSide
from warpmis.kernels.bsdf.surface import Surface
from warpmis.kernels.hit import Hit
from warpmis.kernels.light.records import Response
from warpmis.kernels.path.state import Vertex
from warpmis.kernels.shading_frame import Frame, to_world
from warpmis.scene.features import Features
from warpmis.scene.material import MATTE_ALPHA

wp.set_module_options({"enable_backward": False})


@wp.func
def response_of(surface: Surface, frame: Frame) -> Response:
    """The surface, as the choice among lights knows it."""
    response = Response()
    if surface.side.is_present:
        return response  # as if it were matte: what it refracts has no lobe about the mirror's direction
    response.wo = to_world(frame, surface.wo)
    response.matte = surface.p_diffuse
    response.alpha2 = surface.alpha * surface.alpha
    response.coat_alpha2 = surface.coat_alpha * surface.coat_alpha
    if surface.alpha < wp.static(MATTE_ALPHA):
        response.gloss = surface.p_specular
    else:
        response.matte += surface.p_specular
    if surface.coat_alpha < wp.static(MATTE_ALPHA):
        response.coat = surface.p_coat
    else:
        response.matte += surface.p_coat
    return response


def make_vertex(
    features: Features,
    PathState: type,
    surface: SimpleNamespace,
    lights: SimpleNamespace,
    direct_light: SimpleNamespace,
    contributions: SimpleNamespace,
    sampler: SimpleNamespace,
) -> SimpleNamespace:
    """Functions: random_numbers, prepare, add_delta_light."""

    @wp.func
    def random_numbers(path: wp.ref[PathState], key: rng.RngKey, step: int) -> Vertex:
        """A vertex with its numbers alone. At the first one that is no mirror a single number makes the choices of
        light and lobe, so that these are as evenly spread over a pixel's samples as that number is."""
        vertex = Vertex()
        vertex.u_light = sampler.of_step(key, step, rng.LIGHT)
        vertex.u_bsdf = sampler.of_step(key, step, rng.SCATTER)
        if wp.static(features.delta_light):
            vertex.u_delta = sampler.of_step(key, step, rng.DELTA_LIGHT)[0]
        if wp.static(features.rough_transmission):
            if not path.is_first:
                # The lattice's numbers are for the first vertex, also where an interface comes before it.
                vertex.u_light = sampler.independent_of_step(key, step, rng.LIGHT)
                vertex.u_bsdf = sampler.independent_of_step(key, step, rng.SCATTER)
                vertex.u_delta = sampler.independent_of_step(key, step, rng.DELTA_LIGHT)[0]
        if wp.static(features.cache):
            u_rates = rng.uniform4_of_step(key, step, rng.EVENT)
            vertex.u_cache = wp.vec3(rng.uniform4_of_step(key, step, rng.DELTA_LIGHT)[1], u_rates[3], u_rates[1])
        if path.is_first:
            vertex.u_light[0] = path.u_remapped
            vertex.u_bsdf[0] = path.u_remapped
            vertex.u_delta = path.u_choice
            vertex.u_cache[0] = path.u_choice
        return vertex

    @wp.func
    def prepare(
        scene: SceneView,
        path: wp.ref[PathState],
        hit: wp.ref[Hit],
        material: MaterialView,
        frame: Frame,
        wo: wp.vec3,
        side: InterfaceSide,
        key: rng.RngKey,
        step: int,
    ) -> Vertex:
        """The vertex where the path has arrived; path.receiver becomes this one, with a light chosen for it.

        frame: looks to the side where there is one; wo: local to the frame that looks to the path's.
        """
        vertex = random_numbers(path, key, step)
        vertex.ng = hit.ng
        vertex.frame = frame
        if wp.static(features.rough_transmission):
            if side.is_present:
                vertex.surface = surface.on_side(side, material, wo)
                contributions.scatter(path, wp.vec3(0.0, 0.0, 0.0), side.is_beyond)
        if not side.is_present:
            vertex.surface = surface.prepare(scene, material, wo)
        prim = int(0)
        if wp.static(features.controlled):
            prim = lights.control.prim_of(scene, hit)
        absorption = path.receiver.absorption
        response = Response()
        if wp.static(features.glossy_choice):
            response = response_of(vertex.surface, frame)
        u = vertex.u_light
        path.receiver = lights.receiver(scene, path.origin, frame.n, prim, u[0], u[1], response)
        if wp.static(features.absorption):
            path.receiver.absorption = absorption
        if path.is_first:
            # What the choices leave of their number serves as the first number of the direction.
            vertex.u_light[1] = path.receiver.choice.u_remapped
            vertex.u_bsdf[1] = surface.remapped(vertex.surface, vertex.u_bsdf[0])
        return vertex

    @wp.func
    def add_delta_light(scene: SceneView, path: wp.ref[PathState], vertex: wp.ref[Vertex]):
        from_light = direct_light.from_delta_light(scene, path.receiver, vertex)
        radiance = wp.cw_mul(path.beta, from_light.radiance)
        path.L += radiance
        contributions.light_sample(scene, path, radiance, from_light.diffuse, from_light.light)
        path.shadow_rays += from_light.rays

    return SimpleNamespace(random_numbers=random_numbers, prepare=prepare, add_delta_light=add_delta_light)
