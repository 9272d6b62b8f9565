"""The path tracer: the radiance that arrives along a camera ray.

A path goes from surface to surface. Each ray adds the emission that it meets; each vertex adds the light of a light
sample, and draws the direction of the next ray. Who may do that in which way is the estimator's business: next-event
estimation (next_event.py), or at the first vertex the mixture of strategies whose shares are learned (mixture.py).

Reference: Kajiya (1986), "The Rendering Equation".
"""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import SceneView
from warpmis.kernels import rng
from warpmis.kernels.bsdf.dielectric import is_rough_interface
from warpmis.kernels.bsdf.events import INTERFACE, MIRROR, PASS, make_events
from warpmis.kernels.bsdf.rough_interface import InterfaceSide
from warpmis.kernels.bsdf.surface import make_surface
from warpmis.kernels.camera import CameraRay
from warpmis.kernels.direct_light import make_direct_light
from warpmis.kernels.intersect import make_intersect
from warpmis.kernels.light.distant import INFINITE_DISTANCE
from warpmis.kernels.light.table import make_lights
from warpmis.kernels.material import make_material
from warpmis.kernels.path.emission import make_emission
from warpmis.kernels.path.estimator import make_estimator
from warpmis.kernels.path.interface import make_interface
from warpmis.kernels.path.specular import make_specular
from warpmis.kernels.path.state import first_hit_of
from warpmis.kernels.path.throughput import make_throughput
from warpmis.kernels.path.vertex import make_vertex
from warpmis.kernels.sampler import make_sampler
from warpmis.kernels.shading_frame import to_local
from warpmis.kernels.shadow import MAX_TRANSPARENT
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})


def make_path(
    features: Features, intersect: SimpleNamespace | None = None, sampler: SimpleNamespace | None = None
) -> SimpleNamespace:
    """The function Li for one set of effects, its result type PathState, and the estimator's `strategies`.

    intersect: functions in place of make_intersect's, for those who watch the rays; sampler: in place of
    make_sampler's, for those who give the numbers.
    """
    intersect = intersect or make_intersect(features)
    sampler = sampler or make_sampler(features)
    lights = make_lights(features)
    surface = make_surface(features)
    materials = make_material(features)
    events = make_events(features, intersect.transparency)
    direct_light = make_direct_light(features, surface, lights, intersect)
    estimator = make_estimator(features, surface, lights, direct_light, sampler)
    record = estimator.record
    PathState = estimator.PathState
    vec_s = estimator.strategies.vec_s
    contributions = estimator.contributions
    emission = make_emission(features, PathState, lights, record, contributions)
    specular = make_specular(features, PathState, lights, contributions)
    vertices = make_vertex(features, PathState, surface, lights, direct_light, contributions, sampler)
    interface = make_interface(features, PathState, specular, vertices, estimator, sampler)
    throughput = make_throughput(features, surface, estimator)
    branches = features.allocation == "counts"
    has_events = features.smooth or features.opacity or features.transmission

    @wp.func
    def camera_path(scene: SceneView, ray: CameraRay, key: rng.RngKey, allocation: vec_s, u_choice: float) -> PathState:
        """A path that has not met anything."""
        path = PathState()
        path.beta = wp.vec3(1.0, 1.0, 1.0)
        path.origin = ray.origin
        path.wi = ray.direction
        path.receiver.x = ray.origin
        contributions.begin(path, key)
        estimator.begin(scene, path, key, allocation, u_choice)
        return path

    @wp.func
    def follow(
        scene: SceneView, path: wp.ref[PathState], ray: CameraRay, key: rng.RngKey, first_step: int, max_depth: int
    ):
        """Go on with a path from a step on, until it ends."""
        for step in range(first_step, max_depth + 1 + MAX_TRANSPARENT):
            # Follow the ray to a surface; surfaces beyond the camera's clipping planes are not in view.
            hit = intersect.closest_hit(scene, path.origin, path.wi)
            path.rays += 1
            if wp.static(features.clipping):
                if path.bounces == 0 and path.travelled + hit.distance > ray.reach:
                    hit.distance = INFINITE_DISTANCE
            distance = hit.distance  # from the last vertex
            if distance < INFINITE_DISTANCE:
                distance += path.travelled

            # Find the lights on the way there, with which the density of the ray's direction is known at last.
            contributions.begin_ray(path)
            on_ray = lights.gather(
                scene,
                path.receiver,
                path.wi,
                path.travelled,
                distance,
                path.pdf,
                estimator.asks_whole_line(path),
            )
            if not estimator.weigh_ray(scene, path, on_ray):
                break

            # Add their emission, and that of the surface where there is one.
            emitted = emission.of_lights(path, on_ray)
            if path.bounces == 0 and on_ray.hits > 0:
                path.first_hit.alpha = 1.0
            if hit.distance >= INFINITE_DISTANCE:
                emission.add(scene, path, emitted)
                break
            material = materials.at(scene, hit.triangle, hit.instance, hit.u, hit.v)
            if wp.static(features.mesh_light):
                emitted += emission.of_surface(scene, path, hit, material, distance)
            emission.add(scene, path, emitted)
            if wp.static(features.absorption):
                path.beta = wp.cw_mul(path.beta, emission.arriving(path, hit, material))

            # A surface may let the path pass straight through.
            frame = intersect.shading_frame(scene, hit, material, path.wi)
            wo = to_local(frame, -path.wi)
            if wp.static(has_events):
                event = events.choose(scene, material, wo[2], sampler.of_step(key, step, rng.EVENT)[0])
                path.beta = wp.cw_mul(path.beta, event.weight)
                if event.kind == PASS:
                    specular.pass_through(path, hit, distance)
                    continue

            # Here is a vertex. The camera's is what the auxiliary pictures show.
            if path.bounces == 0:
                path.first_hit = first_hit_of(material, frame, distance)
            if path.bounces >= max_depth:
                break
            path.bounces += 1
            path.origin = hit.p + hit.ng * hit.offset
            path.travelled = 0.0

            # A mirror has a single direction, which no light sample can be drawn in.
            if wp.static(has_events):
                if event.kind == MIRROR:
                    if not specular.reflect(scene, path, hit, frame, wo):
                        break
                    continue
            # Nor has a smooth interface. At a rough one the vertex looks to the side to which the path goes.
            side = InterfaceSide()
            if wp.static(features.rough_transmission):
                if event.kind == INTERFACE and is_rough_interface(material):
                    u = event.u_remapped
                    side = interface.add_light_and_choose_side(scene, path, hit, material, frame, wo, u, key, step)
            if wp.static(features.transmission):
                if event.kind == INTERFACE and not side.is_present:
                    if not interface.cross(scene, path, hit, material, frame, wo, event.u_remapped, key, step):
                        break
                    continue

            # All else scatters: add the light of light samples, and draw a direction.
            path.is_first = not path.has_scattered and not side.is_present
            estimator.arrive(scene, path, frame, key, step)
            vertex = vertices.prepare(scene, path, hit, material, frame, wo, side, key, step)
            if wp.static(features.delta_light):
                vertices.add_delta_light(scene, path, vertex)
            estimator.scatter(scene, path, vertex)
            path.has_scattered = path.has_scattered or path.is_first

            # Go on with the throughput in that direction, unless Russian roulette ends the path.
            if not throughput.update(scene, path, vertex, key, step):
                break

    @wp.func
    def Li(
        scene: SceneView, ray: CameraRay, key: rng.RngKey, allocation: vec_s, u_choice: float, max_depth: int
    ) -> PathState:
        """The path of a camera ray, of at most `max_depth` bounces after the first hit; its L is the radiance.

        allocation: of the strategies, where there are any; u_choice: in [0, 1), makes the choices at the first
        vertex that is no mirror: of the strategy, then of a light and a lobe, then where the direction goes.
        """
        path = camera_path(scene, ray, key, allocation, u_choice)
        if wp.static(branches):
            branch = int(0)
            while branch == 0 or branch < path.estimate.branches:
                own = key
                first_step = int(0)
                goes_on = bool(True)
                if branch > 0:
                    own = estimator.begin_branch(path, key, branch)
                    first_step = path.estimate.step + 1
                    goes_on = throughput.update(scene, path, path.estimate.vertex, own, path.estimate.step)
                if goes_on:
                    follow(scene, path, ray, own, first_step, max_depth)
                record.branch(path, branch, path.estimate.branches)
                branch += 1
        else:
            follow(scene, path, ray, key, 0, max_depth)
        record.end(scene, path)
        return path

    return SimpleNamespace(Li=Li, PathState=PathState, strategies=estimator.strategies, contributions=contributions)
