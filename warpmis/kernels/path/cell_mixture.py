"""The mixture of strategies at every vertex that is no mirror, with the shares of the vertex' cell.

One direction a vertex, by the one-sample model: p_a = sum_s a_s p_s, with the shares a that the cell of the spatial
cache has learned. There is no light sample beside it. As in mixture.py the path is divided by p_a when the ray has met
the lights on its way. The path goes on with a probability that rises with what it carries and with what the cell
expects of it, as in guided.py.

All of the cache was learned from earlier rounds, so no weight depends on what it weighs.

References: Veach (1997), section 9.2.4, the one-sample model; Murray et al. (2020), section 5.
"""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import SceneView
from warpmis.kernels import rng
from warpmis.kernels.bsdf.surface import Scattering
from warpmis.kernels.cache.guide import from_square, guide_frame, pdf_guide, sample_guide, to_square
from warpmis.kernels.cache.lookup import cell_of
from warpmis.kernels.light.on_ray import LightsOnRay
from warpmis.kernels.light.records import LightSample
from warpmis.kernels.path.guided import MIN_RATE
from warpmis.kernels.path.state import Vertex
from warpmis.kernels.shading_frame import Frame, luminance

wp.set_module_options({"enable_backward": False})


def make_cell_estimate(vec_s: type) -> type:
    """The type of PathState.estimate."""

    @wp.struct
    class CellEstimate:
        """Of the present vertex, but for the first and the last line; of the S strategies, S numbers each.

        pixel_worth: what radiance is worth in the path's pixel.
        cell: of the cache; allocation: its shares a_s; strategy: the one that draws.
        densities: p_s of the direction [1/sr], those of lights missing; is_pending: whether they are still missing.
        place: the direction in the guide's square; pdf_guide: the guide's density of it [1/sr].
        cos_theta: to the shading normal; response: luminance of f cos; survival: probability that the path goes on.
        first_record: where the path's vertices are recorded, NO_RECORD for nowhere; recorded: how many have been;
        is_recorded: whether the present one is.
        """

        pixel_worth: float
        cell: int
        allocation: vec_s
        strategy: int
        densities: vec_s
        is_pending: bool
        place: wp.vec2
        pdf_guide: float
        cos_theta: float
        response: float
        survival: float
        first_record: int
        recorded: int
        is_recorded: bool

    return CellEstimate


def make_cell_mixture(
    PathState: type,
    strategies: SimpleNamespace,
    densities: SimpleNamespace,
    next_event: SimpleNamespace,
    record: SimpleNamespace,
) -> SimpleNamespace:
    """The estimator, with the functions of `next_event` where it is at an interface."""
    count = strategies.count
    has_guide = "guide" in strategies.names
    guide = strategies.index("guide") if has_guide else -1
    no_shares = wp.types.vector(length=1, dtype=wp.float32)

    @wp.func
    def begin(scene: SceneView, path: wp.ref[PathState], key: rng.RngKey, allocation: no_shares, u_choice: float):
        path.u_choice = u_choice
        path.estimate.pixel_worth = scene.cache[0].pixel_worth[int(key.pixel)]
        record.begin_path(scene, path, key)

    @wp.func
    def arrive(scene: SceneView, path: wp.ref[PathState], frame: Frame, key: rng.RngKey, step: int):
        """Choose a strategy by the cell's shares; what is left of the number will choose light and lobe."""
        path.estimate.cell = cell_of(scene.cache[0].tree, path.origin, frame.n)
        for s in range(wp.static(count)):
            path.estimate.allocation[s] = scene.cache[0].shares[path.estimate.cell * wp.static(count) + s]
        u = path.u_choice
        if not path.is_first:
            u = rng.uniform4_of_step(key, step, rng.DELTA_LIGHT)[1]
        path.estimate.strategy = strategies.choose(path.estimate.allocation, u)
        path.u_remapped = strategies.remapped(path.estimate.allocation, path.estimate.strategy, u)

    @wp.func
    def draw(scene: SceneView, path: wp.ref[PathState], vertex: wp.ref[Vertex]) -> LightSample:
        """A direction of the chosen strategy, and the light that it was drawn towards, if any."""
        if wp.static(has_guide):
            if path.estimate.strategy == wp.static(guide):
                drawn = LightSample()
                place = sample_guide(scene.cache[0].densities, path.estimate.cell, vertex.u_bsdf[0], vertex.u_bsdf[2])
                drawn.wi = from_square(guide_frame(vertex.frame.n), place[0], place[1])
                return drawn
        return strategies.sample(scene, path.receiver, vertex, path.estimate.strategy)

    @wp.func
    def sample(scene: SceneView, path: wp.ref[PathState], vertex: wp.ref[Vertex]):
        densities.begin(path, draw(scene, path, vertex))
        path.estimate.cos_theta = wp.dot(path.wi, vertex.frame.n)
        if wp.static(has_guide):
            path.estimate.place = to_square(guide_frame(vertex.frame.n), path.wi)
            path.estimate.pdf_guide = pdf_guide(
                scene.cache[0].densities, path.estimate.cell, path.estimate.place, path.estimate.cos_theta
            )
        worth = luminance(path.beta) * path.estimate.pixel_worth
        path.estimate.survival = wp.clamp(worth * scene.cache[0].cells[path.estimate.cell].tail_worth, MIN_RATE, 1.0)
        record.vertex(scene, path, vertex.frame.n, 0.0)

    @wp.func
    def scatter(scene: SceneView, path: wp.ref[PathState], vertex: wp.ref[Vertex]):
        """At an interface by next-event estimation."""
        path.estimate.survival = 1.0
        path.estimate.is_recorded = False
        if vertex.surface.side.is_present:
            next_event.scatter(scene, path, vertex)
        else:
            sample(scene, path, vertex)

    @wp.func
    def keep_densities(path: wp.ref[PathState], vertex: wp.ref[Vertex], scattering: wp.ref[Scattering]):
        densities.keep(path, vertex, scattering)
        if wp.static(has_guide):
            path.estimate.densities[wp.static(guide)] = path.estimate.pdf_guide
        path.estimate.response = luminance(scattering.f_cos)

    @wp.func
    def survives(
        scene: SceneView,
        path: wp.ref[PathState],
        vertex: wp.ref[Vertex],
        scattering: wp.ref[Scattering],
        key: rng.RngKey,
        step: int,
    ) -> bool:
        """Whether the path goes on; weigh_ray divides its throughput by the probability of that."""
        return vertex.u_cache[2] < path.estimate.survival

    @wp.func
    def weigh_ray(scene: SceneView, path: wp.ref[PathState], on_ray: wp.ref[LightsOnRay]) -> bool:
        if path.estimate.is_pending:
            densities.complete(scene, path, on_ray)
            p_a = wp.dot(path.estimate.allocation, path.estimate.densities)
            if p_a <= 0.0:
                return False
            path.beta = path.beta / p_a
            record.direction(scene, path, path.estimate.cos_theta, path.estimate.response, path.estimate.densities, p_a)
            path.beta = path.beta / path.estimate.survival
        return True

    return SimpleNamespace(
        begin=begin,
        arrive=arrive,
        draws_by_bsdf=next_event.draws_by_bsdf,
        scatter=scatter,
        add_light=next_event.add_light,
        keep_densities=keep_densities,
        survives=survives,
        asks_whole_line=densities.asks_whole_line,
        weigh_ray=weigh_ray,
    )
