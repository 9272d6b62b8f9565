"""The kinds of light. Radiance is in nits, as UsdLux defines it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpmis.scene.geometry import Float32Array
from warpmis.scene.light_control import PLAIN, LightControl


@dataclass(frozen=True, eq=False)
class RectLight:
    """A parallelogram that emits from one side: centre +- half_u +- half_v, towards cross(half_v, half_u).

    UsdLuxRectLight lies in its xy plane and emits along -Z: half_u is the world image of (width/2, 0, 0), half_v
    of (0, height/2, 0), and the reader flips half_u where the transform mirrors, so that the cross product holds.

    Attributes:
        center, half_u, half_v: [scene units], shape (3,) float64.
        radiance: emitted radiance, linear Rec.709 [nit], shape (3,) float64.
    """

    path: str
    center: NDArray[np.float64]
    half_u: NDArray[np.float64]
    half_v: NDArray[np.float64]
    radiance: NDArray[np.float64]
    control: LightControl = PLAIN


@dataclass(frozen=True, eq=False)
class DiskLight:
    """An ellipse that emits from one side: centre + cos(t) half_u + sin(t) half_v, towards cross(half_v, half_u)."""

    path: str
    center: NDArray[np.float64]
    half_u: NDArray[np.float64]
    half_v: NDArray[np.float64]
    radiance: NDArray[np.float64]
    control: LightControl = PLAIN


@dataclass(frozen=True, eq=False)
class SphereLight:
    """A sphere that emits outwards. A non-uniformly scaled one is read as triangles with an emissive material instead.

    `radius` 0 is a point light (treatAsPoint): `radiance` is then its radiant intensity, light arriving as
    intensity / distance^2.
    """

    path: str
    center: NDArray[np.float64]
    radius: float
    radiance: NDArray[np.float64]
    control: LightControl = PLAIN


@dataclass(frozen=True, eq=False)
class CylinderLight:
    """A circular cylinder without caps that emits outwards, about centre +- half_axis.

    Attributes:
        half_axis: from the centre to one end [scene units], shape (3,) float64.
        radius: [scene units].
    """

    path: str
    center: NDArray[np.float64]
    half_axis: NDArray[np.float64]
    radius: float
    radiance: NDArray[np.float64]
    control: LightControl = PLAIN


@dataclass(frozen=True, eq=False)
class DistantLight:
    """A light at infinity that fills a cone.

    Attributes:
        direction: unit vector from the scene towards the light, shape (3,) float64.
        half_angle: half of UsdLux's `angle` [radian]; 0 is a delta light.
        radiance: [nit]; for half_angle 0 the irradiance on a surface facing the light [lux].
    """

    path: str
    direction: NDArray[np.float64]
    half_angle: float
    radiance: NDArray[np.float64]
    control: LightControl = PLAIN


@dataclass(frozen=True, eq=False)
class DomeLight:
    """The environment: constant, or a lat-long picture.

    The picture's column coordinate u in [0, 1) and row coordinate v (0 is the top) look, in the dome's own frame,
    along (sin(pi v) sin(2 pi u), cos(pi v), -sin(pi v) cos(2 pi u)): u = 0.25 is +X, u = 0.5 is +Z, the pole +Y.

    Attributes:
        to_world: rotation from the dome's frame to world space (any poleAxis already in it), shape (3, 3) float64,
            used as to_world @ direction.
        radiance: factor on the picture, or the constant radiance [nit], shape (3,) float64.
        picture: linear Rec.709, shape (rows, columns, 3) float32, or None.
    """

    path: str
    to_world: NDArray[np.float64]
    radiance: NDArray[np.float64]
    picture: Float32Array | None = None
    control: LightControl = PLAIN


Light = RectLight | DiskLight | SphereLight | CylinderLight | DistantLight | DomeLight
