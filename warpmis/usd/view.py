"""Where a stage is seen from: the camera asked for, or of the stage, or the one that Omniverse Kit left in it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Usd, UsdGeom, UsdUtils

from warpmis.errors import StageError
from warpmis.usd.lens import read_lens
from warpmis.usd.reading import Reading
from warpmis.usd.settings import Settings

# Asks for a camera that frames the geometry, whatever cameras there are; no prim can have this name.
FRAME_ALL = "frame-all"

# Omniverse Kit's perspective camera, in the units of UsdGeomCamera.
KIT_FOCAL_LENGTH = 18.147562
# Where its other views look to, by the stage's up axis.
KIT_AXES = {
    "Y": {"Front": (0.0, 0.0, -1.0), "Right": (1.0, 0.0, 0.0), "Top": (0.0, -1.0, 0.0)},
    "Z": {"Front": (-1.0, 0.0, 0.0), "Right": (0.0, 1.0, 0.0), "Top": (0.0, 0.0, -1.0)},
}


@dataclass(frozen=True, eq=False)
class View:
    """A camera before its window has been fitted to the picture.

    Attributes:
        gf_camera: a Gf.Camera in the stage's world.
        prim: the Camera prim that it is of, or None.
    """

    gf_camera: Any
    prim: Any = None


def find_view(reading: Reading, settings: Settings, asked: str | None) -> View | None:
    """Where to look from; None for a camera that frames the geometry: FRAME_ALL was asked for, or there is no other.

    The camera asked for, else the RenderSettings', else the one of USD's primary camera name, else the one that Kit
    was looking through, else the first of the stage, else Kit's own view.

    Raises:
        StageError: the camera asked for is not there, or the one found has no valid lens or transform.
    """
    if asked == FRAME_ALL:
        reading.note("a camera that frames the geometry is used")
        return None
    prim = _find_camera(reading, settings, asked)
    if prim is not None:
        return View(read_lens(prim, reading), prim)
    view = kit_view(reading)
    if view is None:
        reading.note("the stage has no camera: one that frames the geometry is used")
    return view


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
    bound = _matching(cameras, str(kit_settings(reading).get("boundCamera", "")) or "/")
    if bound is not None and len(cameras) > 1:
        reading.note(f"{bound.GetPath()} is used, the camera that Omniverse Kit was looking through")
        return bound
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


def kit_settings(reading: Reading) -> dict[str, Any]:
    """cameraSettings of the stage's customLayerData, where Kit keeps its viewport's cameras; empty without any."""
    found = (reading.stage.GetMetadata("customLayerData") or {}).get("cameraSettings")
    return found if isinstance(found, dict) else {}


def kit_view(reading: Reading) -> View | None:
    """Kit's Perspective, or the orthographic Front, Right or Top where that was bound; None where it makes no view.

    A view is given by its position and its target; Front, Right and Top by a radius, half the width of what they show.
    """
    settings = kit_settings(reading)
    bound = str(settings.get("boundCamera", "")).rpartition("_")[2]
    name = bound if bound in KIT_AXES["Y"] else "Perspective"
    view = settings.get(name)
    if not isinstance(view, dict):
        return None
    up_axis = "Y" if UsdGeom.GetStageUpAxis(reading.stage) == UsdGeom.Tokens.y else "Z"
    look = _perspective(view) if name == "Perspective" else _along_axis(view, KIT_AXES[up_axis][name])
    if look is None:
        reading.warn("", f"customLayerData: cameraSettings: {name} has no position and target that make a view")
        return None
    gf_camera, position, forward = look
    gf_camera.transform = _looking(position, forward, up_axis)
    reading.note(f"the stage has no camera: the view {name} that Omniverse Kit saved is used")
    return View(gf_camera)


Look = tuple[Any, NDArray[np.float64], NDArray[np.float64]]


def _perspective(view: dict[str, Any]) -> Look | None:
    position, target = _vector(view.get("position")), _vector(view.get("target"))
    if position is None or target is None or (position == target).all():
        return None
    gf_camera = Gf.Camera()
    gf_camera.focalLength = KIT_FOCAL_LENGTH
    return gf_camera, position, (target - position) / np.linalg.norm(target - position)


def _along_axis(view: dict[str, Any], axis: tuple[float, float, float]) -> Look | None:
    forward = np.array(axis)
    radius, position = _number(view.get("radius")), _vector(view.get("position"))
    if position is None:  # older versions wrote the target alone
        target = _vector(view.get("target"))
        position = None if target is None else target - (radius or 0.0) * 1e3 * forward
    if radius is None or radius <= 0.0 or position is None:
        return None
    gf_camera = Gf.Camera()
    gf_camera.projection = Gf.Camera.Orthographic
    aspect = gf_camera.verticalAperture / gf_camera.horizontalAperture
    gf_camera.horizontalAperture, gf_camera.verticalAperture = 20.0 * radius, 20.0 * radius * aspect
    return gf_camera, position, forward


def _looking(position: NDArray[np.float64], forward: NDArray[np.float64], up_axis: str) -> Any:
    """A transform that looks along `forward`, upright; a view from above has the horizon's far side on top."""
    up, ahead = np.eye(3)[[1, 2]] * [[1.0], [-1.0]] if up_axis == "Y" else np.eye(3)[[2, 1]]
    across = np.cross(forward, up)
    if np.linalg.norm(across) < 1e-9:
        across = np.cross(forward, ahead)
    right = across / np.linalg.norm(across)
    matrix = np.eye(4)
    matrix[:3, :3], matrix[3, :3] = [right, np.cross(right, forward), -forward], position
    return Gf.Matrix4d(matrix.tolist())


def _vector(value: Any) -> NDArray[np.float64] | None:
    try:
        found = np.array(value, np.float64)
    except (TypeError, ValueError):
        return None
    return found if found.shape == (3,) and np.isfinite(found).all() else None


def _number(value: Any) -> float | None:
    return float(value) if isinstance(value, int | float) and np.isfinite(value) else None
