"""A light's controls, as the struct that kernels read."""

from __future__ import annotations

import numpy as np
import warp as wp

from warpmis.device.views import ControlView
from warpmis.scene.light_control import EVERYWHERE, LightControl, Shaping


def control_view(control: LightControl) -> ControlView:
    view = ControlView()
    set_shaping(view, control.shaping or EVERYWHERE)
    if control.picture is not None:
        view.picture = wp.array(np.ascontiguousarray(control.picture), dtype=wp.vec3)
    view.tint = (1.0, 1.0, 1.0) if control.tint is None else tuple(control.tint)
    view.diffuse, view.specular = control.diffuse, control.specular
    if control.illuminates is not None:
        view.illuminates = wp.array(control.illuminates.astype(np.int32), dtype=int)
    if control.shadow_casters is not None:
        view.shadow_casters = wp.array(control.shadow_casters.astype(np.int32), dtype=int)
    return view


def set_shaping(view: ControlView, shaping: Shaping) -> None:
    view.to_light = wp.mat33(*shaping.to_world.T.ravel())
    view.cone_start = (1.0 - shaping.cone_softness) * shaping.cone_angle
    view.cone_end = shaping.cone_angle
    view.focus = shaping.focus
    view.focus_tint = tuple(shaping.focus_tint)
    view.ies_angle_scale = shaping.ies_angle_scale
    if shaping.ies is not None:
        view.ies_vertical = wp.array(shaping.ies.vertical, dtype=float)
        view.ies_horizontal = wp.array(shaping.ies.horizontal, dtype=float)
        view.ies_intensity = wp.array(shaping.ies.candela, dtype=float)
