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
    group.add_argument(
        "--camera", "-cam", metavar="PRIM", help="camera prim by path or unique name, or frame-all to see everything"
    )
    group.add_argument(
        "--image-width",
        "--imageWidth",
        "-w",
        type=whole_number,
        metavar="PIXELS",
        help="width of the image; the height follows",
    )
    group.add_argument(
        "--image-height", "--imageHeight", type=whole_number, metavar="PIXELS",
        help="height of the image; the width follows, if it is not given",
    )  # fmt: skip
    group.add_argument(
        "--purposes",
        type=purpose_list,
        metavar="A,B",
        help=f"purposes to render, from {', '.join(PURPOSES)}; default is always included",
    )
    group.add_argument(
        "--render-settings-prim-path", "--renderSettingsPrimPath", "-rs", metavar="PRIM", help="RenderSettings to use"
    )
    group.add_argument(
        "--complexity", "-c", choices=COMPLEXITIES, help="refine subdivision 0, 1, 2 or 3 times (default: high)"
    )
    group.add_argument(
        "--variant", action="append", metavar="/PRIM{SET=VARIANT}", help="select this variant (repeatable)"
    )
    group.add_argument("--mask", type=name_list, metavar="/A,/B", help="load only these prims and what they refer to")
    group.add_argument("--session-layer", "--sessionLayer", metavar="FILE", help="open this layer over the stage")
    group.add_argument(
        "--time", "-t", type=time_code, metavar="T", help="time code (default: the stage's startTimeCode, else 0)"
    )
    _add_render_settings_options(parser)
    return group


def _add_render_settings_options(parser: argparse.ArgumentParser) -> None:
    """What a RenderSettings prim can say, and the option beats."""
    group = parser.add_argument_group("instead of the stage's RenderSettings")
    group.add_argument(
        "--disable-depth-of-field", "--disableDepthOfField", action="store_true", default=None,
        help="make every camera a pinhole",
    )  # fmt: skip
    group.add_argument(
        "--disable-motion-blur", "--disableMotionBlur", action="store_true", default=None,
        help="ignore the shutter interval",
    )  # fmt: skip
    group.add_argument(
        "--pixel-aspect-ratio",
        "--pixelAspectRatio",
        type=number,
        metavar="R",
        help="width over height of a pixel (default: 1)",
    )
    group.add_argument(
        "--aspect-ratio-conform-policy", "--aspectRatioConformPolicy", metavar="POLICY",
        help="how the camera's window fits another aspect, such as cropAperture (default: expandAperture)",
    )  # fmt: skip
    group.add_argument(
        "--data-window-ndc", "--dataWindowNDC", type=number_list, metavar="X0,Y0,X1,Y1",
        help="render this part of the picture, from 0,0 at the lower left to 1,1 at the upper right",
    )  # fmt: skip
    group.add_argument(
        "--material-binding-purposes", "--materialBindingPurposes", type=binding_purpose_list, metavar="A,B",
        help="use the first of these that a prim has: preview, full, allPurpose (default: full,allPurpose)",
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
        height=arguments.image_height,
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
