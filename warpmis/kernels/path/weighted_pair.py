"""Next-event estimation whose light sample and BSDF sample share the first vertex by what a pixel has learned.

The first vertex is the first one that is neither a mirror nor glass. What a pixel has learned is one of two things:

    weights    a factor v of each technique's density in the balance heuristic: w_t ~ v_t p_t
    control    a coefficient g, per colour, of a control variate of mean 0: the estimate is X - g c, with

        c = (p_light - p_bsdf) / (p_light + p_bsdf)    summed over the directions of both samples

A sample that cannot contribute counts with 1 if it is the light sample's, else with -1: its direction is below the
surface, or there is none for want of a light. Light that is hidden has its densities all the same. With samples of
value 0 left out, the mean would not be 0. At a vertex without lights c is 1 - 1.

Kernels that learn are next-event estimation itself, and keep what a pixel learns from: the light straight from the
lights, which is what the two samples share. All later vertices take next-event estimation, too.

References: Grittmann, Georgiev, Slusallek, Krivanek (2019), "Variance-Aware Multiple Importance Sampling"; Kondapaneni,
Vevoda, Grittmann, Skrivan, Slusallek, Krivanek (2019), "Optimal Multiple Importance Sampling": of the two coefficients
there one is free, since the two ratios p_t / (p_light + p_bsdf) sum to 1.
"""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import SceneView
from warpmis.kernels import rng
from warpmis.kernels.bsdf.surface import Scattering
from warpmis.kernels.direct_light import ScatteredLight
from warpmis.kernels.light.choice import density
from warpmis.kernels.mis import balance_weight
from warpmis.kernels.path.record import NoRecord, no_record
from warpmis.kernels.path.state import Vertex
from warpmis.kernels.shading_frame import luminance, to_local
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})


@wp.struct
class PairEstimate:
    """ratio: v_light / v_bsdf; coefficient: g [radiance]; control: c of the path, 0 without a first vertex."""

    ratio: float
    coefficient: wp.vec3
    control: float


@wp.struct
class PairRecord:
    """light, bsdf: what each technique brings of the light straight from the lights, by the balance heuristic;
    first_bounce: PathState.bounces at the first vertex."""

    light: wp.vec3
    bsdf: wp.vec3
    first_bounce: int


def pair_record_type(is_on: bool) -> type:
    return PairRecord if is_on else NoRecord


def make_pair_record(PathState: type, is_on: bool) -> SimpleNamespace:
    """Functions of no_record; and begin_vertex and light_sample, before and after the light sample of the first
    vertex."""
    functions = no_record(PathState)

    @wp.func
    def begin_vertex(path: wp.ref[PathState]):
        if wp.static(is_on):
            path.record.light = -path.L
            path.record.first_bounce = path.bounces

    @wp.func
    def light_sample(path: wp.ref[PathState]):
        if wp.static(is_on):
            path.record.light += path.L

    @wp.func
    def emission(path: wp.ref[PathState], radiance: wp.vec3):
        if wp.static(is_on):
            if path.has_scattered and path.bounces == path.record.first_bounce:
                path.record.bsdf += radiance

    functions.begin_vertex, functions.light_sample, functions.emission = begin_vertex, light_sample, emission
    return functions


def make_control(features: Features, PathState: type, surface: SimpleNamespace, lights: SimpleNamespace) -> wp.Function:
    """c of the two samples of a vertex."""

    @wp.func
    def of_direction(scene: SceneView, path: wp.ref[PathState], wi: wp.vec3, p_bsdf: float, drawn: float) -> float:
        """drawn: the density of the light that wi was drawn towards, which its rounded direction may miss, or 0."""
        # Densities alone, of all lights on the line: a stretch of no length has no radiance.
        on_line = lights.gather(scene, path.receiver, wi, 0.0, 0.0, 0.0, True)
        met = on_line.finite + on_line.infinite
        if wp.static(features.mesh_light):
            met += lights.pdf_emitter_triangles(scene, path.receiver, wi)
        p_light = wp.max(density(met, path.receiver.total), drawn)
        return 2.0 * balance_weight(p_light, p_bsdf) - 1.0

    @wp.func
    def control(
        scene: SceneView, path: wp.ref[PathState], vertex: wp.ref[Vertex], sample: wp.ref[ScatteredLight]
    ) -> float:
        """sample: the light sample, of density 0 where the surface does not scatter it; path.wi has been drawn."""
        of_light = float(1.0)
        if sample.pdf > 0.0:
            of_light = of_direction(scene, path, sample.wi, sample.pdf_bsdf, sample.pdf)
        of_bsdf = float(-1.0)
        if wp.dot(path.wi, vertex.ng) > 0.0:
            scattering = surface.evaluate(vertex.surface, to_local(vertex.frame, path.wi))
            if luminance(scattering.f_cos) > 0.0:
                of_bsdf = of_direction(scene, path, path.wi, scattering.pdf_solid_angle, 0.0)
        return of_light + of_bsdf

    return control


def make_weighted_pair(
    PathState: type,
    vec_a: type,
    strategies: SimpleNamespace,
    control: wp.Function,
    has_control: bool,
    next_event: SimpleNamespace,
    record: SimpleNamespace,
    survives_roulette: wp.Function,
    learns: bool,
) -> SimpleNamespace:
    """The estimator. A pixel's allocation, of type vec_a, is the weights of the strategies, or the coefficients of the
    control."""
    bsdf, light = strategies.index("bsdf"), strategies.index("light")

    @wp.func
    def begin(scene: SceneView, path: wp.ref[PathState], key: rng.RngKey, allocation: vec_a, u_choice: float):
        path.u_choice = u_choice
        path.u_remapped = u_choice
        path.estimate.ratio = 1.0
        if wp.static(not learns):
            if wp.static(has_control):
                path.estimate.coefficient = wp.vec3(allocation[0], allocation[1], allocation[2])
            else:
                path.estimate.ratio = allocation[wp.static(light)] / allocation[wp.static(bsdf)]

    @wp.func
    def scatter(scene: SceneView, path: wp.ref[PathState], vertex: wp.ref[Vertex]):
        ratio = float(1.0)
        if path.is_first:
            ratio = path.estimate.ratio
            record.begin_vertex(path)
        sample = next_event.add_light_sample(scene, path, vertex, 1.0, ratio)
        next_event.draw_direction(path, vertex)
        if path.is_first:
            record.light_sample(path)
            if wp.static(has_control):
                path.estimate.control = control(scene, path, vertex, sample)
                path.L -= path.estimate.control * path.estimate.coefficient

    @wp.func
    def survives(
        scene: SceneView,
        path: wp.ref[PathState],
        vertex: wp.ref[Vertex],
        scattering: wp.ref[Scattering],
        key: rng.RngKey,
        step: int,
    ) -> bool:
        """Roulette. The density against which the lights on the ray are weighed gets the weight of its technique."""
        if path.is_first:
            path.pdf = path.pdf / path.estimate.ratio
        return survives_roulette(scene, path, vertex, scattering, key, step)

    return SimpleNamespace(
        begin=begin,
        draws_by_bsdf=next_event.draws_by_bsdf,
        scatter=scatter,
        add_light=next_event.add_light,
        keep_densities=next_event.keep_densities,
        asks_whole_line=next_event.asks_whole_line,
        weigh_ray=next_event.weigh_ray,
        survives=survives,
    )
