"""Emissive triangles where they stand: in world space, or in a place of a prototype, whose transform carries them.

Lights are chosen among places in world space, and among the triangles of a place in the prototype's space, into which
the receiver is carried: a plane stays a plane there, so that what is below its horizon or behind an emitter stays so,
and an estimate is 0 for the same lights. Its value is the world's where the place turns and scales alike in all
directions, but for a factor that all triangles share.
"""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import SceneView
from warpmis.kernels.hit import NO_INSTANCE
from warpmis.kernels.instances import nonzero, normal_to_world
from warpmis.kernels.light.records import Receiver
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})


@wp.struct
class Emitter:
    """An emissive triangle in world space: a corner, the edges from there, and the unit normal of its front."""

    p0: wp.vec3
    e1: wp.vec3
    e2: wp.vec3
    n: wp.vec3


@wp.func
def area_of(emitter: Emitter) -> float:
    return 0.5 * wp.length(wp.cross(emitter.e1, emitter.e2))


@wp.func
def first_place_leaf(scene: SceneView) -> int:
    """The leaf of SceneView.light_tree that is the first of emitter_places."""
    return scene.analytic_light_count + scene.emitter_triangles.shape[0]


@wp.func
def receiver_in_place(scene: SceneView, r: wp.ref[Receiver], instance: int) -> Receiver:
    """The receiver in the space of the instance's prototype, as far as light trees ask for it."""
    place = scene.instances[instance]
    local = r
    local.x = place.inverse * (r.x - place.translation)
    local.n = wp.normalize(wp.transpose(place.linear) * r.n)
    local.response.wo = wp.normalize(place.inverse * r.response.wo)
    return local


@wp.func
def origin_in_place(scene: SceneView, instance: int, x: wp.vec3) -> wp.vec3:
    return scene.instances[instance].inverse * (x - scene.instances[instance].translation)


@wp.func
def direction_in_place(scene: SceneView, instance: int, wi: wp.vec3) -> wp.vec3:
    """Not of unit length, so that distances stay those of the world."""
    return nonzero(scene.instances[instance].inverse * wi)


def make_place(features: Features) -> SimpleNamespace:
    """Functions: emitter_at, light_of."""

    @wp.func
    def emitter_at(scene: SceneView, row: int, instance: int) -> Emitter:
        """The triangle of this row of emitter_triangles, where it stands."""
        triangle = scene.emitter_triangles[row]
        corners = scene.indices[triangle]
        emitter = Emitter()
        emitter.p0 = scene.points[corners[0]]
        emitter.e1 = scene.points[corners[1]] - emitter.p0
        emitter.e2 = scene.points[corners[2]] - emitter.p0
        emitter.n = scene.triangles[triangle].n
        if wp.static(features.emissive_instances):
            if instance != NO_INSTANCE:
                place = scene.instances[instance]
                emitter.p0 = place.linear * emitter.p0 + place.translation
                emitter.e1 = place.linear * emitter.e1
                emitter.e2 = place.linear * emitter.e2
                emitter.n = wp.normalize(normal_to_world(scene, instance, emitter.n))
        return emitter

    @wp.func
    def light_of(scene: SceneView, row: int, instance: int) -> int:
        """Row of SceneView.lights of an emissive triangle."""
        light = scene.emitter_lights[row]
        if wp.static(features.emissive_instances):
            if instance != NO_INSTANCE:
                light += scene.emitter_places[scene.place_of_instance[instance]].first_light
        return light

    return SimpleNamespace(emitter_at=emitter_at, light_of=light_of)
