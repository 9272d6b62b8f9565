"""What is asked of a light beside its shape: factors on its radiance, none on any density."""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import ControlView, LightView, SceneView
from warpmis.features import Features
from warpmis.kernels.light.area import plane_hit

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


@wp.func
def picture_factor(control: ControlView, light: LightView, x: wp.vec3, wi: wp.vec3) -> wp.vec3:
    """A rect light's picture where the ray from x meets it: bilinear, clamped at the edges."""
    rows = control.picture.shape[0]
    columns = control.picture.shape[1]
    if rows == 0:
        return wp.vec3(1.0, 1.0, 1.0)
    plane = plane_hit(light, x, wi)
    column = wp.clamp((0.5 - 0.5 * plane.a) * float(columns) - 0.5, 0.0, float(columns - 1))
    row = wp.clamp((0.5 - 0.5 * plane.b) * float(rows) - 0.5, 0.0, float(rows - 1))
    column0 = int(column)
    row0 = int(row)
    column1 = wp.min(column0 + 1, columns - 1)
    row1 = wp.min(row0 + 1, rows - 1)
    fx = column - float(column0)
    fy = row - float(row0)
    upper = control.picture[row0, column0] * (1.0 - fx) + control.picture[row0, column1] * fx
    lower = control.picture[row1, column0] * (1.0 - fx) + control.picture[row1, column1] * fx
    return upper * (1.0 - fy) + lower * fy


def make_control(features: Features) -> SimpleNamespace:
    """The function `factor` for the lights in `features`."""

    @wp.func
    def factor(scene: SceneView, index: int, x: wp.vec3, wi: wp.vec3) -> wp.vec3:
        """What the light of that row in SceneView.controls sends to x, against wi, as a share of its radiance."""
        share = wp.vec3(1.0, 1.0, 1.0)
        if index < scene.controls.shape[0]:
            control = scene.controls[index]
            if wp.static(features.shaping):
                share = shaping_factor(control, control.to_light * -wi)
            if wp.static(features.light_pictures):
                if index < scene.light_count:
                    share = wp.cw_mul(share, picture_factor(control, scene.lights[index], x, wi))
        return share

    return SimpleNamespace(factor=factor)
