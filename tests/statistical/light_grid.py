"""Cells of directions that are the equal parts of a light's surface."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from statistical.lights import RECEIVER

from warpmis.scene import CylinderLight, DiskLight, RectLight


@dataclass(frozen=True, eq=False)
class SurfaceGrid:
    """Cells of directions that are the equal parts of a light's surface, seen from the receiver (float64, NumPy).

    For lights whose density varies too much over cells of direction: slivers, and silhouettes where it is infinite.
    A part's solid angle is its area times cos / distance^2.
    """

    light: RectLight | DiskLight | CylinderLight
    side: int = 12
    cells: int = 144

    def surface(self, a: NDArray[Any], b: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any], float]:
        """Points and unit normals for (a, b) in the unit square, and the area of its image."""
        light = self.light
        if isinstance(light, CylinderLight):
            s, t, half_length, reach = self.towards_receiver()
            phi = (2.0 * b - 1.0) * reach
            n = np.cos(phi)[:, None] * s + np.sin(phi)[:, None] * t
            p = light.center + (2.0 * a - 1.0)[:, None] * light.half_axis + light.radius * n
            return p, n, 4.0 * half_length * reach * light.radius
        normal = np.cross(light.half_v, light.half_u)
        area = float(np.linalg.norm(normal))
        x, y = 2.0 * a - 1.0, 2.0 * b - 1.0
        if isinstance(light, DiskLight):
            x, y = np.sqrt(a) * np.cos(np.pi * y), np.sqrt(a) * np.sin(np.pi * y)
        p = light.center + x[:, None] * light.half_u + y[:, None] * light.half_v
        return p, np.broadcast_to(normal / area, p.shape), area * (np.pi if isinstance(light, DiskLight) else 4.0)

    def towards_receiver(self) -> tuple[NDArray[Any], NDArray[Any], float, float]:
        """Across a cylinder's axis: the directions to the receiver and sideways; half its length; the largest angle
        between its normals that face the receiver and the former."""
        assert isinstance(self.light, CylinderLight)
        half_length = float(np.linalg.norm(self.light.half_axis))
        axis = self.light.half_axis / half_length
        o = RECEIVER - self.light.center
        across = o - axis * (o @ axis)
        distance = float(np.linalg.norm(across))
        s = across / distance
        return s, np.cross(axis, s), half_length, float(np.arccos(self.light.radius / distance))

    def coordinates(self, directions: NDArray[np.float32]) -> tuple[NDArray[Any], NDArray[Any]]:
        """(a, b) of the point that each direction meets first."""
        light, d = self.light, directions.astype(np.float64)
        o = RECEIVER - light.center
        if isinstance(light, CylinderLight):
            s, t, half_length, reach = self.towards_receiver()
            ds, dt, distance = d @ s, d @ t, o @ s
            # A direction that rounding takes past the silhouette meets the mantle where it comes closest.
            root = np.sqrt(np.maximum((ds * distance) ** 2 - (ds**2 + dt**2) * (distance**2 - light.radius**2), 0.0))
            length = (-ds * distance - root) / (ds**2 + dt**2)
            phi = np.arctan2(length * dt, distance + length * ds)
            a = 0.5 + 0.5 * ((o + length[:, None] * d) @ light.half_axis) / half_length**2
            return a, 0.5 + 0.5 * phi / reach
        normal = np.cross(light.half_v, light.half_u)
        p = o - d * ((o @ normal) / (d @ normal))[:, None]
        x, y, _ = np.linalg.solve(np.stack([light.half_u, light.half_v, normal], axis=1), p.T)
        if isinstance(light, DiskLight):
            return x**2 + y**2, 0.5 + 0.5 * np.arctan2(y, x) / np.pi
        return 0.5 + 0.5 * x, 0.5 + 0.5 * y

    def counts(self, directions: NDArray[np.float32]) -> NDArray[np.float64]:
        """Directions in each cell, the last entry those beside the light by more than rounding, shape (cells + 1,)."""
        a, b = self.coordinates(directions)
        inside = (np.abs(a - 0.5) < 0.501) & (np.abs(b - 0.5) < 0.501)
        row, column = (np.clip((c * self.side).astype(int), 0, self.side - 1) for c in (a, b))
        index = np.where(inside, row * self.side + column, self.cells)
        return np.bincount(index, minlength=self.cells + 1).astype(np.float64)

    def lattice(self, side: int) -> tuple[NDArray[Any], NDArray[Any]]:
        """Directions to side x side points of each cell, and the solid angle for which each stands [sr]."""
        steps = (np.arange(self.side)[:, None] + (np.arange(side) + 0.5)[None, :] / side) / self.side
        a, b = np.broadcast_arrays(steps[:, None, :, None], steps[None, :, None, :])
        p, n, area = self.surface(a.ravel(), b.ravel())
        d = p - RECEIVER
        distance = np.linalg.norm(d, axis=1)
        wi = d / distance[:, None]
        cos_light = -np.einsum("ij,ij->i", wi, n)
        return wi, cos_light / distance**2 * area / len(wi)

    def points(self, side: int) -> NDArray[np.float32]:
        return self.lattice(side)[0].astype(np.float32)

    def integrals(self, values: NDArray[np.float32], side: int) -> NDArray[np.float64]:
        return (values.astype(np.float64) * self.lattice(side)[1]).reshape(self.cells, -1).sum(axis=1)
