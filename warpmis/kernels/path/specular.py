"""The path's way on from a mirror, or straight through a surface."""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import SceneView
from warpmis.kernels.hit import Hit
from warpmis.kernels.light.records import Receiver
from warpmis.kernels.shading_frame import Frame, to_world
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})


def make_specular(
    features: Features, PathState: type, lights: SimpleNamespace, contributions: SimpleNamespace
) -> SimpleNamespace:
    """Functions: pass_through, leave, reflect."""

    @wp.func
    def pass_through(path: wp.ref[PathState], hit: wp.ref[Hit], distance: float):
        """Go on behind the surface, `distance` from the last vertex, as if it were not there."""
        path.origin = hit.p - hit.ng * hit.offset
        path.travelled = distance

    @wp.func
    def leave(scene: SceneView, path: wp.ref[PathState], hit: wp.ref[Hit], frame: Frame, wi: wp.vec3):
        """Go on from path.origin in a local direction that no light sample could have been drawn in."""
        path.wi = wp.normalize(to_world(frame, wi))
        absorption = path.receiver.absorption
        path.receiver = Receiver()
        path.receiver.x = path.origin
        if wp.static(features.absorption):
            path.receiver.absorption = absorption
        if wp.static(features.controlled):
            path.receiver.is_surface = True
            path.receiver.prim = lights.control.prim_of(scene, hit)
        path.weighs_emission = False

    @wp.func
    def reflect(scene: SceneView, path: wp.ref[PathState], hit: wp.ref[Hit], frame: Frame, wo: wp.vec3) -> bool:
        """Mirror the path about the shading normal; False where it would enter the surface."""
        leave(scene, path, hit, frame, wp.vec3(-wo[0], -wo[1], wo[2]))
        contributions.scatter(path, wp.vec3(0.0, 0.0, 0.0), False)
        return wp.dot(path.wi, hit.ng) > 0.0

    return SimpleNamespace(pass_through=pass_through, leave=leave, reflect=reflect)
