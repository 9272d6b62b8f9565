"""What every command asks of a stage: the options, and what they become for `load_stage`."""

from __future__ import annotations

import argparse
from typing import Any

from warpmis.cli.option_values import (
    PURPOSES,
    binding_purpose_list,
    name_list,
    number,
    number_list,
    purpose_list,
    time_code,
    whole_number,
)

COMPLEXITIES = ("low", "medium", "high", "veryhigh")


def add_stage_options(parser: argparse.ArgumentParser) -> Any:
    """What to read of the stage, and the group, for those who have more to ask."""
    group = parser.add_argument_group("what to render (as in usdrecord)")
    group.add_argument("--camera", "-cam", metavar="PRIM", help="camera prim by path or unique name, or frame-all")
    group.add_argument(
        "--image-width",
        "--imageWidth",
        "-w",
        type=whole_number,
        metavar="PIXELS",
        help="height follows from the aspect",
    )
    group.add_argument(
        "--purposes",
        type=purpose_list,
        metavar="A,B",
        help=f"of {', '.join(PURPOSES)}; default is always included",
    )
    group.add_argument(
        "--render-settings-prim-path", "--renderSettingsPrimPath", "-rs", metavar="PRIM", help="RenderSettings prim"
    )
    group.add_argument(
        "--complexity", "-c", choices=COMPLEXITIES, help="refine subdivision surfaces 0, 1, 2 or 3 times (high)"
    )
    group.add_argument(
        "--variant", action="append", metavar="/PRIM{SET=VARIANT}", help="select a variant; may be given several times"
    )
    group.add_argument("--mask", type=name_list, metavar="/A,/B", help="load these prims alone, and what they refer to")
    group.add_argument("--session-layer", "--sessionLayer", metavar="FILE", help="a layer stronger than the stage")
    group.add_argument(
        "--time", "-t", type=time_code, metavar="T", help="time code (the stage's startTimeCode, else 0)"
    )
    _add_render_settings_options(parser)
    return group


def _add_render_settings_options(parser: argparse.ArgumentParser) -> None:
    """What a RenderSettings prim can say, and the option beats."""
    group = parser.add_argument_group("in place of the stage's RenderSettings")
    group.add_argument(
        "--disable-depth-of-field", "--disableDepthOfField", action="store_true", default=None,
        help="every camera is a pinhole",
    )  # fmt: skip
    group.add_argument(
        "--disable-motion-blur", "--disableMotionBlur", action="store_true", default=None,
        help="every shutter closes at once",
    )  # fmt: skip
    group.add_argument(
        "--pixel-aspect-ratio", "--pixelAspectRatio", type=number, metavar="R", help="width over height of a pixel (1)"
    )
    group.add_argument(
        "--aspect-ratio-conform-policy", "--aspectRatioConformPolicy", metavar="POLICY",
        help="how the camera's window fits another aspect, such as cropAperture (expandAperture)",
    )  # fmt: skip
    group.add_argument(
        "--data-window-ndc", "--dataWindowNDC", type=number_list, metavar="X0,Y0,X1,Y1",
        help="render this part of the picture, from 0,0 at the lower left to 1,1 at the upper right",
    )  # fmt: skip
    group.add_argument(
        "--material-binding-purposes", "--materialBindingPurposes", type=binding_purpose_list, metavar="A,B",
        help="of preview, full and allPurpose: the first that a prim has counts (full,allPurpose)",
    )  # fmt: skip


def stage_options(arguments: argparse.Namespace) -> dict[str, Any]:
    """What `add_stage_options` asked for, but the width, as `warpmis.render` and `load_stage` name it."""
    return given(
        camera=arguments.camera,
        purposes=arguments.purposes,
        render_settings=arguments.render_settings_prim_path,
        complexity=arguments.complexity,
        variants=arguments.variant,
        mask=arguments.mask,
        session_layer=arguments.session_layer,
        time=arguments.time,
        disable_depth_of_field=arguments.disable_depth_of_field,
        disable_motion_blur=arguments.disable_motion_blur,
        pixel_aspect_ratio=arguments.pixel_aspect_ratio,
        aspect_ratio_conform_policy=arguments.aspect_ratio_conform_policy,
        data_window_ndc=arguments.data_window_ndc,
        material_binding_purposes=arguments.material_binding_purposes,
    )


def given(**options: Any) -> dict[str, Any]:
    """The options that were given: what was not is left to the stage and the defaults."""
    return {name: value for name, value in options.items() if value is not None}
