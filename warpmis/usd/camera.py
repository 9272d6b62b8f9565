"""The camera: which one, its lens, and its window fitted to the picture."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Usd, UsdGeom, UsdUtils

from warpmis.errors import StageError
from warpmis.scene import Camera, CylinderLight, DiskLight, Light, RectLight, SphereLight
from warpmis.scene.geometry import Bounds, Geometry, Prototype, bounds
from warpmis.usd.clipping import clipping_planes
from warpmis.usd.lens import exposure, frame_of, read_lens, shutter, thin_lens
from warpmis.usd.reading import Reading
from warpmis.usd.settings import WHOLE, Settings
from warpmis.whole_numbers import MAX_PIXELS

DEFAULT_WIDTH = 960  # usdrecord's

# A picture's height is cut to whole pixels; this keeps 640 / (4/3) in float32 from becoming 479.
HEIGHT_TOLERANCE = 1e-3


def read_camera(
    reading: Reading,
    settings: Settings,
    asked: str | None,
    width: int | None,
    geometry: Geometry,
    prototypes: tuple[Prototype, ...],
    lights: list[Light],
    origin: NDArray[np.float64],
) -> tuple[Camera, tuple[int, int]]:
    """The camera to render through and the resolution (width, height) [pixel], both of the data window alone.

    Geometry, lights and the camera returned stand in the scene's coordinates, which begin at `origin`.

    The camera is the one asked for, else the RenderSettings', else the one of USD's primary camera name, else the
    first of the stage, else one that frames the geometry as usdrecord's does.

    Raises:
        StageError: the camera asked for is not there or has no valid lens or transform, or the picture is too large.
    """
    prim = _find_camera(reading, settings, asked)
    if prim is None:
        framed = world_bounds(geometry, prototypes, lights)
        path, gf_camera = "", framing_camera(framed, str(UsdGeom.GetStageUpAxis(reading.stage)))
        reading.note("the stage has no camera: one that frames the geometry is used")
    else:
        path, gf_camera = str(prim.GetPath()), read_lens(prim, reading)
        gf_camera.transform *= Gf.Matrix4d().SetTranslate(Gf.Vec3d(*(-origin).tolist()))
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


def camera_prims(stage: Any) -> list[Any]:
    """Every Camera prim of the stage in traversal order, those in native instances included."""
    prims = Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate))
    return [prim for prim in prims if prim.IsA(UsdGeom.Camera)]


def _find_camera(reading: Reading, settings: Settings, asked: str | None) -> Any:
    cameras = camera_prims(reading.stage)
    if asked is not None:
        found = _matching(cameras, asked)
        if found is None:
            known = ", ".join(str(prim.GetPath()) for prim in cameras) or "none"
            raise StageError(f"there is no such camera; the stage's cameras: {known}", asked)
        return found
    if settings.camera is not None:
        found = _matching(cameras, settings.camera)
        if found is not None:
            return found
        reading.warn(settings.path, f"its camera {settings.camera} is no Camera")
    primary = _matching(cameras, UsdUtils.GetPrimaryCameraName())
    if primary is not None:
        return primary
    if len(cameras) > 1:
        reading.note(f"{cameras[0].GetPath()} is used, the first of the stage's {len(cameras)} cameras")
    return cameras[0] if cameras else None


def _matching(cameras: list[Any], asked: str) -> Any:
    """The first camera of that path or, where `asked` is no absolute path, whose path ends in it."""
    for prim in cameras:
        path = str(prim.GetPath())
        if path == asked or (not asked.startswith("/") and path.endswith(f"/{asked}")):
            return prim
    return None


def picture_resolution(gf_camera: Any, settings: Settings, width: int | None) -> tuple[int, int]:
    """(width, height) [pixel]: height from the aperture's aspect where `width` is given or nothing is authored."""
    if width is None and settings.resolution is not None:
        return settings.resolution
    columns = DEFAULT_WIDTH if width is None else width
    rows = columns * settings.pixel_aspect_ratio * gf_camera.verticalAperture / gf_camera.horizontalAperture
    return columns, max(1, math.floor(rows + HEIGHT_TOLERANCE))


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


def framing_camera(bounds: Bounds, up_axis: str) -> Any:
    """usdrecord's camera for a stage without one: in front of the bounds, upright, with the default lens."""
    low, high = bounds
    center, size = (low + high) / 2, high - low
    gf_camera = Gf.Camera()
    across, depth = (1, 2) if up_axis == "Y" else (2, 1)
    radius = 0.5 * math.hypot(size[0], size[across]) or 0.5 * size[depth] or 1.0
    half_view = math.radians(gf_camera.GetFieldOfView(Gf.Camera.FOVHorizontal)) / 2
    distance = radius / math.tan(half_view) + size[depth] / 2
    matrix = Gf.Matrix4d(1.0)
    if up_axis == "Y":
        matrix.SetTranslate(Gf.Vec3d(*center.tolist()) + Gf.Vec3d(0, 0, distance))
    else:
        matrix.SetRotate(Gf.Rotation(Gf.Vec3d(1, 0, 0), 90))
        matrix.SetTranslateOnly(Gf.Vec3d(*center.tolist()) + Gf.Vec3d(0, -distance, 0))
    gf_camera.transform = matrix
    return gf_camera


def world_bounds(geometry: Geometry, prototypes: tuple[Prototype, ...], lights: list[Light]) -> Bounds:
    """Smallest and largest corner of the geometry, or, without any, of the lights that have a place."""
    found = bounds(geometry, prototypes)
    if found is not None:
        return found
    places = light_boxes(lights)
    if not places:
        return np.zeros(3), np.zeros(3)
    return np.min([low[0] for low, _ in places], axis=0), np.max([high[0] for _, high in places], axis=0)


def light_boxes(lights: list[Light]) -> list[Bounds]:
    """The bounds of every light that has a place, shape (1, 3) each."""
    return [(box[0][None], box[1][None]) for light in lights if (box := _box(light)) is not None]


def _box(light: Light) -> Bounds | None:
    """Smallest and largest corner of a light, shape (3,) each; None for one at infinity."""
    match light:
        case RectLight() | DiskLight():
            reach = np.abs(light.half_u) + np.abs(light.half_v)
        case SphereLight():
            reach = np.full(3, light.radius)
        case CylinderLight():
            reach = np.abs(light.half_axis) + light.radius
        case _:
            return None
    return light.center - reach, light.center + reach
