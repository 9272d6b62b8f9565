"""Emission that a ray meets, kept by light group until the path takes it in (kernels/path/contributions.py)."""

import warp as wp

from warpmis.device.views import SceneView
from warpmis.kernels.light.records import Receiver

wp.set_module_options({"enable_backward": False})


@wp.func
def keep_emission(scene: SceneView, r: wp.ref[Receiver], light: int, emission: wp.vec3, diffuse: wp.vec3):
    """diffuse: the share of it that the receiver scatters diffusely, per colour; light: row of AovView.groups."""
    at = 2 * (r.place * scene.aov[0].group_count + scene.aov[0].groups[light])
    scene.aov[0].on_ray[at] = scene.aov[0].on_ray[at] + emission
    scene.aov[0].on_ray[at + 1] = scene.aov[0].on_ray[at + 1] + wp.cw_mul(emission, diffuse)
