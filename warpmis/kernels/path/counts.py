"""Next-event estimation with several light samples and several paths at the first vertex that is no mirror.

A path branches there: what leads to the vertex is traced once. Light samples and branches share the direct light by the
balance heuristic of n_light p_light and n_bsdf p_bsdf. All later vertices take one sample of each.

Of n samples of a vertex, those but the first have the first one's numbers, moved on by 1/n of the lattice's step each.
So all of a pixel's samples together are as even as on a lattice of n times as many points.

Reference: Veach (1997), section 9.2.2, the multi-sample model.
"""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import SceneView, vec_lattice
from warpmis.kernels import rng
from warpmis.kernels.bsdf.surface import Scattering
from warpmis.kernels.lattice import moved_on
from warpmis.kernels.light.records import Receiver
from warpmis.kernels.path.state import Vertex

wp.set_module_options({"enable_backward": False})

# The density of directions that no light sample competes with, in units of their own.
ALONE = wp.constant(1.0e20)


@wp.struct
class CountsEstimate:
    """lights, paths: counts of samples at the first vertex; branches: paths, once there is one. The others are the
    first vertex as its next branch finds it, and the lattice's steps."""

    lights: int
    paths: int
    branches: int
    step: int
    bounces: int
    vertex: Vertex
    receiver: Receiver
    origin: wp.vec3
    beta: wp.vec3
    lattice: vec_lattice


def make_counts(
    PathState: type,
    strategies: SimpleNamespace,
    surface: SimpleNamespace,
    lights: SimpleNamespace,
    next_event: SimpleNamespace,
    record: SimpleNamespace,
    survives_roulette: wp.Function,
) -> SimpleNamespace:
    """The estimator, and begin_branch. A pixel's allocation is the counts of its two strategies."""
    vec_s = strategies.vec_s
    bsdf, light = strategies.index("bsdf"), strategies.index("light")

    @wp.func
    def begin(scene: SceneView, path: wp.ref[PathState], key: rng.RngKey, allocation: vec_s, u_choice: float):
        path.u_choice = u_choice
        path.u_remapped = u_choice
        path.estimate.lights = int(allocation[wp.static(light)])
        path.estimate.paths = int(allocation[wp.static(bsdf)])
        path.estimate.lattice = key.lattice

    @wp.func
    def choose_light(scene: SceneView, path: wp.ref[PathState], vertex: wp.ref[Vertex], first: wp.vec4, part: float):
        """Give the vertex the numbers of another light sample, and the receiver its light."""
        steps = path.estimate.lattice
        r = path.receiver
        u = moved_on(path.u_remapped, steps[0], part)
        path.receiver = lights.receiver(scene, r.x, r.n, r.prim, u, r.u_fine, r.response)
        path.receiver.absorption = r.absorption
        vertex.u_light[0] = u
        vertex.u_light[1] = path.receiver.choice.u_remapped
        vertex.u_light[2] = moved_on(first[2], steps[1], part)
        vertex.u_light[3] = moved_on(first[3], steps[8], part)

    @wp.func
    def keep(path: wp.ref[PathState], vertex: wp.ref[Vertex]):
        """Keep the vertex for its branches, which have equal parts of the throughput."""
        path.beta = path.beta / float(path.estimate.paths)
        path.estimate.branches = path.estimate.paths
        if path.estimate.paths > 1:
            path.estimate.vertex = vertex
            path.estimate.bounces = path.bounces
            path.estimate.receiver = path.receiver
            path.estimate.origin = path.origin
            path.estimate.beta = path.beta

    @wp.func
    def add_light(scene: SceneView, path: wp.ref[PathState], vertex: wp.ref[Vertex]):
        """All light samples of the vertex."""
        count = int(1)
        ratio = float(1.0)
        if path.is_first:
            count = path.estimate.lights
            ratio = float(count) / float(path.estimate.paths)
        u = vertex.u_light
        for sample in range(count):
            if sample > 0:
                choose_light(scene, path, vertex, u, float(sample) / float(count))
            next_event.add_light_sample(scene, path, vertex, float(count), ratio)
            if path.is_first:
                record.light_sample(path, sample, count)

    @wp.func
    def scatter(scene: SceneView, path: wp.ref[PathState], vertex: wp.ref[Vertex]):
        if path.is_first:
            record.begin_vertex(path)
        add_light(scene, path, vertex)
        if path.is_first:
            record.end_light_samples(path)
            keep(path, vertex)
        next_event.draw_direction(path, vertex)

    @wp.func
    def begin_branch(path: wp.ref[PathState], key: rng.RngKey, branch: int) -> rng.RngKey:
        """Go back to the first vertex and draw another direction; returns the branch's own key."""
        steps = path.estimate.lattice
        part = float(branch) / float(path.estimate.paths)
        vertex = path.estimate.vertex
        u = moved_on(path.u_remapped, steps[0], part)
        vertex.u_bsdf[0] = u
        vertex.u_bsdf[1] = surface.remapped(vertex.surface, u)
        vertex.u_bsdf[2] = moved_on(vertex.u_bsdf[2], steps[2], part)
        path.bounces = path.estimate.bounces
        path.receiver = path.estimate.receiver
        path.origin = path.estimate.origin
        path.beta = path.estimate.beta
        path.travelled = 0.0
        path.is_first = True
        next_event.draw_direction(path, vertex)
        own = key
        own.seed = key.seed ^ (wp.uint32(branch) << wp.uint32(24))
        return own

    @wp.func
    def survives(
        scene: SceneView,
        path: wp.ref[PathState],
        vertex: wp.ref[Vertex],
        scattering: wp.ref[Scattering],
        key: rng.RngKey,
        step: int,
    ) -> bool:
        """Roulette. The density against which the lights on the ray are weighed becomes that of all paths, for each
        light sample."""
        if path.is_first:
            path.estimate.step = step
            ratio = float(path.estimate.paths) / float(path.estimate.lights)
            path.pdf = path.pdf * wp.where(path.estimate.lights > 0, ratio, ALONE)
        return survives_roulette(scene, path, vertex, scattering, key, step)

    return SimpleNamespace(
        begin=begin,
        draws_by_bsdf=next_event.draws_by_bsdf,
        scatter=scatter,
        add_light=add_light,
        keep_densities=next_event.keep_densities,
        asks_whole_line=next_event.asks_whole_line,
        weigh_ray=next_event.weigh_ray,
        begin_branch=begin_branch,
        survives=survives,
    )
