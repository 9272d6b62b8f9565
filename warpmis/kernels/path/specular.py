"""The path's way on through a mirror, or straight through a surface."""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import SceneView
from warpmis.kernels.hit import Hit
from warpmis.kernels.light.records import Receiver
from warpmis.kernels.shading_frame import Frame, to_world
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})


def make_specular(features: Features, PathState: type, lights: SimpleNamespace) -> SimpleNamespace:
    """Functions: pass_through, reflect."""

    @wp.func
    def pass_through(path: wp.ref[PathState], hit: wp.ref[Hit], distance: float):
        """Go on behind the surface, `distance` from the last vertex, as if it were not there."""
        path.origin = hit.p - hit.ng * hit.offset
        path.travelled = distance

    @wp.func
    def reflect(scene: SceneView, path: wp.ref[PathState], hit: wp.ref[Hit], frame: Frame, wo: wp.vec3) -> bool:
        """Mirror the path about the shading normal; False where it would enter the surface."""
        path.wi = wp.normalize(to_world(frame, wp.vec3(-wo[0], -wo[1], wo[2])))
        path.receiver = Receiver()
        path.receiver.x = path.origin
        if wp.static(features.controlled):
            path.receiver.is_surface = True
            path.receiver.prim = lights.control.prim_of(scene, hit)
        path.weighs_emission = False
        return wp.dot(path.wi, hit.ng) > 0.0

    return SimpleNamespace(pass_through=pass_through, reflect=reflect)
