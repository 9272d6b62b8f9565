"""A light's controls: factors on its radiance. They change no density."""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import ControlView, LightView, SceneView
from warpmis.kernels.hit import Hit
from warpmis.kernels.intersect import make_intersect
from warpmis.kernels.light.area import plane_hit
from warpmis.kernels.light.dome import upper_bound
from warpmis.kernels.light.records import Receiver
from warpmis.kernels.warps import PI
from warpmis.scene.features import Features

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
def ies_factor(control: ControlView, emitted: wp.vec3) -> float:
    """Intensity of the profile in the direction `emitted` of the light's frame; 1 without a profile."""
    verticals = control.ies_vertical.shape[0]
    if verticals == 0:
        return 1.0
    theta = wp.atan2(wp.sqrt(emitted[0] * emitted[0] + emitted[1] * emitted[1]), -emitted[2])
    if control.ies_angle_scale > 0.0:
        theta = theta / control.ies_angle_scale
    else:
        theta = (theta - PI) / -control.ies_angle_scale + PI
    if theta < control.ies_vertical[0] or theta > control.ies_vertical[verticals - 1]:
        return 0.0
    phi = wp.atan2(emitted[1], emitted[0])
    if phi < 0.0:
        phi = phi + 2.0 * PI
    column = wp.max(upper_bound(control.ies_vertical, 0, verticals, theta), 1)
    row = wp.max(upper_bound(control.ies_horizontal, 0, control.ies_horizontal.shape[0], phi), 1)
    across = control.ies_vertical[column] - control.ies_vertical[column - 1]
    fx = (theta - control.ies_vertical[column - 1]) / across
    around = control.ies_horizontal[row] - control.ies_horizontal[row - 1]
    fy = wp.clamp((phi - control.ies_horizontal[row - 1]) / around, 0.0, 1.0)
    lower = control.ies_intensity[row - 1, column - 1] * (1.0 - fx) + control.ies_intensity[row - 1, column] * fx
    upper = control.ies_intensity[row, column - 1] * (1.0 - fx) + control.ies_intensity[row, column] * fx
    return lower * (1.0 - fy) + upper * fy


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
    """For the lights in `features`: prim_of, factor, response, diffuse_share."""
    intersect = make_intersect(features)

    @wp.func
    def prim_of(scene: SceneView, hit: Hit) -> int:
        """Receiver.prim of a point on a surface; 0 where no light asks for it."""
        if scene.controls.shape[0] == 0:
            return 0
        return intersect.prim_at(scene, hit.instance, hit.triangle)

    @wp.func
    def factor(scene: SceneView, index: int, r: wp.ref[Receiver], wi: wp.vec3) -> wp.vec3:
        """Share of the light's radiance that it sends to r, against wi. index: row of SceneView.controls."""
        share = wp.vec3(1.0, 1.0, 1.0)
        if index >= scene.controls.shape[0]:
            return share
        control = scene.controls[index]
        if wp.static(features.light_links):
            if r.is_surface and control.illuminates.shape[0] > 0:
                if control.illuminates[r.prim] == 0:
                    return wp.vec3(0.0, 0.0, 0.0)
        if wp.static(features.shaping):
            share = shaping_factor(control, control.to_light * -wi)
        if wp.static(features.ies):
            share = share * ies_factor(control, control.to_light * -wi)
        if wp.static(features.light_pictures):
            if index < scene.light_count:
                share = wp.cw_mul(share, picture_factor(control, scene.lights[index], r.x, wi))
        if wp.static(features.light_tints):
            if r.is_surface:
                share = wp.cw_mul(share, control.tint)
        return share

    @wp.func
    def response(scene: SceneView, index: int, diffuse: wp.vec3) -> wp.vec3:
        """What the lobes make of the light, of which the diffuse one scatters the share `diffuse`."""
        one = wp.vec3(1.0, 1.0, 1.0)
        if index >= scene.controls.shape[0]:
            return one
        control = scene.controls[index]
        return diffuse * control.diffuse + (one - diffuse) * control.specular

    @wp.func
    def diffuse_share(scene: SceneView, index: int, diffuse: wp.vec3) -> wp.vec3:
        """The diffuse lobe's share of what the lobes make of the light, per colour."""
        if wp.static(features.light_response):
            if index < scene.controls.shape[0]:
                whole = response(scene, index, diffuse)
                return wp.cw_div(diffuse * scene.controls[index].diffuse, wp.max(whole, wp.vec3(1.0e-20)))
        return diffuse

    return SimpleNamespace(prim_of=prim_of, factor=factor, response=response, diffuse_share=diffuse_share)
