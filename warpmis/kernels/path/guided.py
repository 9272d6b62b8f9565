"""Paths by the spatial cache: at every vertex that is no mirror the cell says how to go on.

The direction is drawn from a mixture of BSDF and guide, p_a = a p_bsdf + (1 - a) p_guide, with the share a of the cell.
The light sample is taken with the probability s, and the path goes on with the probability t; both rise with what the
path carries, and with what the cell expects of them. Light sample and path share the direct light by the balance
heuristic of the densities by which they find it: p_light s against p_a t.

All of the cache was learned from earlier rounds, so no weight depends on what it weighs.

References: Murray et al. (2020), section 5; Rath et al. (2022), "EARS", equation 12; Vorba, Krivanek (2016),
"Adjoint-Driven Russian Roulette and Splitting".
"""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import SceneView
from warpmis.kernels import rng
from warpmis.kernels.bsdf.rough_interface import chance_of
from warpmis.kernels.bsdf.surface import Scattering
from warpmis.kernels.cache.guide import from_square, guide_frame, pdf_guide, sample_guide, to_square
from warpmis.kernels.cache.lookup import cell_of
from warpmis.kernels.light.on_ray import LightsOnRay
from warpmis.kernels.mis import balance_weight
from warpmis.kernels.path.state import Vertex
from warpmis.kernels.shading_frame import Frame, luminance, to_world

wp.set_module_options({"enable_backward": False})

# No rate falls below: what has not been met yet can still be found, and no weight exceeds ten times its own.
MIN_RATE = wp.constant(0.1)
# What draws directions: BSDF and guide.
GUIDED_STRATEGIES = 2


def make_guided_estimate() -> type:
    """The type of PathState.estimate."""

    @wp.struct
    class GuidedEstimate:
        """Of the present vertex, but for the first and the last line.

        pixel_worth: what radiance is worth in the path's pixel.
        bsdf_share: a; place: the drawn direction in the guide's square; pdf_guide: its density there [1/sr].
        light_rate, survival: s and t.
        first_record: where the path's vertices are recorded, NO_RECORD for nowhere; recorded: how many have been;
        is_recorded: whether the present one is.
        """

        pixel_worth: float
        bsdf_share: float
        place: wp.vec2
        pdf_guide: float
        light_rate: float
        survival: float
        first_record: int
        recorded: int
        is_recorded: bool

    return GuidedEstimate


def make_guided(
    PathState: type,
    vec_s: type,
    surface: SimpleNamespace,
    direct_light: SimpleNamespace,
    record: SimpleNamespace,
    contributions: SimpleNamespace,
) -> SimpleNamespace:
    """The estimator: begin, draws_by_bsdf, scatter, add_light, keep_densities, survives, asks_whole_line, weigh_ray.
    And its parts, for those who try others (scripts/bench/cell_counts.py): look_up, take_light_sample, draw_direction.
    """

    @wp.func
    def begin(scene: SceneView, path: wp.ref[PathState], key: rng.RngKey, allocation: vec_s, u_choice: float):
        path.u_choice = u_choice
        path.u_remapped = u_choice
        path.estimate.pixel_worth = scene.cache[0].pixel_worth[int(key.pixel)]
        record.begin_path(scene, path, key)

    @wp.func
    def take_light_sample(scene: SceneView, path: wp.ref[PathState], vertex: wp.ref[Vertex], cell: int) -> float:
        """What a light sample adds to the path, per throughput; its luminance is returned."""
        light = direct_light.light_sample(scene, path.receiver, vertex)
        if light.pdf <= 0.0:
            return 0.0
        a = path.estimate.bsdf_share
        pdf = a * light.pdf_bsdf
        if a < 1.0:
            cos_theta = wp.dot(light.wi, vertex.frame.n)
            place = to_square(guide_frame(vertex.frame.n), light.wi)
            of_guide = pdf_guide(scene.cache[0].densities, cell, place, cos_theta)
            pdf += (1.0 - a) * of_guide * chance_of(vertex.surface.side)
        sampled = light.pdf * path.estimate.light_rate
        weight = balance_weight(sampled, pdf * path.estimate.survival) / sampled
        radiance = direct_light.shadowed(scene, path.receiver, light) * weight
        path.L += wp.cw_mul(path.beta, radiance)
        contributions.light_sample(
            scene, path, wp.cw_mul(path.beta, radiance), light.diffuse, path.receiver.choice.light
        )
        path.shadow_rays += 1
        return luminance(radiance)

    @wp.func
    def add_light_sample(scene: SceneView, path: wp.ref[PathState], vertex: wp.ref[Vertex], cell: int) -> float:
        """The same, if the light sample is taken."""
        if vertex.u_cache[1] >= path.estimate.light_rate:
            return 0.0
        return take_light_sample(scene, path, vertex, cell)

    @wp.func
    def draw_direction(scene: SceneView, path: wp.ref[PathState], vertex: wp.ref[Vertex], cell: int):
        """The path's next direction, from BSDF or guide, and what the guide's density of it is."""
        a = path.estimate.bsdf_share
        u = vertex.u_cache[0]
        frame = guide_frame(vertex.frame.n)
        if u < a:
            if path.is_first:
                vertex.u_bsdf[0] = u / a
                vertex.u_bsdf[1] = surface.remapped(vertex.surface, vertex.u_bsdf[0])
            path.wi = to_world(vertex.frame, surface.sample(vertex.surface, vertex.u_bsdf))
            path.estimate.place = to_square(frame, path.wi)
        else:
            u = wp.min((u - a) / (1.0 - a), rng.ONE_MINUS_EPSILON)
            path.estimate.place = sample_guide(scene.cache[0].densities, cell, u, vertex.u_bsdf[2])
            path.wi = from_square(frame, path.estimate.place[0], path.estimate.place[1])
        cos_theta = wp.dot(path.wi, vertex.frame.n)
        path.estimate.pdf_guide = pdf_guide(scene.cache[0].densities, cell, path.estimate.place, cos_theta)
        path.weighs_emission = True

    @wp.func
    def draws_by_bsdf(
        scene: SceneView, path: wp.ref[PathState], frame: Frame, beyond: float, key: rng.RngKey, step: int
    ) -> bool:
        """Whether the BSDF draws the direction at an interface, by the mean share of its two sides' cells."""
        near_cell = cell_of(scene.cache[0].tree, path.origin, frame.n)
        beyond_cell = cell_of(scene.cache[0].tree, path.origin, -frame.n)
        near_share = scene.cache[0].cells[near_cell].bsdf_share
        path.estimate.bsdf_share = near_share + beyond * (scene.cache[0].cells[beyond_cell].bsdf_share - near_share)
        return rng.uniform4_of_step(key, step, rng.DELTA_LIGHT)[1] < path.estimate.bsdf_share

    @wp.func
    def look_up(scene: SceneView, path: wp.ref[PathState], vertex: wp.ref[Vertex]) -> int:
        """The vertex' cell, and what it says."""
        cell = cell_of(scene.cache[0].tree, path.origin, vertex.frame.n)
        learned = scene.cache[0].cells[cell]
        worth = luminance(path.beta) * path.estimate.pixel_worth
        if not vertex.surface.side.is_present:
            path.estimate.bsdf_share = learned.bsdf_share
        path.estimate.survival = wp.clamp(worth * learned.tail_worth, MIN_RATE, 1.0)
        path.estimate.light_rate = wp.clamp(worth * learned.shadow_ray_worth, MIN_RATE, 1.0)
        return cell

    @wp.func
    def add_light(scene: SceneView, path: wp.ref[PathState], vertex: wp.ref[Vertex]):
        add_light_sample(scene, path, vertex, look_up(scene, path, vertex))

    @wp.func
    def scatter(scene: SceneView, path: wp.ref[PathState], vertex: wp.ref[Vertex]):
        cell = look_up(scene, path, vertex)
        sampled = add_light_sample(scene, path, vertex, cell)
        draw_direction(scene, path, vertex, cell)
        record.vertex(scene, path, vertex.frame.n, sampled * sampled * path.estimate.light_rate)

    @wp.func
    def keep_densities(path: wp.ref[PathState], vertex: wp.ref[Vertex], scattering: wp.ref[Scattering]):
        """The density of the mixture in place of the BSDF's."""
        a = path.estimate.bsdf_share
        path.estimate.pdf_guide = path.estimate.pdf_guide * chance_of(vertex.surface.side)
        path.pdf = a * scattering.pdf_solid_angle + (1.0 - a) * path.estimate.pdf_guide

    @wp.func
    def survives(
        scene: SceneView,
        path: wp.ref[PathState],
        vertex: wp.ref[Vertex],
        scattering: wp.ref[Scattering],
        key: rng.RngKey,
        step: int,
    ) -> bool:
        """Whether the path goes on; its throughput and its density become those of a path that had to survive."""
        densities = wp.vec2(scattering.pdf_solid_angle, path.estimate.pdf_guide)
        cos_theta = wp.dot(path.wi, vertex.frame.n)
        record.direction(scene, path, cos_theta, luminance(scattering.f_cos), densities, path.pdf)
        survival = path.estimate.survival
        path.beta = path.beta / survival
        path.pdf = path.pdf * survival / path.estimate.light_rate
        return vertex.u_cache[2] < survival

    @wp.func
    def asks_whole_line(path: wp.ref[PathState]) -> bool:
        return False

    @wp.func
    def weigh_ray(scene: SceneView, path: wp.ref[PathState], on_ray: wp.ref[LightsOnRay]) -> bool:
        return True

    return SimpleNamespace(
        begin=begin,
        draws_by_bsdf=draws_by_bsdf,
        scatter=scatter,
        add_light=add_light,
        keep_densities=keep_densities,
        survives=survives,
        asks_whole_line=asks_whole_line,
        weigh_ray=weigh_ray,
        look_up=look_up,
        take_light_sample=take_light_sample,
        draw_direction=draw_direction,
    )
