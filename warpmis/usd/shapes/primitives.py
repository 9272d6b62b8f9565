"""The implicit gprims as triangles: cube and plane exactly, the others as surfaces of revolution.

Every vertex lies on the true surface and carries its true normal; rims between a side and its caps stay sharp.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from pxr import UsdGeom

from warpmis.usd.reading import Reading
from warpmis.usd.shapes.implicit_elements import elements_of, varies
from warpmis.usd.shapes.surfaces import FloatArray, Surface, flat_surface, reversed_surface


class Grid(NamedTuple):
    """Segments about the axis, of a sphere from pole to pole, and of a capsule's cap."""

    meridians: int
    parallels: int
    cap: int


FINE = Grid(64, 32, 16)
# So that each triangle lies in one element of implicit_elements.py.
FITTED = Grid(60, 30, 16)

# A profile in the (radius, height) half plane, from the lower end to the upper: points and normals, shape (m, 2) each.
Profile = tuple[FloatArray, FloatArray]

# The columns of a point that take a Z-axis primitive's x, y and z: cyclic, so that handedness stays.
AXES = {"X": [2, 0, 1], "Y": [1, 2, 0], "Z": [0, 1, 2]}


def is_primitive(type_name: str) -> bool:
    """Whether `read_primitive` knows the prim type."""
    return type_name in READERS


def read_primitive(prim: Any, reading: Reading) -> Surface | None:
    """The triangles of an implicit gprim in its own space; None, with a warning, where its size is no number >= 0."""
    names, tessellate = READERS[str(prim.GetTypeName())]
    sizes = [reading.number(prim, name, np.nan) for name in names]
    if not np.isfinite(sizes).all() or min(sizes) < 0.0:
        authored = ", ".join(f"{name} = {size:g}" for name, size in zip(names, sizes, strict=True))
        reading.warn(prim.GetPath(), f"left out: its size must be finite and not negative, got {authored}")
        return None
    type_name = str(prim.GetTypeName())
    axis = str(reading.get(prim.GetAttribute("axis"), "Z"))
    if axis in ("X", "Y") and type_name == "Plane":
        sizes.reverse()  # the schema lays its width along z for X and along x for Y
    has_elements = varies(prim, reading)
    surface = tessellate(*sizes, FITTED if has_elements else FINE)
    if has_elements:
        corners = np.arange(surface.triangles.size).reshape(-1, 3)
        surface = replace(surface, corners=corners, carrier=elements_of(type_name, surface))
    surface = along_axis(surface, axis)
    gprim = UsdGeom.Gprim(prim)
    left_handed = reading.get(gprim.GetOrientationAttr()) == UsdGeom.Tokens.leftHanded
    return reversed_surface(surface) if left_handed else surface


def along_axis(surface: Surface, axis: str) -> Surface:
    """A surface about Z turned to be about `axis`."""
    columns = AXES.get(axis, AXES["Z"])
    return replace(surface, points=surface.points[:, columns], normals=surface.normals[:, columns])


def cube(size: float) -> Surface:
    """Axis-aligned cube of edge `size` about the origin, 12 flat triangles."""
    points = np.array([[x, y, z] for z in (-0.5, 0.5) for y in (-0.5, 0.5) for x in (-0.5, 0.5)]) * size
    quads = np.array([[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]])
    triangles = quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    return flat_surface(points, triangles, np.repeat(np.arange(6), 2))


def plane(width: float, length: float) -> Surface:
    """Rectangle in the xy plane, `width` along x and `length` along y, front towards +Z."""
    points = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
    return flat_surface(points * [width / 2, length / 2, 0.0], np.array([[0, 1, 2], [0, 2, 3]]), np.zeros(2, np.int64))


def sphere(radius: float, grid: Grid = FINE) -> Surface:
    """Sphere about the origin."""
    return revolve(_arc(radius, 0.0, -np.pi / 2, np.pi / 2, grid.parallels), grid=grid)


def cylinder(height: float, radius_bottom: float, radius_top: float, grid: Grid = FINE) -> Surface:
    """Cylinder or truncated cone with both caps, its middle at the origin."""
    half = height / 2
    return revolve(
        _segment((0.0, -half), (radius_bottom, -half)),
        _segment((radius_bottom, -half), (radius_top, half)),
        _segment((radius_top, half), (0.0, half)),
        grid=grid,
    )


def cone(height: float, radius: float, grid: Grid = FINE) -> Surface:
    """Cone with its base cap at -height/2 and its apex at height/2."""
    half = height / 2
    return revolve(_segment((0.0, -half), (radius, -half)), _segment((radius, -half), (0.0, half)), grid=grid)


def capsule(height: float, radius_bottom: float, radius_top: float, grid: Grid = FINE) -> Surface:
    """The hull of two spheres at -height/2 and height/2: their caps meet the side where it touches them."""
    difference = radius_bottom - radius_top
    within = abs(difference) < height  # otherwise one sphere holds the other, or both are one
    tangent = float(np.arcsin(difference / height) if within else np.pi / 2 * np.sign(difference))
    lower = _arc(radius_bottom, -height / 2, -np.pi / 2, tangent, grid.cap)
    upper = _arc(radius_top, height / 2, tangent, np.pi / 2, grid.cap)
    return revolve((np.concatenate([lower[0], upper[0]]), np.concatenate([lower[1], upper[1]])), grid=grid)


def open_cylinder(length: float, radius: float) -> Surface:
    """Cylinder about Z without caps, its middle at the origin."""
    return revolve(_segment((radius, -length / 2), (radius, length / 2)))


def _arc(radius: float, height: float, begin: float, end: float, segments: int) -> Profile:
    """Circular arc about (0, height) between two latitudes [radian]; its ends on the axis lie there exactly."""
    latitude = np.linspace(begin, end, segments + 1)
    cosine = np.where(np.abs(latitude) == np.pi / 2, 0.0, np.cos(latitude))
    normals = np.stack([cosine, np.sin(latitude)], axis=-1)
    return normals * radius + [0.0, height], normals


def _segment(begin: tuple[float, float], end: tuple[float, float]) -> Profile:
    """Straight piece of a profile; its normal is on the right of its direction, which is outwards."""
    points = np.array([begin, end])
    radial, axial = points[1] - points[0]
    length = np.hypot(radial, axial)
    normal = np.array([axial, -radial]) / (length if length > 0.0 else 1.0)
    return points, np.tile(normal, (2, 1))


def revolve(*profiles: Profile, grid: Grid = FINE) -> Surface:
    """Turns each profile about Z; profiles share no vertices, so that the rims between them are sharp.

    A ring on the axis is turned by half a segment: each of its points then stands in the middle of the one triangle
    that uses it, and a cone's apex normals are symmetric.
    """
    strips = [_revolved_strip(*profile, grid.meridians) for profile in profiles]
    offsets = np.cumsum([0] + [len(points) for points, _, _ in strips[:-1]])
    triangles = np.concatenate([strip[2] + offset for strip, offset in zip(strips, offsets, strict=True)])
    return Surface(
        np.concatenate([strip[0] for strip in strips]),
        triangles,
        np.zeros(len(triangles), np.int64),
        np.concatenate([strip[1] for strip in strips]),
        triangles,
    )


def _revolved_strip(points: FloatArray, normals: FloatArray, meridians: int) -> tuple[FloatArray, FloatArray, Any]:
    """Points and normals, shape (rings * meridians, 3), and two triangles a cell, of one profile."""
    on_axis = points[:, 0] == 0.0
    angle = 2.0 * np.pi * (np.arange(meridians) + 0.5 * on_axis[:, None]) / meridians

    def turned(profile: FloatArray) -> FloatArray:
        radius, height = profile[:, :1], np.broadcast_to(profile[:, 1:], angle.shape)
        return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=-1).reshape(-1, 3)

    ring, column = np.meshgrid(np.arange(len(points) - 1), np.arange(meridians), indexing="ij")
    here, right = ring * meridians + column, ring * meridians + (column + 1) % meridians
    above, above_right = here + meridians, right + meridians
    to_axis = on_axis[1:][ring]  # the one triangle of such a cell uses the point above its middle
    diagonal = np.where(to_axis, above, above_right)
    triangles = np.stack(
        [np.stack([here, right, diagonal], axis=-1), np.stack([here, above_right, above], axis=-1)], axis=-2
    )
    keep = np.stack([~on_axis[:-1][ring], ~to_axis], axis=-1)
    return turned(points), turned(normals), triangles[keep]


READERS: dict[str, tuple[tuple[str, ...], Callable[..., Surface]]] = {
    "Cube": (("size",), lambda size, _: cube(size)),
    "Plane": (("width", "length"), lambda width, length, _: plane(width, length)),
    "Sphere": (("radius",), sphere),
    "Cylinder": (("height", "radius"), lambda height, radius, grid: cylinder(height, radius, radius, grid)),
    "Cylinder_1": (("height", "radiusBottom", "radiusTop"), cylinder),
    "Cone": (("height", "radius"), cone),
    "Capsule": (("height", "radius"), lambda height, radius, grid: capsule(height, radius, radius, grid)),
    "Capsule_1": (("height", "radiusBottom", "radiusTop"), capsule),
}
