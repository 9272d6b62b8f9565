"""The table of sampling strategies at a vertex that is no mirror: each a name, a sampler and a density.

    bsdf      the BSDF's own sampler                 uniform   the hemisphere about the shading normal
    light     all lights                             cosine    the hemisphere, by the cosine
    area      the lights at a distance               diffuse   the BSDF's diffuse lobe
    dome      the lights at infinity                 specular  the BSDF's specular lobes, coat included
    guide     what a cell has learned; its sampler and its density are those of path/cell_mixture.py

All densities are in solid angle, and any of them can be evaluated for a direction that another strategy drew. A
strategy may have nothing to sample at a point: no light faces it, or the BSDF has no such lobe. Then it draws from the
BSDF, so that no sample is lost.
"""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import SceneView
from warpmis.kernels.bsdf.surface import Scattering, Surface
from warpmis.kernels.light.records import LightSample, Receiver
from warpmis.kernels.path.state import Vertex
from warpmis.kernels.rng import ONE_MINUS_EPSILON
from warpmis.kernels.shading_frame import to_world
from warpmis.kernels.warps import INV_PI, square_to_cosine_hemisphere, square_to_uniform_hemisphere
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})

NO_STRATEGY = wp.constant(-1)


def make_strategies(features: Features, surface: SimpleNamespace, lights: SimpleNamespace) -> SimpleNamespace:
    """Functions over the S = len(features.strategies) strategies; type vec_s.

    choose, sample: a strategy, and a direction from it. vertex_densities: the strategies' densities for a direction, as
    far as the vertex knows them; completed: the same with those of the lights, once the ray has met them.
    """
    names = features.strategies
    count = len(names)
    vec_s = wp.types.vector(length=max(count, 1), dtype=wp.float32)

    @wp.func
    def choose(allocation: vec_s, u: float) -> int:
        """The strategy s with probability allocation[s]; never one of share 0."""
        chosen = int(NO_STRATEGY)
        reached = float(0.0)
        for s in range(wp.static(count)):
            if allocation[s] > 0.0 and (chosen == NO_STRATEGY or u >= reached):
                chosen = s
            reached += allocation[s]
        return chosen

    @wp.func
    def remapped(allocation: vec_s, strategy: int, u: float) -> float:
        """The number that chose the strategy, remapped from its share to [0, 1): as evenly spread over the strategy's
        samples as u is over all."""
        reached = float(0.0)
        within = float(u)
        for s in range(wp.static(count)):
            if s == strategy:
                within = (u - reached) / allocation[s]
            reached += allocation[s]
        return wp.clamp(within, 0.0, ONE_MINUS_EPSILON)

    @wp.func
    def one_strategy_ratios(allocation: vec_s, strategy: int) -> vec_s:
        """p_s / p_a of a direction that no other strategy could draw: 1 / a_s for this one, 0 for the others."""
        q = vec_s()
        for s in range(wp.static(count)):
            if s == strategy:
                q[s] = 1.0 / allocation[s]
        return q

    @wp.func
    def lights_of(scene: SceneView, r: wp.ref[Receiver], strategy: int, u: wp.vec4) -> LightSample:
        s = LightSample()
        for i in range(wp.static(count)):
            if strategy == i:
                if wp.static(names[i] == "light"):
                    s = lights.sample(scene, r, u)
                if wp.static(names[i] == "area"):
                    s = lights.sample_finite(scene, r, u)
                if wp.static(names[i] == "dome"):
                    s = lights.sample_infinite(scene, r, u)
        return s

    @wp.func
    def total_of(r: wp.ref[Receiver], strategy: int) -> float:
        """Importance of all lights that a strategy chooses from; 0 for strategies that sample no lights."""
        total = float(0.0)
        for i in range(wp.static(count)):
            if strategy == i:
                if wp.static(names[i] == "light"):
                    total = r.total
                if wp.static(names[i] == "area"):
                    total = r.finite
                if wp.static(names[i] == "dome"):
                    total = r.infinite
        return total

    @wp.func
    def sample(scene: SceneView, r: wp.ref[Receiver], vertex: wp.ref[Vertex], strategy: int) -> LightSample:
        """A world direction from one strategy, and the light that it was drawn towards, if any; wi is the zero vector
        where there is none. Of vertex.u_bsdf the hemispheres take the first and the third number, the BSDF's sampler
        the second as well, which may be the first one remapped."""
        drawn = LightSample()
        if total_of(r, strategy) > 0.0:
            towards = lights_of(scene, r, strategy, vertex.u_light)
            if towards.pdf_solid_angle > 0.0:
                drawn = towards
            return drawn
        s = vertex.surface
        u = vertex.u_bsdf
        u_lobe = wp.vec4(u[0], u[1], u[2], u[3])
        p_specular = s.p_specular + s.p_coat
        local = wp.vec3(0.0, 0.0, 0.0)
        is_bsdf = bool(True)
        for i in range(wp.static(count)):
            if strategy == i:
                if wp.static(names[i] == "uniform"):
                    local = square_to_uniform_hemisphere(u[0], u[2])
                    is_bsdf = False
                if wp.static(names[i] == "cosine"):
                    local = square_to_cosine_hemisphere(u[0], u[2])
                    is_bsdf = False
                # The BSDF's sampler chooses its lobe by u[0]: one lobe is a part of that number's range.
                if wp.static(names[i] == "diffuse"):
                    if s.p_diffuse > 0.0:
                        u_lobe[0] = 0.0
                        u_lobe[1] = u[0]
                if wp.static(names[i] == "specular"):
                    if p_specular > 0.0:
                        u_lobe[0] = wp.max(s.p_diffuse, s.p_diffuse + u[0] * p_specular)
                        u_lobe[1] = surface.remapped(s, u_lobe[0])
        if is_bsdf:
            local = surface.sample(s, u_lobe)
        if local[2] > 0.0:
            drawn.wi = to_world(vertex.frame, local)
        return drawn

    @wp.func
    def vertex_densities(s: Surface, cos_theta: float, scattering: Scattering) -> vec_s:
        """For a direction with this cosine to the normal; the BSDF's density in place of the lights'."""
        p = vec_s()
        for i in range(wp.static(count)):
            p[i] = scattering.pdf_solid_angle
            if wp.static(names[i] == "uniform"):
                p[i] = 0.5 * INV_PI
            if wp.static(names[i] == "cosine"):
                p[i] = cos_theta * INV_PI
            if wp.static(names[i] == "diffuse"):
                if s.p_diffuse > 0.0:
                    p[i] = cos_theta * INV_PI
            if wp.static(names[i] == "specular"):
                if s.p_specular + s.p_coat > 0.0:
                    p[i] = scattering.pdf_specular / (s.p_specular + s.p_coat)
        return p

    @wp.func
    def completed(at_vertex: vec_s, r: wp.ref[Receiver], finite: float, infinite: float) -> vec_s:
        """finite, infinite: density times importance of the lights on the ray (LightsOnRay), mesh lights among them."""
        p = at_vertex
        for i in range(wp.static(count)):
            if total_of(r, i) > 0.0:
                if wp.static(names[i] == "light"):
                    p[i] = (finite + infinite) / r.total
                if wp.static(names[i] == "area"):
                    p[i] = finite / r.finite
                if wp.static(names[i] == "dome"):
                    p[i] = infinite / r.infinite
        return p

    return SimpleNamespace(
        choose=choose,
        remapped=remapped,
        one_strategy_ratios=one_strategy_ratios,
        sample=sample,
        vertex_densities=vertex_densities,
        completed=completed,
        vec_s=vec_s,
        count=count,
        index=names.index,
        names=names,
    )
