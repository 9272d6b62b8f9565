"""A camera prim's frame in the world and its lens: window, focus, shutter and exposure.

All lengths of a camera are in its own space (UsdGeomCamera), so that a stage that is scaled as a whole gives the same
picture. Where a transform scales the axes differently, widths and heights go by the first two, depths by the third,
and a thin lens stays round, of the mean radius.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, UsdGeom

from warpmis.errors import StageError
from warpmis.usd.reading import PxrError, Reading, one_line
from warpmis.usd.settings import Settings

Vector = NDArray[np.float64]

# Beyond this a squared radiance overflows float32.
MAX_EXPOSURE = 1e15

# Axes whose cosines are below this stand at right angles.
SHEAR_TOLERANCE = 1e-4


@dataclass(frozen=True, eq=False)
class Frame:
    """Where a camera stands, and how long its units are in the world.

    Attributes:
        position: shape (3,).
        right, up, forward: orthonormal and right-handed, shape (3,).
        scale: lengths of the camera's units across, up and ahead; one of the first two is negative in a mirrored
            frame, and the picture is mirrored with it.
    """

    position: Vector
    right: Vector
    up: Vector
    forward: Vector
    scale: tuple[float, float, float]


def frame_of(matrix: Vector) -> tuple[Frame, bool]:
    """The frame of a local-to-world matrix, shape (4, 4), USD's row-vector convention, and whether it has no shear.

    What lies straight ahead stays there; shear is left out.

    Raises:
        ValueError: the matrix is not finite or not invertible.
    """
    lengths = np.linalg.norm(matrix[:3, :3], axis=1)
    if not np.isfinite(matrix).all() or not lengths.all():
        raise ValueError("not invertible")
    x, y, z = matrix[:3, :3] / lengths[:, None]
    right = x - (x @ z) * z
    up = np.cross(z, right)
    if abs(np.linalg.det([x, y, z])) <= 1e-9:
        raise ValueError("not invertible")
    right, up = right / np.linalg.norm(right), up / np.linalg.norm(up)
    scale = (float(lengths[0] * (x @ right)), float(lengths[1] * (y @ up)), float(lengths[2]))
    is_square = max(abs(x @ y), abs(y @ z), abs(z @ x)) < SHEAR_TOLERANCE
    return Frame(matrix[3, :3].copy(), right, up, -z, scale), bool(is_square)


def read_lens(prim: Any, reading: Reading) -> Any:
    """The prim as a Gf.Camera whose numbers make a frustum, its transform with scale and all.

    Raises:
        StageError: the aperture, focal length or transform make none.
    """
    path = str(prim.GetPath())
    found = Gf.Camera()
    found.transform = _transform(prim, reading)
    is_orthographic = reading.get(UsdGeom.Camera(prim).GetProjectionAttr()) == UsdGeom.Tokens.orthographic
    found.projection = Gf.Camera.Orthographic if is_orthographic else Gf.Camera.Perspective
    for name, fallback in NUMBERS.items():
        setattr(found, name, reading.number(prim, name, fallback))
    lens: tuple[float, ...] = (found.horizontalAperture, found.verticalAperture)
    if not is_orthographic:
        lens = (*lens, found.focalLength)
    offsets = (found.horizontalApertureOffset, found.verticalApertureOffset)
    if not np.isfinite((*lens, *offsets)).all() or min(lens) <= 0.0:
        raise StageError("focalLength and both apertures must be above 0 and finite", path)
    try:
        _, is_square = frame_of(np.array(found.transform))
    except ValueError:
        raise StageError("the camera's transform is not invertible", path) from None
    if not is_square:
        reading.warn(path, "its transform shears it; the shear is left out")
    return found


# The schema's fallbacks.
NUMBERS = {
    "horizontalAperture": 20.955,
    "verticalAperture": 15.2908,
    "horizontalApertureOffset": 0.0,
    "verticalApertureOffset": 0.0,
    "focalLength": 50.0,
    "fStop": 0.0,
    "focusDistance": 0.0,
}


def _transform(prim: Any, reading: Reading) -> Any:
    """Local to world; an operation that cannot be read, of the camera or above it, is left out with a warning."""
    transforms = UsdGeom.XformCache(reading.time)
    try:
        return transforms.GetLocalToWorldTransform(prim)
    except PxrError:
        matrix = Gf.Matrix4d(1.0)
    while prim and not prim.IsPseudoRoot():
        if prim.IsA(UsdGeom.Xformable):
            matrix *= _local_transform(prim, reading)
            if UsdGeom.Xformable(prim).GetResetXformStack():
                break
        prim = prim.GetParent()
    return matrix


def _local_transform(prim: Any, reading: Reading) -> Any:
    matrix = Gf.Matrix4d(1.0)
    try:
        operations = UsdGeom.Xformable(prim).GetOrderedXformOps()
    except PxrError as error:
        reading.warn(prim.GetPath(), f"its transform is left out: {one_line(error)}")
        return matrix
    for operation in reversed(operations):
        try:
            matrix *= operation.GetOpTransform(reading.time)
        except PxrError as error:
            reading.warn(operation.GetAttr().GetPath(), f"left out: {one_line(error)}")
    return matrix


def thin_lens(gf_camera: Any, frame: Frame, path: str, settings: Settings, reading: Reading) -> tuple[float, float]:
    """The lens' radius, focalLength / (2 fStop), and what is in focus, in the world; (0, 0) for a pinhole.

    focalLength is in tenths of the camera's units, focusDistance in its units.
    """
    if gf_camera.fStop == 0.0 or settings.disable_depth_of_field:
        return 0.0, 0.0
    if gf_camera.projection == Gf.Camera.Orthographic:
        reading.warn(path, "an orthographic camera has no lens: fStop is not used")
        return 0.0, 0.0
    across, up, ahead = frame.scale
    radius = 0.1 * gf_camera.focalLength / (2.0 * gf_camera.fStop) * math.sqrt(abs(across * up))
    focus = gf_camera.focusDistance * ahead
    if not (0.0 < radius < math.inf and 0.0 < focus < math.inf):
        reading.warn(path, "fStop and focusDistance must be above 0 for depth of field; everything is in focus")
        return 0.0, 0.0
    return radius, focus


def shutter(prim: Any, settings: Settings, reading: Reading) -> tuple[float, float]:
    """When the shutter opens and closes, relative to the reading's time [time codes]; (0, 0) without motion blur."""
    opens, closes = (reading.number(prim, f"shutter:{name}", 0.0) for name in ("open", "close"))
    if settings.disable_motion_blur or opens == closes:
        return 0.0, 0.0
    if not (math.isfinite(opens) and math.isfinite(closes) and opens < closes):
        reading.warn(prim.GetPath(), f"shutter:open {opens:g} is not before shutter:close {closes:g}; no motion blur")
        return 0.0, 0.0
    return opens, closes


def exposure(prim: Any, reading: Reading) -> float:
    """Factor on the picture: responsivity * time * iso / 100 * 2^exposure / fStop^2, of the exposure's attributes."""
    names = ("exposure", "exposure:time", "exposure:iso", "exposure:fStop", "exposure:responsivity")
    power, time, iso, f_stop, responsivity = (
        reading.number(prim, name, fallback) for name, fallback in zip(names, (0.0, 1.0, 100.0, 1.0, 1.0), strict=True)
    )
    scale = float(responsivity * time * (iso / 100.0) * np.exp2(power) / np.square(f_stop))
    if not 0.0 <= scale <= MAX_EXPOSURE:
        reading.warn(prim.GetPath(), f"the camera's exposure is a factor of {scale:g}; 1 is used")
        return 1.0
    return scale
