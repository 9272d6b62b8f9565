"""The path tracer: what one camera ray brings home.

At the first vertex that scatters in more than one direction a direction is drawn from the mixture of the strategies,
p_a = sum_s a_s p_s, and the rest of the path is the integrand's tail (Murray et al. 2020, equation 4). After it, at
every vertex, one light sample and one BSDF sample share the direct light by the balance heuristic.
"""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import SceneView
from warpmis.kernels import rng, roulette
from warpmis.kernels.bsdf.events import MIRROR, PASS, make_events
from warpmis.kernels.bsdf.surface import Surface, make_surface
from warpmis.kernels.direct_light import make_direct_light
from warpmis.kernels.intersect import MAX_PASSED, make_intersect
from warpmis.kernels.light.distant import INFINITE_DISTANCE
from warpmis.kernels.light.records import Receiver
from warpmis.kernels.light.table import make_lights
from warpmis.kernels.material import make_material
from warpmis.kernels.sampler import make_sampler
from warpmis.kernels.shading_frame import luminance, to_local, to_world
from warpmis.kernels.strategies import make_strategies
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})

# How the present ray was drawn, which decides how the light that it meets is weighted.
SEEN = wp.constant(0)  # from the camera or a mirror: no other strategy could have found the light
MIXTURE = wp.constant(1)  # from the mixture: its density is complete once the ray's lights are known
WEIGHTED = wp.constant(2)  # from the BSDF, against the light sample of the same vertex
PAIRED = wp.constant(3)  # the same at the mixture's vertex, for learning: its densities are to be completed, too


def make_path(features: Features) -> SimpleNamespace:
    """The function Li, its result type PathSample and the strategies' namespace, for one set of effects."""
    lights = make_lights(features)
    surface = make_surface(features)
    intersect = make_intersect(features)
    direct_light = make_direct_light(features, surface, lights, intersect)
    materials = make_material(features)
    events = make_events(features, intersect.passed)
    strategies = make_strategies(features, surface, lights)
    sampler = make_sampler(features)
    vec_s = strategies.vec_s
    has_events = features.smooth or features.opacity
    has_mixture = strategies.count > 0
    paired = "pair" in features.statistics
    # Of paths that end behind the mixture's vertex none comes to a vertex without one.
    has_next_event = features.indirect or paired or not has_mixture

    @wp.struct
    class VertexNumbers:
        """What a vertex draws by. strategy: of the mixture, or -1; light: a light and a direction towards it; scatter:
        a lobe and a direction from it; delta_light: one of these."""

        strategy: int
        light: wp.vec4
        scatter: wp.vec4
        delta_light: float

    @wp.struct
    class PathSample:
        """One path.

        seen: light found before the mixture's vertex, and delta lights at it; mixed: the mixture's estimate
        F = f / p_a, throughput up to its vertex included; direct: the part of it that came straight from the lights;
        q: p_s / p_a of its direction, or 1 / a_s for the one that drew in vain.

        Where next-event estimation stands in for the mixture: light, light_share, light_rays: the part of its light
        sample, p_bsdf / (p_bsdf + p_light) of that sample's direction, and its shadow rays; q is p_s / (p_bsdf +
        p_light) of the BSDF's direction, and direct the weighted light that it met.

        late: the part of mixed that was found after Russian roulette could have ended the path; throughput: that of
        the last roulette, as if no roulette had been, and 1 without one.

        hit: 1 where a surface was met, of which albedo, normal and distance tell; alpha: 1 also for a light in view;
        early_rays, early_shadow_rays: those of all rays that were traced before Russian roulette could end the path;
        0 where the mixture's vertex was not reached.
        """

        seen: wp.vec3
        mixed: wp.vec3
        direct: wp.vec3
        late: wp.vec3
        throughput: float
        q: vec_s
        light: wp.vec3
        light_share: float
        light_rays: int
        alpha: float
        albedo: wp.vec3
        normal: wp.vec3
        distance: float
        hit: int
        rays: int
        shadow_rays: int
        early_rays: int
        early_shadow_rays: int

    @wp.func
    def numbers_of(key: rng.RngKey, step: int, allocation: vec_s, u_choice: float) -> VertexNumbers:
        """Those of one vertex; at the first that scatters u_choice makes its choices, elsewhere it is less than 0."""
        u = VertexNumbers()
        u.strategy = -1
        u.light = sampler.of_step(key, step, rng.LIGHT)
        u.scatter = sampler.of_step(key, step, rng.SCATTER)
        if wp.static(features.delta_light):
            u.delta_light = sampler.of_step(key, step, rng.DELTA_LIGHT)[0]
        if u_choice >= 0.0:
            left = u_choice
            if wp.static(has_mixture):
                u.strategy = strategies.choose(allocation, u_choice)
                left = strategies.left_of(allocation, u.strategy, u_choice)
            u.light[0] = left
            u.scatter[0] = left
            u.delta_light = u_choice
        return u

    @wp.func
    def followed(u: VertexNumbers, r: Receiver, s: Surface) -> VertexNumbers:
        """The numbers with what the choices of light and lobe leave over as the first number of the direction."""
        u.light[1] = r.left
        u.scatter[1] = surface.left_of(s, u.scatter[0])
        return u

    @wp.func
    def ended(path: PathSample, L: wp.vec3, has_mixed: bool, early: wp.vec3) -> PathSample:
        """The path with its light where it belongs: behind the mixture's vertex, of which `early` came before any
        roulette, or seen without one."""
        if not has_mixed:
            path.seen = L
            return path
        path.mixed = L
        if path.early_rays == 0:
            path.early_rays = path.rays
            path.early_shadow_rays = path.shadow_rays
        else:
            path.late = L - early
        return path

    @wp.func
    def Li(
        scene: SceneView,
        origin: wp.vec3,
        direction: wp.vec3,
        reach: float,
        key: rng.RngKey,
        allocation: vec_s,
        u_strategy: float,
        max_depth: int,
    ) -> PathSample:
        """Radiance arriving at `origin` from `direction`, by at most `max_depth` bounces after the first hit.

        Surfaces beyond `reach` are not in view. u_strategy chooses at the first vertex that scatters: the strategy of
        the mixture's direction, then a light and a lobe, then where the direction goes.
        """
        path = PathSample()
        path.throughput = 1.0
        L = wp.vec3(0.0, 0.0, 0.0)
        beta = wp.vec3(1.0, 1.0, 1.0)
        wi = direction
        start = origin  # of this stretch of the ray; surfaces that let it through divide it into several
        near = float(0.0)  # how far along the ray the stretch begins
        r = Receiver()
        r.x = origin
        arrival = int(SEEN)
        pdf_bsdf = float(0.0)
        p = vec_s()
        mixed = int(-1)  # the bounce at which the mixture was drawn from; none yet
        bounces = int(0)
        early = wp.vec3(0.0, 0.0, 0.0)
        survived = float(1.0)
        u_choice = float(u_strategy)  # until the first vertex that scatters has used it: then less than 0

        for step in range(max_depth + 1 + MAX_PASSED):
            hit = intersect.closest_hit(scene, start, wi)
            path.rays += 1
            if wp.static(features.clipping):
                if bounces == 0 and near + hit.distance > reach:
                    hit.distance = INFINITE_DISTANCE
            far = hit.distance
            if far < INFINITE_DISTANCE:
                far += near
            found = lights.gather(scene, r, wi, near, far, pdf_bsdf)
            emission = found.radiance
            if arrival >= WEIGHTED:
                emission = found.weighted
            if bounces == 0 and found.hits > 0:
                path.alpha = 1.0

            if wp.static(has_mixture):
                if arrival == MIXTURE or arrival == PAIRED:
                    finite = found.finite
                    if wp.static(features.mesh_light):
                        finite += lights.pdf_emitter_triangles(scene, r, wi)
                    p = strategies.completed(p, r, finite, found.infinite)
                    if arrival == MIXTURE:
                        p_a = wp.dot(allocation, p)
                        if p_a <= 0.0:
                            break
                        path.q = p / p_a
                        beta = beta / p_a
                        arrival = SEEN
                    if wp.static(paired):
                        if arrival == PAIRED:
                            path.q = p / (p[wp.static(strategies.bsdf)] + p[wp.static(strategies.light)])
                            arrival = WEIGHTED

            if hit.distance >= INFINITE_DISTANCE:
                L += wp.cw_mul(beta, emission)
                if mixed == bounces:
                    path.direct += wp.cw_mul(beta, emission)
                break
            material = materials.at(scene, hit.triangle, hit.u, hit.v)
            if wp.static(features.mesh_light):
                against = wp.where(arrival == WEIGHTED, pdf_bsdf, 0.0)
                emission += direct_light.from_mesh_light(scene, r, hit, material, wi, far, against)
            L += wp.cw_mul(beta, emission)
            if mixed == bounces:
                path.direct += wp.cw_mul(beta, emission)

            frame = intersect.shading_frame(scene, hit, material, wi)
            wo = to_local(frame, -wi)
            if wp.static(has_events):
                event = events.choose(material, wo[2], sampler.of_step(key, step, rng.EVENT)[0])
                beta = wp.cw_mul(beta, event.weight)
                if event.kind == PASS:
                    start = hit.p - hit.ng * hit.offset
                    near = far
                    continue
            if path.hit == 0 and bounces == 0:
                path.hit = 1
                path.alpha = 1.0
                path.albedo = material.diffuse + material.specular_f0
                path.normal = frame.n
                path.distance = far
            if bounces >= max_depth:
                break

            bounces += 1
            start = hit.p + hit.ng * hit.offset
            near = 0.0
            if wp.static(has_events):
                if event.kind == MIRROR:
                    wi = wp.normalize(to_world(frame, wp.vec3(-wo[0], -wo[1], wo[2])))
                    if wp.dot(wi, hit.ng) <= 0.0:
                        break
                    r = Receiver()
                    r.x = start
                    if wp.static(features.controlled):
                        r.prim = lights.control.prim_of(scene, hit)
                    arrival = SEEN
                    continue

            u = numbers_of(key, step, allocation, u_choice)
            r = lights.receiver(scene, start, frame.n, u.light[0])
            if wp.static(features.controlled):
                r.prim = lights.control.prim_of(scene, hit)
            s = surface.prepare(material, wo)
            if u_choice >= 0.0:
                u = followed(u, r, s)
                u_choice = -1.0
            if wp.static(features.delta_light):
                from_delta = direct_light.from_delta_light(scene, r, frame, hit.ng, s, u.delta_light)
                L += wp.cw_mul(beta, from_delta.radiance)
                path.shadow_rays += from_delta.rays
            arrival = WEIGHTED
            if wp.static(has_mixture):
                if mixed < 0:
                    mixed = bounces
                    path.seen = L
                    L = wp.vec3(0.0, 0.0, 0.0)
                    # Pairs are taken before any pixel has shares.
                    arrival = wp.static(PAIRED if paired else MIXTURE)
                if wp.static(not paired):
                    if arrival == MIXTURE:
                        # Until the direction's densities are known the path is of the strategy that drew it alone.
                        path.q = strategies.drawn_by(u.strategy, allocation)
                        drawn = strategies.sample(scene, r, frame, s, u.strategy, u.scatter, u.light)
                        wi = drawn.wi
                        r.drawn = drawn.light
                        r.drawn_distance = drawn.distance
                        r.drawn_pdf = drawn.pdf_of_light
            if wp.static(has_next_event):
                if arrival >= WEIGHTED:
                    from_light = direct_light.from_light_sample(scene, r, frame, hit.ng, s, u.light)
                    L += wp.cw_mul(beta, from_light.radiance)
                    path.shadow_rays += from_light.rays
                    if wp.static(paired):
                        if arrival == PAIRED:
                            path.light = L
                            path.light_share = from_light.share
                            path.light_rays = from_light.rays
                    wi = to_world(frame, surface.sample(s, u.scatter))

            if wp.dot(wi, hit.ng) <= 0.0:
                break
            local = to_local(frame, wi)
            scattering = surface.evaluate(s, local)
            pdf_bsdf = scattering.pdf_solid_angle
            if wp.static(features.light_response):
                r.diffuse = scattering.diffuse
            if wp.static(has_mixture):
                if arrival == MIXTURE or arrival == PAIRED:
                    p = strategies.vertex_densities(s, local[2], scattering)
            beta = wp.cw_mul(beta, scattering.f_cos)
            if luminance(beta) <= 0.0:
                break
            if arrival >= WEIGHTED:
                beta = beta / pdf_bsdf
                if wp.static(features.indirect):
                    if bounces >= roulette.DEPTH:
                        throughput = wp.max(beta)
                        if path.early_rays == 0:
                            path.early_rays = path.rays
                            path.early_shadow_rays = path.shadow_rays
                            early = L
                        path.throughput = throughput * survived
                        survival = roulette.survival(throughput)
                        if rng.uniform4_of_step(key, step, rng.EVENT)[2] >= survival:
                            break
                        beta = beta / survival
                        survived = survived * survival
        return ended(path, L, mixed >= 0, early)

    return SimpleNamespace(Li=Li, PathSample=PathSample, strategies=strategies, paired=paired)
