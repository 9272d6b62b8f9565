"""The path's way through a dielectric interface: a smooth one is crossed, a rough one is a vertex on either side.

On the side to which the path goes the vertex is like any other. On the other side it takes light samples alone.
"""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import MaterialView, SceneView
from warpmis.kernels import rng
from warpmis.kernels.bsdf.dielectric import sample_interface
from warpmis.kernels.bsdf.rough_interface import InterfaceSide, chance_beyond, side_of, to_other_side, turned
from warpmis.kernels.hit import Hit
from warpmis.kernels.shading_frame import Frame
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})


def make_interface(
    features: Features,
    PathState: type,
    specular: SimpleNamespace,
    vertices: SimpleNamespace,
    estimator: SimpleNamespace,
    sampler: SimpleNamespace,
) -> SimpleNamespace:
    """Functions: cross, add_light_and_choose_side."""
    contributions = estimator.contributions

    @wp.func
    def go_beyond(path: wp.ref[PathState], hit: wp.ref[Hit], material: MaterialView):
        """Into the medium behind the surface."""
        path.origin = hit.p - hit.ng * hit.offset
        if wp.static(features.absorption):
            if not material.thin_walled:
                path.receiver.absorption = wp.where(hit.is_front, material.absorption, wp.vec3(0.0, 0.0, 0.0))

    @wp.func
    def cross(
        scene: SceneView,
        path: wp.ref[PathState],
        hit: wp.ref[Hit],
        material: MaterialView,
        frame: Frame,
        wo: wp.vec3,
        u_choice: float,
        key: rng.RngKey,
        step: int,
    ) -> bool:
        """Reflect or refract the path in a direction that no light sample finds; False where it ends there."""
        u = sampler.independent_of_step(key, step, rng.SCATTER)
        s = sample_interface(material, wo, hit.is_front, u_choice, u)
        path.beta = wp.cw_mul(path.beta, s.weight)
        if s.is_refracted:
            go_beyond(path, hit, material)
        specular.leave(scene, path, hit, frame, s.wi)
        contributions.scatter(path, wp.vec3(0.0, 0.0, 0.0), s.is_refracted)
        cosine = wp.dot(path.wi, hit.ng)
        return wp.length_sq(s.wi) > 0.0 and wp.where(s.is_refracted, cosine < 0.0, cosine > 0.0)

    @wp.func
    def turn(hit: wp.ref[Hit], frame: wp.ref[Frame]):
        """Look to the other side."""
        hit.ng = -hit.ng
        other = turned(frame)
        frame.s = other.s
        frame.t = other.t
        frame.n = other.n

    @wp.func
    def add_light(
        scene: SceneView,
        path: wp.ref[PathState],
        hit: wp.ref[Hit],
        material: MaterialView,
        frame: wp.ref[Frame],
        wo: wp.vec3,
        side: InterfaceSide,
        key: rng.RngKey,
        step: int,
    ):
        """Of light samples on one side; all else stays as it is."""
        origin = path.origin
        receiver = path.receiver
        if side.is_beyond:
            go_beyond(path, hit, material)
            turn(hit, frame)
        vertex = vertices.prepare(scene, path, hit, material, frame, wo, side, key, step)
        if wp.static(features.delta_light):
            vertices.add_delta_light(scene, path, vertex)
        estimator.add_light(scene, path, vertex)
        if side.is_beyond:
            turn(hit, frame)
        path.origin = origin
        path.receiver = receiver

    @wp.func
    def add_light_and_choose_side(
        scene: SceneView,
        path: wp.ref[PathState],
        hit: wp.ref[Hit],
        material: MaterialView,
        frame: wp.ref[Frame],
        wo: wp.vec3,
        u: float,
        key: rng.RngKey,
        step: int,
    ) -> InterfaceSide:
        """Turn the hit and its frame to the side where the path goes on, and add the light that the other samples."""
        path.is_first = False
        near = side_of(material, hit.is_front, False)
        beyond = side_of(material, hit.is_front, True)
        beyond.chance = chance_beyond(beyond, wo, material.alpha)
        near.chance = 1.0 - beyond.chance
        goes_beyond = u < beyond.chance
        if estimator.draws_by_bsdf(scene, path, frame, beyond.chance, key, step):
            drawn = sample_interface(material, wo, hit.is_front, u, sampler.independent_of_step(key, step, rng.SCATTER))
            goes_beyond = drawn.is_refracted
            near.drawn = drawn.wi
            beyond.drawn = to_other_side(drawn.wi)
        if not goes_beyond:
            add_light(scene, path, hit, material, frame, wo, beyond, key, step)
            return near
        add_light(scene, path, hit, material, frame, wo, near, key, step)
        go_beyond(path, hit, material)
        turn(hit, frame)
        return beyond

    return SimpleNamespace(cross=cross, add_light_and_choose_side=add_light_and_choose_side)
