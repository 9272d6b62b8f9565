"""Lights made of geometry: a gprim with LightAPI or MeshLightAPI, by its light:materialSyncMode."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpmis.scene.light_control import LightControl
from warpmis.usd.lights.light import Emission, is_in_range, read_emission, shining_black
from warpmis.usd.lights.light_control import read_control, warn_unhonoured
from warpmis.usd.materials.material import MaterialReader
from warpmis.usd.reading import Reading
from warpmis.usd.shapes.instance_primvars import Scopes
from warpmis.usd.shapes.surfaces import Shading, Surface

Vector = NDArray[np.float64]


def read_mesh_light(
    prim: Any, surface: Surface, matrix: Vector, scopes: Scopes, materials: MaterialReader, reading: Reading
) -> tuple[Shading, LightControl]:
    """What the gprim's triangles are made of as a light at one place, and what the light asks for.

    noMaterialResponse: black, and shines in the light's color. materialGlowTintsLight: its material, whose emission
    times the light's color is what surfaces see. independent: its material, which shines in the light's color.

    Args:
        matrix: local to world, USD's row-vector convention, shape (4, 4).
        scopes: as Placement.scopes, of this one place.
    """
    emission = read_emission(prim, reading)
    radiance = np.zeros(3) if emission is None else _radiance(emission, surface, matrix)
    if emission is not None and not is_in_range(emission.path, radiance, reading):
        radiance = np.zeros(3)
    control = read_control(prim, matrix, reading)
    warn_unhonoured(prim, reading)
    mode = str(reading.get(prim.GetAttribute("light:materialSyncMode"), "noMaterialResponse"))
    if mode not in ("materialGlowTintsLight", "independent"):
        index = materials.shared_index if prim.IsInstanceProxy() else materials.index
        return _all_of(surface, index(shining_black(str(prim.GetPath()), radiance))), control
    shading = materials.of_surface(prim, surface, scopes)
    if mode == "independent":
        reading.warn(prim.GetPath(), "materialSyncMode independent: the camera sees the light's color, too")
        return _shining_in(radiance, shading, materials), control
    known = list(materials.materials)
    if radiance.any() and not any(max(known[i].mean_emission) > 0.0 for i in np.unique(shading.materials)):
        reading.warn(
            prim.GetPath(), "its material does not glow, so it is no light: materialSyncMode is materialGlowTintsLight"
        )
    return shading, replace(control, tint=radiance)


def _radiance(emission: Emission, surface: Surface, matrix: Vector) -> Vector:
    """Over the surface's area in the world where the light is normalized."""
    points = surface.points @ matrix[:3, :3]
    corners = points[surface.triangles]
    crosses = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * float(np.linalg.norm(crosses, axis=1).sum())
    return emission.over(area) if area > 0.0 else np.zeros(3)


def _all_of(surface: Surface, index: int) -> Shading:
    count = len(surface.triangles)
    return Shading(np.full(count, index), np.zeros((count, 3, 0), np.float32))


def _shining_in(radiance: Vector, shading: Shading, materials: MaterialReader) -> Shading:
    """The same materials with another emission."""
    red, green, blue = radiance.tolist()
    known = list(materials.materials)
    used, place = np.unique(shading.materials, return_inverse=True)
    indices = [materials.index(replace(known[i], emissive_color=(red, green, blue))) for i in used]
    return replace(shading, materials=np.array(indices, np.int64)[place])
