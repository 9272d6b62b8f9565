"""Primvars of the implicit gprims: their elements are those of the coarse meshes that USD's own imaging makes of them.

The schemas do not say how many values a sphere takes, or where. usdrecord shows each implicit gprim as a mesh, whose
points and faces give the numbers and the order. Values are interpolated on the true shape between the places where that
mesh has them, evenly in angle.

Reference: OpenUSD, pxr/imaging/geomUtil (the order of points and faces), pxr/usdImaging/usdImaging (how many).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from pxr import UsdGeom

from warpmis.usd.reading import Reading
from warpmis.usd.shapes.surfaces import FloatArray, IntArray, Surface

# Segments about the axis of the meshes that USD makes.
SECTORS = 10


@dataclass(frozen=True, eq=False)
class CageElements:
    """The carrier (surfaces.PrimvarCarrier) of a shape's primvars, whose places are the corners of its triangles.

    Attributes:
        face_corners: points of each of the cage's faces, of which some have three, shape (n, 4).
        counts: corners of each, shape (n,).
        face: of each triangle the face that it lies in, shape (f,); weights: of its corners among the face's, shape
            (f, 3, 4).
    """

    face_corners: IntArray
    counts: IntArray
    face: IntArray
    weights: FloatArray

    @property
    def elements(self) -> Mapping[str, int]:
        points = int(self.face_corners.max()) + 1
        numbers = {"constant": 1, "uniform": len(self.counts), "faceVarying": int(self.counts.sum())}
        return numbers | dict.fromkeys(("vertex", "varying"), points)

    def primvar(self, values: FloatArray, indices: IntArray, interpolation: str) -> tuple[FloatArray, IntArray]:
        values = values[indices] if len(indices) else values
        if interpolation in ("constant", "uniform"):
            rows = np.repeat(self.face, 3)
            return values, rows if interpolation == "uniform" else np.zeros_like(rows)
        corners = self.face_corners
        if interpolation == "faceVarying":
            first = np.cumsum(self.counts) - self.counts
            corners = first[:, None] + np.minimum(np.arange(4), self.counts[:, None] - 1)
        found = np.einsum("fcw,fwk->fck", self.weights, values[corners[self.face]])
        return found.reshape(-1, values.shape[1]), np.arange(3 * len(self.face))


class Rings(NamedTuple):
    """The cage of a surface of revolution, from the lower end to the upper.

    Attributes:
        latitudes: of each profile of primitives.revolve the strip of each of its points, and how far up in it.
        rings: of each strip the first points of its lower and its upper ring.
        lower_pole, upper_pole: the point in which the first and the last strip end, or -1 for a ring there.
    """

    latitudes: tuple[FloatArray, ...]
    rings: IntArray
    lower_pole: int
    upper_pole: int


def stacked(strips: int) -> IntArray:
    """Rings that neighbouring strips share, between a pole at each end."""
    upper = 1 + SECTORS * np.arange(strips)
    return np.stack([upper - SECTORS, upper], axis=1)


CYLINDER = Rings((np.array([0.0, 1.0]), np.array([1.0, 2.0]), np.array([2.0, 3.0])),
                 np.array([[0, 1], [11, 21], [31, 41]]), 0, 41)  # fmt: skip
CONE = Rings((np.array([0.0, 1.0]), np.array([1.0, 2.0])), np.array([[0, 1], [11, 21]]), 0, -1)
# The strips of primitives.FITTED, so that each triangle lies in one face.
SPHERE = Rings((np.linspace(0.0, 10.0, 31),), stacked(10), 0, 91)
CAPSULE = Rings((np.append(np.linspace(0.0, 4.0, 17), np.linspace(5.0, 9.0, 17)),), stacked(9), 0, 81)
RINGS = {
    "Sphere": SPHERE,
    "Cylinder": CYLINDER,
    "Cylinder_1": CYLINDER,
    "Cone": CONE,
    "Capsule": CAPSULE,
    "Capsule_1": CAPSULE,
}
# Faces of a cube and a plane, and of our points those of the cage.
FLAT = {
    "Cube": (
        [[0, 1, 2, 3], [4, 5, 6, 7], [0, 6, 5, 1], [4, 7, 3, 2], [0, 3, 7, 6], [4, 2, 1, 5]],
        [4, 7, 5, 6, 2, 3, 1, 0],
    ),
    "Plane": ([[0, 1, 2, 3]], [2, 3, 0, 1]),
}


def varies(prim: Any, reading: Reading) -> bool:
    """Whether an implicit gprim may have a primvar that is not the same all over it."""
    return any(
        str(primvar.GetInterpolation()) != "constant" and len(np.atleast_1d(reading.value(primvar.GetAttr()))) > 1
        for primvar in UsdGeom.PrimvarsAPI(prim).GetPrimvarsWithAuthoredValues()
    )


def elements_of(type_name: str, surface: Surface) -> CageElements:
    """The elements of an implicit gprim with this surface, about Z and of primitives.FITTED where it is round."""
    if type_name in FLAT:
        return _flat_elements(*FLAT[type_name], surface.triangles)
    return _round_elements(RINGS[type_name], surface)


def _flat_elements(faces: list[list[int]], points: list[int], triangles: IntArray) -> CageElements:
    face_corners = np.array(faces)
    own = np.array(points)[triangles]
    is_corner = own[:, None, :, None] == face_corners[None, :, None]  # triangle, face, corner of either
    face = is_corner.any(axis=3).all(axis=2).argmax(axis=1)
    weights = is_corner[np.arange(len(face)), face].astype(np.float64)
    return CageElements(face_corners, np.full(len(faces), 4), face, weights)


def _round_elements(shape: Rings, surface: Surface) -> CageElements:
    latitudes = np.concatenate(shape.latitudes)
    meridians = len(surface.points) // len(latitudes)
    row, column = np.divmod(surface.triangles, meridians)
    # A triangle across the seam has its columns side by side; a ring on the axis is turned by half a segment.
    column = np.where((column == 0) & (np.ptp(column, axis=1) > 1)[:, None], meridians, column)
    turned = (surface.points[:, :2] == 0.0).all(axis=1)[surface.triangles]
    latitude, longitude = latitudes[row], (column + 0.5 * turned) * SECTORS / meridians
    strip = np.minimum(latitude.min(axis=1), len(shape.rings) - 1).astype(np.int64)
    sector = longitude.min(axis=1).astype(np.int64)
    kinds = _strip_kinds(shape)
    face_corners, counts = _faces(shape, kinds)
    weights = _corner_weights(latitude - strip[:, None], longitude - sector[:, None], kinds[strip])
    return CageElements(face_corners, counts, strip * SECTORS + sector, weights)


def _corner_weights(s: FloatArray, u: FloatArray, kind: IntArray) -> FloatArray:
    """CageElements.weights, of points at s from the lower to the upper end of a face and u across it, (f, 3) each."""
    at_low, at_high = np.stack([1.0 - u, u], axis=-1), np.stack([u, 1.0 - u], axis=-1)
    s = s[..., None]
    zero = np.zeros_like(s)
    quad = np.concatenate([(1.0 - s) * at_low, s * at_high], axis=-1)
    below = np.concatenate([s * at_high, 1.0 - s, zero], axis=-1)
    above = np.concatenate([(1.0 - s) * at_low, s, zero], axis=-1)
    kind = kind[:, None, None]
    return np.where(kind < 0, below, np.where(kind > 0, above, quad))


def _strip_kinds(shape: Rings) -> IntArray:
    """Of each strip -1 for triangles about the lower pole, 1 about the upper one, and 0 for quadrilaterals."""
    kinds = np.zeros(len(shape.rings), np.int64)
    kinds[0] = -1 if shape.lower_pole >= 0 else 0
    kinds[-1] = 1 if shape.upper_pole >= 0 else 0
    return kinds


def _faces(shape: Rings, kinds: IntArray) -> tuple[IntArray, IntArray]:
    """The points of all faces, strip after strip, and their numbers of corners."""
    here = np.arange(SECTORS)
    there = (here + 1) % SECTORS
    faces = []
    for (lower, upper), kind in zip(shape.rings, kinds, strict=True):
        if kind < 0:
            pole = np.full(SECTORS, shape.lower_pole)
            faces.append([upper + there, upper + here, pole, pole])
        elif kind > 0:
            pole = np.full(SECTORS, shape.upper_pole)
            faces.append([lower + here, lower + there, pole, pole])
        else:
            faces.append([lower + here, lower + there, upper + there, upper + here])
    corners: IntArray = np.concatenate([np.stack(face, axis=1) for face in faces])
    return corners, np.repeat(np.where(kinds == 0, 4, 3), SECTORS)
