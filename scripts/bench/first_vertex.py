"""What light samples and BSDF samples find at the first vertex, sample by sample, for estimates that are made offline.

`Recorder` traces a sample to its first vertex and takes several light samples and several paths from there. It keeps
each with its densities, unweighted, so that any weights, counts and control variates can be tried on the same records
(weights.py). A pixel's samples come in rounds of `samples`, each on a lattice with shifts of its own: the spread of a
round's mean over rounds is the error of that many samples.

Paths that meet a mirror, glass or a transparent surface first are not divided: all of their light is `rest`.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpmis.device.kernel_factory import device_kernel
from warpmis.device.upload import upload
from warpmis.device.views import CameraView, SceneView, vec_lattice
from warpmis.kernels import lattice, rng
from warpmis.kernels.bsdf.events import NONE, make_events
from warpmis.kernels.bsdf.surface import make_surface
from warpmis.kernels.camera import CameraRay, make_camera
from warpmis.kernels.direct_light import make_direct_light
from warpmis.kernels.intersect import make_intersect
from warpmis.kernels.light.distant import INFINITE_DISTANCE
from warpmis.kernels.light.records import Receiver, Response
from warpmis.kernels.light.table import make_lights
from warpmis.kernels.material import make_material
from warpmis.kernels.moments import SHADOW_RAY_COST
from warpmis.kernels.path.li import make_path
from warpmis.kernels.path.state import Vertex
from warpmis.kernels.path.vertex import response_of
from warpmis.kernels.sampler import make_sampler
from warpmis.kernels.shading_frame import luminance, to_local, to_world
from warpmis.kernels.strategies import make_strategies
from warpmis.rendering.generating_vector import lattice_steps
from warpmis.scene import Scene
from warpmis.scene.features import Features, detect

wp.set_module_options({"enable_backward": False})

# Light samples and paths of a vertex.
LIGHTS, PATHS = 4, 2
# What the numbers of a path's later vertices have in common.
TAIL = wp.constant(wp.uint32(0x5EED))


@wp.struct
class Request:
    """samples: of a round; first_round: number of the first one; rounds: of each pixel; lattice: steps."""

    seed: wp.uint32
    samples: int
    first_round: int
    rounds: int
    max_depth: int
    lattice: vec_lattice


@wp.struct
class FirstVertex:
    """is_there: False where the path ends or meets a mirror, and light is all that it brought; light: else what no
    light sample could find, seen straight from the camera or by delta lights."""

    is_there: bool
    light: float
    vertex: Vertex
    receiver: Receiver


@dataclass(frozen=True, eq=False)
class Records:
    """Luminances and densities, shape (pixels, rounds, samples, ...) each.

    Attributes:
        rest: light that is not divided.
        is_there: whether there is a first vertex.
        light: f / p_light of each light sample, 0 of one that found nothing; shape (..., LIGHTS).
        light_bsdf: p_bsdf / (p_light + p_bsdf) of its direction; 0 where it could not contribute.
        light_rays: its shadow rays.
        direct, indirect: f / p_bsdf of each path, from the lights that its first ray meets and from all else;
            shape (..., PATHS).
        path_bsdf: p_bsdf / (p_light + p_bsdf) of its direction; 1 where it could not contribute.
        path_cost: of its rays.
        has_lights: whether any light could be sampled at the vertex.
    """

    rest: NDArray[np.float32]
    is_there: NDArray[np.bool_]
    light: NDArray[np.float32]
    light_bsdf: NDArray[np.float32]
    light_rays: NDArray[np.float32]
    direct: NDArray[np.float32]
    indirect: NDArray[np.float32]
    path_bsdf: NDArray[np.float32]
    path_cost: NDArray[np.float32]
    has_lights: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class MixtureRecords:
    """Of the mixture with equal shares, shape (pixels, rounds, samples, ...).

    Attributes:
        F: f / p_a, and all of the light of paths without a first vertex.
        q: p_s / p_a of the direction, 1 / a_s for the strategy alone where it could not contribute, and 1 without a
            first vertex; shape (..., S). Its mean is 1.
        strategy: which one drew it.
    """

    F: NDArray[np.float32]
    q: NDArray[np.float32]
    strategy: NDArray[np.int32]


class Recorder:
    """Records of one scene, on the CPU."""

    def __init__(
        self, scene: Scene, *, sampler: str = "lattice", max_depth: int = 8, strategies: tuple[str, ...] = ()
    ) -> None:
        self.scene = upload(scene, "cpu")
        self.max_depth = max_depth
        self.strategies = strategies
        self.features = detect(scene).with_depth(max_depth).with_sampler(sampler)
        if strategies:
            self.kernel = mixture_kernel(self.features.with_strategies(strategies))
        else:
            self.kernel = pair_kernel(self.features)

    @property
    def width(self) -> int:
        return int(self.scene.camera.width)

    @property
    def pixels(self) -> int:
        return int(self.width * self.scene.camera.height)

    def _request(self, samples: int, rounds: range, seed: int) -> Request:
        request = Request()
        request.seed = seed
        request.samples = samples
        request.first_round, request.rounds = rounds.start, len(rounds)
        request.max_depth = self.max_depth
        request.lattice = vec_lattice(*lattice_steps(samples))
        return request

    def pairs(self, pixels: NDArray[np.integer], samples: int, rounds: range, seed: int = 1) -> Records:
        """Records of some pixels by next-event estimation, with LIGHTS light samples and PATHS paths each."""
        shape = (len(pixels), len(rounds), samples)
        count = int(np.prod(shape))
        with wp.ScopedDevice("cpu"):
            rest = wp.zeros(count, dtype=wp.vec3)
            light = wp.zeros((count, LIGHTS), dtype=wp.vec3)
            paths = wp.zeros((count, PATHS), dtype=wp.vec4)
            own = wp.array(np.asarray(pixels, np.int32), dtype=int)
            request = self._request(samples, rounds, seed)
            inputs = [self.scene.view, self.scene.camera, request, own, rest, light, paths]
            wp.launch(self.kernel, dim=len(pixels) * len(rounds), inputs=inputs)
        r, li, p = rest.numpy(), light.numpy(), paths.numpy()
        r = r.reshape(*shape, 3)
        li = li.reshape(*shape, LIGHTS, 3)
        p = p.reshape(*shape, PATHS, 4)
        parts = [np.ascontiguousarray(one[..., i]) for one, n in ((li, 3), (p, 4)) for i in range(n)]
        light_parts, path_parts = parts[:3], parts[3:]
        direct, indirect, path_bsdf, path_cost = path_parts
        return Records(
            r[..., 0], r[..., 1] > 0, *light_parts, direct, indirect, path_bsdf, path_cost, has_lights=r[..., 2] > 0
        )

    def mixture(self, pixels: NDArray[np.integer], samples: int, rounds: range, seed: int = 1) -> MixtureRecords:
        """Records of some pixels by the mixture of the strategies with equal shares."""
        shape = (len(pixels), len(rounds), samples)
        count, strategies = int(np.prod(shape)), len(self.strategies)
        with wp.ScopedDevice("cpu"):
            found = wp.zeros((count, strategies + 2), dtype=float)
            own = wp.array(np.asarray(pixels, np.int32), dtype=int)
            request = self._request(samples, rounds, seed)
            inputs = [self.scene.view, self.scene.camera, request, own, found]
            wp.launch(self.kernel, dim=len(pixels) * len(rounds), inputs=inputs)
        values = found.numpy().reshape(*shape, strategies + 2)
        return MixtureRecords(values[..., 0], values[..., 2:], values[..., 1].astype(np.int32))


def make_first_vertex(features: Features) -> SimpleNamespace:
    """Functions key_of, numbers, first_vertex, light_sample, tail, completed; and the parts that they are made of."""
    intersect = make_intersect(features)
    lights = make_lights(features)
    surface = make_surface(features)
    materials = make_material(features)
    events = make_events(features, intersect.transparency)
    direct_light = make_direct_light(features, surface, lights, intersect)
    strategies = make_strategies(features, surface, lights)
    sampler = make_sampler(features)
    camera_ray = make_camera(features)
    path = make_path(features.with_strategies(()).with_sampler("independent"))
    Li = path.Li
    vec_0 = path.strategies.vec_s
    has_events = features.smooth or features.opacity or features.transmission
    on_lattice = features.sampler == "lattice"

    @wp.func
    def key_of(request: Request, pixel: int, round: int, k: int) -> rng.RngKey:
        key = rng.RngKey()
        key.seed = request.seed
        key.pixel = wp.uint32(pixel)
        key.round = wp.uint32((request.first_round + round) * request.samples)
        key.sample = key.round + wp.uint32(k)
        key.lattice = request.lattice
        return key

    @wp.func
    def between(u: float, step: wp.uint32, replicate: int, of: int) -> float:
        """A number `replicate` of so many parts of the lattice's step further on."""
        v = u + float(step >> wp.uint32(8)) * 5.9604644775390625e-08 * float(replicate) / float(of)
        return wp.min(v - wp.floor(v), rng.ONE_MINUS_EPSILON)

    @wp.func
    def numbers(key: rng.RngKey, replicate: int, of: int) -> Vertex:
        """A vertex with its random numbers: of several replicates, those in between fill the lattice up."""
        own = key
        if wp.static(not on_lattice):
            own.seed = key.seed + wp.uint32(7919 * replicate)
        vertex = Vertex()
        vertex.u_light = sampler.of_step(own, 0, rng.LIGHT)
        vertex.u_bsdf = sampler.of_step(own, 0, rng.SCATTER)
        if wp.static(on_lattice):
            vertex.u_light[2] = between(vertex.u_light[2], key.lattice[1], replicate, of)
            vertex.u_light[3] = between(vertex.u_light[3], key.lattice[8], replicate, of)
            vertex.u_bsdf[2] = between(vertex.u_bsdf[2], key.lattice[2], replicate, of)
        u = between(lattice.choice(key), key.lattice[0], replicate, of)
        vertex.u_light[0] = u
        vertex.u_bsdf[0] = u
        vertex.u_delta = u
        return vertex

    @wp.func
    def tail(scene: SceneView, x: wp.vec3, wi: wp.vec3, key: rng.RngKey, replicate: int, max_depth: int) -> wp.vec4:
        """Radiance along a ray by a path of so many bounces, and the cost of its rays."""
        own = key
        own.seed = (key.seed + wp.uint32(replicate)) ^ TAIL
        ray = CameraRay()
        ray.origin = x
        ray.direction = wi
        ray.reach = INFINITE_DISTANCE
        found = Li(scene, ray, own, vec_0(), rng.uniform4(own, rng.CHOICE)[0], max_depth)
        return wp.vec4(
            found.L[0], found.L[1], found.L[2], float(found.rays) + SHADOW_RAY_COST * float(found.shadow_rays)
        )

    @wp.func
    def radiance_of(light: wp.vec4) -> wp.vec3:
        return wp.vec3(light[0], light[1], light[2])

    @wp.func
    def first_vertex(scene: SceneView, camera: CameraView, key: rng.RngKey, pixel: int, max_depth: int) -> FirstVertex:
        found = FirstVertex()
        u_pixel = sampler.of_pixel(key, rng.CAMERA)
        ray = camera_ray(camera, key, pixel, u_pixel[0], u_pixel[1])
        hit = intersect.closest_hit(scene, ray.origin, ray.direction)
        if wp.static(features.clipping) and hit.distance > ray.reach:
            hit.distance = INFINITE_DISTANCE
        seen = tail(scene, ray.origin, ray.direction, key, 0, 0)
        found.light = luminance(radiance_of(seen))
        if hit.distance >= INFINITE_DISTANCE:
            return found
        material = materials.at(scene, hit.triangle, hit.instance, hit.u, hit.v)
        frame = intersect.shading_frame(scene, hit, material, ray.direction)
        wo = to_local(frame, -ray.direction)
        if wp.static(has_events):
            event = events.choose(scene, material, wo[2], sampler.of_step(key, 0, rng.EVENT)[0])
            if event.kind != NONE:
                whole = tail(scene, ray.origin, ray.direction, key, 0, max_depth)
                found.light = luminance(radiance_of(whole))
                return found
        found.is_there = True
        found.vertex.ng = hit.ng
        found.vertex.frame = frame
        found.vertex.surface = surface.prepare(scene, material, wo)
        found.receiver.x = hit.p + hit.ng * hit.offset
        return found

    @wp.func
    def choose(scene: SceneView, first: wp.ref[FirstVertex], u: float):
        """A light and a lobe by u, what is left of which is the direction's first number."""
        x = first.receiver.x
        frame = first.vertex.frame
        response = Response()
        if wp.static(features.glossy_choice):
            response = response_of(first.vertex.surface, frame)
        first.receiver = lights.receiver(scene, x, frame.n, 0, u, first.vertex.u_light[1], response)
        first.vertex.u_light[0] = u
        first.vertex.u_bsdf[0] = u
        first.vertex.u_light[1] = first.receiver.choice.u_remapped
        first.vertex.u_bsdf[1] = surface.remapped(first.vertex.surface, u)

    @wp.func
    def ready(scene: SceneView, first: wp.ref[FirstVertex], key: rng.RngKey, replicate: int, of: int):
        """Give the vertex its numbers and a light."""
        vertex = numbers(key, replicate, of)
        first.vertex.u_light = vertex.u_light
        first.vertex.u_bsdf = vertex.u_bsdf
        first.vertex.u_delta = vertex.u_delta
        choose(scene, first, vertex.u_light[0])

    @wp.func
    def light_density(scene: SceneView, r: wp.ref[Receiver], wi: wp.vec3, distance: float) -> wp.vec2:
        """Density times importance of the lights on the line, at a distance and at infinity."""
        on_ray = lights.gather(scene, r, wi, 0.0, distance, 0.0, True)
        finite = on_ray.finite
        if wp.static(features.mesh_light):
            finite += lights.pdf_emitter_triangles(scene, r, wi)
        return wp.vec2(finite, on_ray.infinite)

    return SimpleNamespace(
        key_of=key_of,
        tail=tail,
        radiance_of=radiance_of,
        first_vertex=first_vertex,
        choose=choose,
        ready=ready,
        light_density=light_density,
        intersect=intersect,
        surface=surface,
        direct_light=direct_light,
        strategies=strategies,
        delta=features.delta_light,
    )


def pair_kernel(features: Features) -> wp.Kernel:
    """Light samples and paths of each sample's first vertex."""
    part = make_first_vertex(features)
    surface, intersect, direct_light = part.surface, part.intersect, part.direct_light

    @wp.func
    def light_sample(scene: SceneView, first: wp.ref[FirstVertex]) -> wp.vec3:
        """Records.light, light_bsdf, light_rays."""
        sample = direct_light.light_sample(scene, first.receiver, first.vertex)
        if sample.pdf <= 0.0:
            return wp.vec3(0.0, 0.0, 0.0)
        f = direct_light.shadowed(scene, first.receiver, sample)
        return wp.vec3(luminance(f) / sample.pdf, sample.pdf_bsdf / (sample.pdf + sample.pdf_bsdf), 1.0)

    @wp.func
    def path_sample(
        scene: SceneView, first: wp.ref[FirstVertex], key: rng.RngKey, replicate: int, max_depth: int
    ) -> wp.vec4:
        """Records.direct, indirect, path_bsdf, path_cost."""
        local = surface.sample(first.vertex.surface, first.vertex.u_bsdf)
        wi = to_world(first.vertex.frame, local)
        scattering = surface.evaluate(first.vertex.surface, to_local(first.vertex.frame, wi))
        if wp.dot(wi, first.vertex.ng) <= 0.0 or luminance(scattering.f_cos) <= 0.0:
            return wp.vec4(0.0, 0.0, 1.0, 0.0)
        factor = scattering.f_cos / scattering.pdf_solid_angle
        hit = intersect.closest_hit(scene, first.receiver.x, wi)
        p = part.light_density(scene, first.receiver, wi, hit.distance)
        p_light = 0.0
        if first.receiver.total > 0.0:
            p_light = (p[0] + p[1]) / first.receiver.total
        met = part.tail(scene, first.receiver.x, wi, key, replicate, 0)
        all = part.tail(scene, first.receiver.x, wi, key, replicate, max_depth - 1)
        direct = luminance(wp.cw_mul(factor, part.radiance_of(met)))
        indirect = luminance(wp.cw_mul(factor, part.radiance_of(all))) - direct
        return wp.vec4(direct, indirect, scattering.pdf_solid_angle / (scattering.pdf_solid_angle + p_light), all[3])

    def record_pairs(
        scene: SceneView,
        camera: CameraView,
        request: Request,
        pixels: wp.array(dtype=int),
        rest: wp.array(dtype=wp.vec3),
        light: wp.array2d(dtype=wp.vec3),
        paths: wp.array2d(dtype=wp.vec4),
    ):
        pixel = pixels[wp.tid() / request.rounds]
        for k in range(request.samples):
            at = wp.tid() * request.samples + k
            key = part.key_of(request, pixel, wp.tid() % request.rounds, k)
            first = part.first_vertex(scene, camera, key, pixel, request.max_depth)
            of_rest = first.light
            if first.is_there:
                for replicate in range(LIGHTS):
                    part.ready(scene, first, key, replicate, LIGHTS)
                    light[at, replicate] = light_sample(scene, first)
                if wp.static(part.delta):
                    part.ready(scene, first, key, 0, LIGHTS)
                    delta = direct_light.from_delta_light(scene, first.receiver, first.vertex)
                    of_rest += luminance(delta.radiance)
                for replicate in range(PATHS):
                    part.ready(scene, first, key, replicate, PATHS)
                    paths[at, replicate] = path_sample(scene, first, key, replicate, request.max_depth)
            rest[at] = wp.vec3(
                of_rest, wp.where(first.is_there, 1.0, 0.0), wp.where(first.receiver.total > 0.0, 1.0, 0.0)
            )

    return device_kernel(record_pairs, f"record_pairs_{features.sampler}")


def mixture_kernel(features: Features) -> wp.Kernel:
    """The mixture of the features' strategies with equal shares: F, the strategy and the ratios q of each sample."""
    part = make_first_vertex(features)
    surface, intersect, direct_light, strategies = part.surface, part.intersect, part.direct_light, part.strategies
    count = strategies.count
    vec_s = strategies.vec_s

    def record_mixture(
        scene: SceneView,
        camera: CameraView,
        request: Request,
        pixels: wp.array(dtype=int),
        found: wp.array2d(dtype=float),
    ):
        pixel = pixels[wp.tid() / request.rounds]
        shares = vec_s()
        for s in range(wp.static(count)):
            shares[s] = wp.static(1.0 / count)
        for k in range(request.samples):
            at = wp.tid() * request.samples + k
            key = part.key_of(request, pixel, wp.tid() % request.rounds, k)
            first = part.first_vertex(scene, camera, key, pixel, request.max_depth)
            F = first.light
            q = vec_s()
            for s in range(wp.static(count)):
                q[s] = 1.0
            strategy = -1
            if first.is_there:
                u = lattice.choice(key)
                strategy = strategies.choose(shares, u)
                part.ready(scene, first, key, 0, 1)
                if wp.static(part.delta):
                    F += luminance(direct_light.from_delta_light(scene, first.receiver, first.vertex).radiance)
                u = strategies.remapped(shares, strategy, u)
                part.choose(scene, first, u)
                q = strategies.one_strategy_ratios(shares, strategy)
                drawn = strategies.sample(scene, first.receiver, first.vertex, strategy)
                local = to_local(first.vertex.frame, drawn.wi)
                scattering = surface.evaluate(first.vertex.surface, local)
                if wp.dot(drawn.wi, first.vertex.ng) > 0.0 and luminance(scattering.f_cos) > 0.0:
                    first.receiver.drawn = drawn.light
                    first.receiver.drawn_distance = drawn.distance
                    first.receiver.drawn_pdf = drawn.pdf_of_light
                    hit = intersect.closest_hit(scene, first.receiver.x, drawn.wi)
                    of_lights = part.light_density(scene, first.receiver, drawn.wi, hit.distance)
                    p = strategies.vertex_densities(first.vertex.surface, local[2], scattering)
                    p = strategies.completed(p, first.receiver, of_lights[0], of_lights[1])
                    p_a = wp.dot(shares, p)
                    if p_a > 0.0:
                        q = p / p_a
                        all = part.tail(scene, first.receiver.x, drawn.wi, key, 0, request.max_depth - 1)
                        F += luminance(wp.cw_mul(scattering.f_cos, part.radiance_of(all))) / p_a
            found[at, 0] = F
            found[at, 1] = float(strategy)
            for s in range(wp.static(count)):
                found[at, wp.static(2) + s] = q[s]

    return device_kernel(record_mixture, f"record_mixture_{features.sampler}_{'_'.join(features.strategies)}")
