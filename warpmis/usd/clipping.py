"""Clipping planes of a camera: those that cut off something that it would see."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import UsdGeom

from warpmis.scene import Camera
from warpmis.scene.geometry import Bounds, Geometry
from warpmis.usd.reading import Reading


def clipping_planes(
    prim: Any,
    camera: Camera,
    scale: tuple[float, float, float],
    geometry: Geometry,
    solids: list[Bounds],
    light_boxes: list[Bounds],
    reading: Reading,
) -> NDArray[np.float64]:
    """The planes as Camera.clipping_planes has them, shape (n, 4); `solids` hold what is there beside the geometry.

    They are authored in the camera's own space, whose units are `scale` long across, up and ahead.

    A clippingRange counts where it is authored: its fallback, from 1 on, would cut into any small scene. Its ends are
    left out where nothing in view lies beyond them, so that the kernel need not know of them.
    """
    schema = UsdGeom.Camera(prim)
    planes = []
    near, far = (scale[2] * end for end in _range(schema, reading))
    if near > 0.0 and _is_near(camera, near, geometry, [*solids, *light_boxes]):
        planes.append([*camera.forward, -near])
    depths = [(geometry.points - camera.position) @ camera.forward]
    depths += [_in_view(camera, box)[1][:, 2] for box in solids]
    if max(ends.max(initial=-np.inf) for ends in depths) > far:
        planes.append([*-camera.forward, far])
    for plane in reading.get(schema.GetClippingPlanesAttr(), ()):
        a, b, c, d = plane
        normal = a / scale[0] * camera.right_axis + b / scale[1] * camera.up_axis - c / scale[2] * camera.forward
        length = np.linalg.norm(normal)
        if not (np.isfinite([*normal, d]).all() and length > 0.0):
            reading.warn(prim.GetPath(), f"clipping plane {plane} has no normal; it is left out")
            continue
        planes.append([*normal / length, d / length])
    return np.array(planes, np.float64).reshape(-1, 4)


def _range(schema: Any, reading: Reading) -> tuple[float, float]:
    attribute = schema.GetClippingRangeAttr()
    if not attribute.HasAuthoredValue():
        return 0.0, np.inf
    near, far = reading.get(attribute, (0.0, np.inf))
    if not near < far:
        reading.warn(schema.GetPath(), f"clippingRange ({near:g}, {far:g}) is not a range; nothing is clipped")
        return 0.0, np.inf
    return near, far


def _is_near(camera: Camera, near: float, geometry: Geometry, boxes: list[Bounds]) -> bool:
    """Whether a triangle's box, or one of `boxes`, meets the box of what the camera sees before the near plane."""
    left, right, bottom, top = np.array(camera.window) * (1.0 if camera.orthographic else near)
    low = np.array([min(left, right, 0.0), min(bottom, top, 0.0), 0.0]) - camera.lens_radius
    high = np.array([max(left, right, 0.0), max(bottom, top, 0.0), near]) + camera.lens_radius
    if _meets(geometry, camera, low, high):
        return True
    views = [_in_view(camera, box) for box in boxes]
    return any(((low <= largest) & (smallest <= high)).all(axis=1).any() for smallest, largest in views)


def _meets(geometry: Geometry, camera: Camera, low: NDArray[np.float64], high: NDArray[np.float64]) -> bool:
    """Whether a triangle's box along the camera's axes meets the one from low to high.

    It does not where all three corners lie beyond the same side. Each point has a bit for each side that it lies beyond
    (Cohen, Sutherland 1967), so that a triangle costs three bytes, and one pass over the points is all the arithmetic.
    """
    beyond = np.zeros(len(geometry.points), np.uint8)
    for bit, axis in enumerate(_axes(camera)):
        along = geometry.points @ axis - camera.position @ axis
        beyond |= (along < low[bit]).astype(np.uint8) << (2 * bit)
        beyond |= (along > high[bit]).astype(np.uint8) << (2 * bit + 1)
    if beyond.all() and np.bitwise_and.reduce(beyond, initial=255) != 0:
        return False  # all points lie beyond one side, as most scenes do before the near plane
    first, second, third = (beyond[geometry.triangles[:, corner]] for corner in range(3))
    return bool(((first & second & third) == 0).any())


def _axes(camera: Camera) -> NDArray[np.float64]:
    return np.stack([camera.right_axis, camera.up_axis, camera.forward])


def _in_view(camera: Camera, box: Bounds) -> Bounds:
    """The boxes along the camera's axes that hold those along the world's, shape (k, 3) each."""
    axes = _axes(camera)
    center, reach = ((box[0] + box[1]) / 2 - camera.position) @ axes.T, (box[1] - box[0]) / 2 @ np.abs(axes).T
    return center - reach, center + reach
