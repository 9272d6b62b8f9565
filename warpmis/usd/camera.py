"""The camera to render through: its lens, and its window fitted to the picture."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, UsdGeom

from warpmis.errors import StageError
from warpmis.scene import Camera, Light
from warpmis.scene.geometry import Geometry, Prototype
from warpmis.usd.clipping import clipping_planes
from warpmis.usd.framing import framing_camera, from_the_front, light_boxes
from warpmis.usd.lens import exposure, frame_of, shutter, thin_lens
from warpmis.usd.reading import Reading
from warpmis.usd.settings import WHOLE, Settings
from warpmis.usd.sight import Sight, sight_of
from warpmis.usd.view import View
from warpmis.whole_numbers import MAX_PIXELS

DEFAULT_WIDTH = 960  # usdrecord's

# A picture's height is cut to whole pixels; this keeps 640 / (4/3) in float32 from becoming 479.
HEIGHT_TOLERANCE = 1e-3


def read_camera(
    reading: Reading,
    settings: Settings,
    view: View | None,
    width: int | None,
    geometry: Geometry,
    prototypes: tuple[Prototype, ...],
    lights: list[Light],
    origin: NDArray[np.float64],
) -> tuple[Camera, tuple[int, int]]:
    """The camera to render through and the resolution (width, height) [pixel], both of the data window alone.

    Geometry, lights and the camera returned stand in the scene's coordinates, which begin at `origin`; the view stands
    in the stage's world. Without a view the camera is one that frames the geometry.

    Raises:
        StageError: the picture is too large.
    """
    if view is None:
        up_axis = str(UsdGeom.GetStageUpAxis(reading.stage))
        gf_camera, prim = framing_camera(geometry, prototypes, lights, up_axis), None
    else:
        gf_camera, prim = Gf.Camera(view.gf_camera), view.prim
        gf_camera.transform *= Gf.Matrix4d().SetTranslate(Gf.Vec3d(*(-origin).tolist()))
    path = "" if prim is None else str(prim.GetPath())
    resolution = picture_resolution(gf_camera, settings, width)
    camera = fitted_camera(path, gf_camera, resolution, settings)
    if prim is not None:
        frame, _ = frame_of(np.array(gf_camera.transform))
        radius, focus = thin_lens(gf_camera, frame, path, settings, reading)
        camera = replace(camera, lens_radius=radius, focus_distance=focus, exposure=exposure(prim, reading))
        camera = replace(camera, shutter=shutter(prim, settings, reading))
        solids = [prototype.boxes for prototype in prototypes]
        planes = clipping_planes(prim, camera, frame.scale, geometry, solids, light_boxes(lights), reading)
        camera = replace(camera, clipping_planes=planes)
    if settings.data_window != WHOLE:
        camera, resolution = cropped(camera, resolution, settings)
    if resolution[0] * resolution[1] > MAX_PIXELS:
        raise StageError(f"a picture of {resolution[0]:.3g} x {resolution[1]:.3g} pixels is too large", path)
    return camera, resolution


def first_sight(reading: Reading, settings: Settings, view: View | None, width: int | None) -> Sight | None:
    """How large things look, in the stage's world, before the surfaces have been read; None where nothing is refined.

    Without a view that is as from the front, so near that the gprims fill the picture.
    """
    if reading.levels == 0 or (view is None and reading.extent.box is None):
        return None
    up_axis = str(UsdGeom.GetStageUpAxis(reading.stage))
    gf_camera = from_the_front(reading.extent.box, up_axis) if view is None else view.gf_camera
    resolution = picture_resolution(gf_camera, settings, width)
    return sight_of(fitted_camera("", gf_camera, resolution, settings), resolution)


def cropped(camera: Camera, resolution: tuple[int, int], settings: Settings) -> tuple[Camera, tuple[int, int]]:
    """The camera and resolution of the data window: the pixels whose centres it contains, one at least."""
    (width, height), (x0, y0, x1, y1) = resolution, settings.data_window
    left, right, bottom, top = camera.window
    first_column, end_column = math.ceil(x0 * width - 0.5), math.ceil(x1 * width - 0.5)
    first_row, end_row = math.ceil(y0 * height - 0.5), math.ceil(y1 * height - 0.5)  # from the bottom
    end_column, end_row = max(end_column, first_column + 1), max(end_row, first_row + 1)
    across, up = (right - left) / width, (top - bottom) / height
    horizontal = (left + first_column * across, left + end_column * across)
    vertical = (bottom + first_row * up, bottom + end_row * up)
    size = (end_column - first_column, end_row - first_row)
    return replace(camera, window=(*horizontal, *vertical)), size


def picture_resolution(gf_camera: Any, settings: Settings, width: int | None) -> tuple[int, int]:
    """(width, height) [pixel]: as asked, the missing one from the aperture's aspect; else as authored."""
    height = settings.height
    if width is None and height is None and settings.resolution is not None:
        return settings.resolution
    rows_per_column = settings.pixel_aspect_ratio * gf_camera.verticalAperture / gf_camera.horizontalAperture
    if height is None:
        columns = DEFAULT_WIDTH if width is None else width
        return columns, max(1, math.floor(columns * rows_per_column + HEIGHT_TOLERANCE))
    if width is None:
        return max(1, math.floor(height / rows_per_column + HEIGHT_TOLERANCE)), height
    return width, height


def fitted_camera(path: str, gf_camera: Any, resolution: tuple[int, int], settings: Settings) -> Camera:
    """The camera whose window has the picture's aspect, as a pinhole or orthographic.

    An orthographic camera's aperture, in tenths of the camera's units, is its window itself.
    """
    orthographic = gf_camera.projection == Gf.Camera.Orthographic
    focal = 10.0 if orthographic else gf_camera.focalLength
    size = (gf_camera.horizontalAperture / focal, gf_camera.verticalAperture / focal)
    aspect = resolution[0] * settings.pixel_aspect_ratio / resolution[1]
    half_width, half_height = (0.5 * side for side in conformed_window(size, aspect, settings.conform_policy))
    x, y = gf_camera.horizontalApertureOffset / focal, gf_camera.verticalApertureOffset / focal
    frame, _ = frame_of(np.array(gf_camera.transform))
    across, up = (length / (1.0 if orthographic else frame.scale[2]) for length in frame.scale[:2])
    return Camera(
        path=path,
        position=frame.position,
        right_axis=frame.right,
        up_axis=frame.up,
        forward=frame.forward,
        window=(across * (x - half_width), across * (x + half_width), up * (y - half_height), up * (y + half_height)),
        orthographic=orthographic,
    )


def conformed_window(size: tuple[float, float], aspect: float, policy: str) -> tuple[float, float]:
    """Width and height of the window for a picture of `aspect`, by UsdRender's aspectRatioConformPolicy."""
    width, height = size
    if policy == "adjustPixelAspectRatio":
        return size
    wider_picture = aspect > width / height
    if policy == "adjustApertureWidth" or (policy == "cropAperture" and not wider_picture):
        return height * aspect, height
    if policy == "adjustApertureHeight" or (policy == "cropAperture" and wider_picture):
        return width, width / aspect
    return (height * aspect, height) if wider_picture else (width, width / aspect)
