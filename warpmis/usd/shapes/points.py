"""UsdGeomPoints as spheres of triangles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from pxr import UsdGeom

from warpmis.usd.authored import read_authored
from warpmis.usd.reading import Reading
from warpmis.usd.shapes.subdiv.masks import LINEAR_TRIANGLES
from warpmis.usd.shapes.subdiv.topology import edge_table
from warpmis.usd.shapes.surfaces import FloatArray, IntArray, Surface
from warpmis.usd.shapes.thin_widths import thin_widths
from warpmis.usd.sight import largest_places, sampled, worthwhile_levels

# Points are rendered as icosahedra refined as often as subdivision surfaces, but not beyond this.
MAX_TRIANGLES = 1 << 22


@dataclass(frozen=True, eq=False)
class PointElements:
    """The carrier (surfaces.PrimvarCarrier) of the primvars of so many points, each of which is a place."""

    count: int

    @property
    def elements(self) -> Mapping[str, int]:
        return {"constant": 1, "uniform": 1} | dict.fromkeys(("varying", "vertex", "faceVarying"), self.count)

    def primvar(self, values: FloatArray, indices: IntArray, interpolation: str) -> tuple[FloatArray, IntArray]:
        rows = np.arange(self.count) * (interpolation not in ("constant", "uniform"))
        return values, indices[rows] if len(indices) else rows


def read_points(prim: Any, matrices: FloatArray, reading: Reading) -> Surface | None:
    """A sphere for each point of a UsdGeomPoints, in its own space, the points being its faces; None without any.

    Args:
        matrices: local to world, shape (k, 4, 4).
    """
    schema = UsdGeom.Points(prim)
    points = reading.vectors(schema.GetPointsAttr())
    if not len(points):
        return None
    carrier = PointElements(len(points))
    widths = read_authored(prim, "widths", str(schema.GetWidthsInterpolation()), carrier.elements, reading)
    if widths is None:
        widths = thin_widths(prim, points, matrices, reading)
    diameters = np.broadcast_to(widths.flattened, (len(points), 1))
    sound = np.isfinite(points).all(axis=1) & np.isfinite(diameters[:, 0])
    if not sound.all():
        reading.warn(prim.GetPath(), f"{int((~sound).sum())} points left out: they or their widths are not finite")
    shown = np.flatnonzero(sound & (diameters[:, 0] > 0.0))
    most = levels = _visible_levels(points[shown], diameters[shown, 0], matrices, reading)
    while levels > 0 and 20 * 4**levels * len(shown) > MAX_TRIANGLES:
        levels -= 1
    if levels < most:
        reading.warn(prim.GetPath(), f"its {len(shown)} points are rendered in less detail than asked for")
    directions, triangles = icosphere(levels)
    spheres = points[shown, None] + 0.5 * diameters[shown, None] * directions
    faces = np.repeat(shown, len(triangles))
    return Surface(
        points=spheres.reshape(-1, 3),
        triangles=(np.arange(len(shown))[:, None, None] * len(directions) + triangles).reshape(-1, 3),
        faces=faces,
        normals=directions,
        normal_indices=np.tile(triangles, (len(shown), 1)),
        corners=faces[:, None],
        carrier=carrier,
    )


def _visible_levels(points: FloatArray, diameters: FloatArray, matrices: FloatArray, reading: Reading) -> int:
    """The reading's levels, but none whose triangles are smaller than a pixel where the points look largest."""
    if reading.sight is None or not len(points):
        return reading.levels
    rows = sampled(len(points))
    low, high = points.min(axis=0), points.max(axis=0)
    levels = 0
    for matrix in largest_places(matrices, (low + high) / 2, float(np.linalg.norm(high - low)) / 2, reading.sight):
        scale = float(np.linalg.norm(matrix[:3, :3])) / np.sqrt(3.0)
        pixels = reading.sight.pixels(points[rows] @ matrix[:3, :3] + matrix[3, :3])
        first = np.pi * (diameters[rows] * scale * pixels) ** 2 / (20 * 4)
        levels = max(levels, worthwhile_levels(first, reading.levels))
    return levels


def icosphere(levels: int) -> tuple[FloatArray, IntArray]:
    """Unit vectors, shape (10 * 4^levels + 2, 3), and triangles, shape (20 * 4^levels, 3), of a refined icosahedron."""
    ring = np.arange(5)
    angle = 2.0 * np.pi * ring / 5.0
    height, radius = 1.0 / np.sqrt(5.0), 2.0 / np.sqrt(5.0)
    upper = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(5, height)], axis=-1)
    directions = np.concatenate([[[0.0, 0.0, 1.0]], upper, -upper, [[0.0, 0.0, -1.0]]])
    following = (ring + 1) % 5
    across = 6 + (ring + 3) % 5  # the lower vertex half a segment after: -upper turns by half a round
    triangles = np.concatenate(
        [
            np.stack([0 * ring, 1 + ring, 1 + following], axis=-1),
            np.stack([1 + ring, across, 1 + following], axis=-1),
            np.stack([1 + following, across, 6 + (ring + 4) % 5], axis=-1),
            np.stack([0 * ring + 11, 6 + following, 6 + ring], axis=-1),
        ]
    )
    topology = edge_table(np.full(20, 3), triangles.reshape(-1), 12)
    for _ in range(levels):
        directions = LINEAR_TRIANGLES.refine(topology, directions)
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        topology = LINEAR_TRIANGLES.split(topology)
    return directions, topology.indices.reshape(-1, 3)
