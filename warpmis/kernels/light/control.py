"""What is asked of a light beside its shape: where it shines to. A factor on the radiance, none on any density."""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import ControlView, SceneView
from warpmis.features import Features

wp.set_module_options({"enable_backward": False})


@wp.func
def shaping_factor(control: ControlView, emitted: wp.vec3) -> wp.vec3:
    """UsdLuxShapingAPI: cone and focus of light that leaves in the direction `emitted` of the light's frame."""
    one = wp.vec3(1.0, 1.0, 1.0)
    off_axis = wp.atan2(wp.sqrt(emitted[0] * emitted[0] + emitted[1] * emitted[1]), -emitted[2])
    if off_axis > control.cone_end:
        return wp.vec3(0.0, 0.0, 0.0)
    inside = float(1.0)
    if off_axis > control.cone_start:
        t = (off_axis - control.cone_start) / (control.cone_end - control.cone_start)
        inside = 1.0 - t * t * (3.0 - 2.0 * t)
    factor = one
    if control.focus > 0.0:
        share = wp.pow(wp.abs(emitted[2]), control.focus)
        factor = control.focus_tint * (1.0 - share) + one * share
    return factor * inside


def make_control(features: Features) -> SimpleNamespace:
    """The function `factor` for the lights in `features`."""

    @wp.func
    def factor(scene: SceneView, index: int, wi: wp.vec3) -> wp.vec3:
        """What the light of that row in SceneView.controls sends against wi, as a share of its radiance."""
        share = wp.vec3(1.0, 1.0, 1.0)
        if index < scene.controls.shape[0]:
            control = scene.controls[index]
            if wp.static(features.shaping):
                share = shaping_factor(control, control.to_light * -wi)
        return share

    return SimpleNamespace(factor=factor)
