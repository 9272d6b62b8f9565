"""The mixture of strategies at the first vertex that is no mirror and no interface: one direction, one sample a path.

The direction is drawn from p_a = sum_s a_s p_s, with the pixel's shares a. The density of a strategy that samples
lights is known only when the ray has met the lights on its way, so the path is divided by p_a then (Murray et al. 2020,
equation 4). All other vertices take next-event estimation.

Reference: Veach (1997), section 9.2.4, the one-sample model.
"""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import SceneView
from warpmis.kernels import rng
from warpmis.kernels.bsdf.surface import Scattering
from warpmis.kernels.light.on_ray import LightsOnRay
from warpmis.kernels.light.records import LightSample
from warpmis.kernels.path.state import Vertex
from warpmis.kernels.shading_frame import to_local
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})


def make_estimate(vec_s: type) -> type:
    """The type of PathState.estimate."""

    @wp.struct
    class MixtureEstimate:
        """The first vertex' direction among the strategies, S numbers each.

        allocation: shares a_s; strategy: the one that draws; densities: p_s of the direction [1/sr], those of lights
        missing; is_pending: whether they are still missing; q: p_s / p_a, or 1 / a_s for the drawing strategy alone
        where the path ended before its density was known.
        """

        allocation: vec_s
        strategy: int
        densities: vec_s
        is_pending: bool
        q: vec_s

    return MixtureEstimate


def make_densities(
    features: Features, PathState: type, strategies: SimpleNamespace, lights: SimpleNamespace
) -> SimpleNamespace:
    """Functions begin, keep, complete, asks_whole_line: densities of a vertex' direction, whatever drew it."""

    @wp.func
    def begin(path: wp.ref[PathState], drawn: LightSample):
        """A direction that some strategy drew, and the light that it was drawn towards, if any."""
        path.estimate.is_pending = True
        path.wi = drawn.wi
        path.receiver.drawn = drawn.light
        path.receiver.drawn_distance = drawn.distance
        path.receiver.drawn_pdf = drawn.pdf_of_light
        path.weighs_emission = False

    @wp.func
    def keep(path: wp.ref[PathState], vertex: wp.ref[Vertex], scattering: wp.ref[Scattering]):
        if path.estimate.is_pending:
            cos_theta = to_local(vertex.frame, path.wi)[2]
            path.estimate.densities = strategies.vertex_densities(vertex.surface, cos_theta, scattering)

    @wp.func
    def complete(scene: SceneView, path: wp.ref[PathState], on_ray: wp.ref[LightsOnRay]):
        """Add the densities of the lights that the ray met."""
        finite = on_ray.finite
        if wp.static(features.mesh_light):
            finite += lights.pdf_emitter_triangles(scene, path.receiver, path.wi)
        path.estimate.densities = strategies.completed(path.estimate.densities, path.receiver, finite, on_ray.infinite)
        path.estimate.is_pending = False

    @wp.func
    def asks_whole_line(path: wp.ref[PathState]) -> bool:
        return path.estimate.is_pending

    return SimpleNamespace(begin=begin, keep=keep, complete=complete, asks_whole_line=asks_whole_line)


def make_mixture(
    PathState: type,
    strategies: SimpleNamespace,
    densities: SimpleNamespace,
    next_event: SimpleNamespace,
    record: SimpleNamespace,
    has_other_vertices: bool,
) -> SimpleNamespace:
    """The estimator, with the functions of `next_event`, which it takes at all other vertices."""
    vec_s = strategies.vec_s

    @wp.func
    def begin(scene: SceneView, path: wp.ref[PathState], key: rng.RngKey, allocation: vec_s, u_choice: float):
        path.estimate.allocation = allocation
        path.estimate.strategy = strategies.choose(allocation, u_choice)
        path.u_choice = u_choice
        path.u_remapped = strategies.remapped(allocation, path.estimate.strategy, u_choice)

    @wp.func
    def sample(scene: SceneView, path: wp.ref[PathState], vertex: wp.ref[Vertex]):
        """Draw the path's next direction from the chosen strategy."""
        record.begin(path)
        path.estimate.q = strategies.one_strategy_ratios(path.estimate.allocation, path.estimate.strategy)
        densities.begin(path, strategies.sample(scene, path.receiver, vertex, path.estimate.strategy))

    @wp.func
    def scatter(scene: SceneView, path: wp.ref[PathState], vertex: wp.ref[Vertex]):
        if wp.static(has_other_vertices):
            if path.is_first:
                sample(scene, path, vertex)
            else:
                next_event.scatter(scene, path, vertex)
        else:
            sample(scene, path, vertex)

    @wp.func
    def add_light(scene: SceneView, path: wp.ref[PathState], vertex: wp.ref[Vertex]):
        """On the side of an interface to which the path does not go."""
        if wp.static(has_other_vertices):
            next_event.add_light(scene, path, vertex)

    @wp.func
    def weigh_ray(scene: SceneView, path: wp.ref[PathState], on_ray: wp.ref[LightsOnRay]) -> bool:
        if path.estimate.is_pending:
            densities.complete(scene, path, on_ray)
            p_a = wp.dot(path.estimate.allocation, path.estimate.densities)
            if p_a <= 0.0:
                return False
            path.estimate.q = path.estimate.densities / p_a
            path.beta = path.beta / p_a
        return True

    return SimpleNamespace(
        begin=begin,
        draws_by_bsdf=next_event.draws_by_bsdf,
        scatter=scatter,
        add_light=add_light,
        keep_densities=densities.keep,
        asks_whole_line=densities.asks_whole_line,
        weigh_ray=weigh_ray,
    )
