"""UsdLux lights: their emitted radiance and their shape in world space.

Emission, by the schema: L = intensity 2^exposure color [blackbody] [/ sizeFactor where normalize is on], in nits.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import UsdGeom, UsdLux

from warpmis.scene import (
    CylinderLight,
    DiskLight,
    DistantLight,
    DomeLight,
    Light,
    Material,
    RectLight,
    SphereLight,
)
from warpmis.scene.light_control import PLAIN, LightControl
from warpmis.usd.color_space import linear_color
from warpmis.usd.lights.light_control import read_control, warn_unhonoured
from warpmis.usd.lights.light_picture import read_dome_picture
from warpmis.usd.reading import MAX_COORDINATE, Reading
from warpmis.usd.shapes.primitives import along_axis, open_cylinder, sphere
from warpmis.usd.shapes.surfaces import Surface, cofactors

Vector = NDArray[np.float64]

# How far a transform may be from a uniform scale and a rotation to keep a sphere a sphere.
SIMILARITY_TOLERANCE = 1e-5

# Most that intensity, exposure and color may ask for together, before a light of a given power is divided by its size:
# what is above is a slip, and the division leaves some of MAX_RADIANCE's range to small lights [nit or nit m^2].
MAX_EMISSION = 1e18

# Above this the products of radiance with weights and densities overflow float32 [nit].
MAX_RADIANCE = 1e30

# A line is rendered as a cylinder that is so thick, as a share of its length; its power is that of its intensity over
# its area, whatever the radius.
LINE_RADIUS = 1e-3

# DomeLight_1 with a Z pole: latitude 0, longitude 0 (+Z of the dome's frame) looks along -Y, the pole (+Y) along +Z.
Z_POLE = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


@dataclass(frozen=True, eq=False)
class EmissiveSurface:
    """A light whose transform leaves none of the scene's light shapes: triangles with an emissive material."""

    surface: Surface
    matrix: Vector
    material: Material
    control: LightControl = PLAIN


@dataclass(frozen=True, eq=False)
class Emission:
    """What all light types share.

    Attributes:
        radiance: before the division by the size factor, linear Rec.709, shape (3,), somewhere above 0.
        normalize: whether that division is to be done.
    """

    path: str
    radiance: Vector
    normalize: bool

    def over(self, size_factor: float) -> Vector:
        """Radiance of a light of this size factor (area lights: world-space area)."""
        return self.radiance / size_factor if self.normalize else self.radiance


def is_light(type_name: str) -> bool:
    """Whether `read_light` knows the prim type."""
    return type_name in LIGHTS


def read_light(prim: Any, matrices: NDArray[np.float64], reading: Reading) -> list[Light | EmissiveSurface]:
    """The light of a prim, once for each matrix that has a place for it.

    A light that emits nothing is left out silently; one without size, or with an intensity that is negative or not
    finite, with a warning. What is not supported (shaping, links, filters) gives a warning.

    Args:
        prim: of a type for which `is_light` holds.
        matrices: local to world, USD's row-vector convention, shape (k, 4, 4).
    """
    read = LIGHTS[str(prim.GetTypeName())]
    emission = read_emission(prim, reading)
    if emission is None:
        return []
    warn_unhonoured(prim, reading)
    lights = [read(prim, matrix, emission, reading) for matrix in matrices]
    controls = [read_control(prim, matrix, reading) for matrix in matrices]
    return [
        light if control is PLAIN else replace(light, control=control)
        for light, control in zip(lights, controls, strict=True)
        if light is not None and is_in_range(emission.path, _radiance(light), reading)
    ]


def read_emission(prim: Any, reading: Reading) -> Emission | None:
    """intensity 2^exposure color [blackbody], or None for a light that is left out."""
    path = prim.GetPath()
    light = UsdLux.LightAPI(prim)
    intensity = reading.number(prim, "inputs:intensity", 1.0)
    exposure = reading.number(prim, "inputs:exposure", 0.0)
    authored = reading.get(light.GetColorAttr(), (1.0, 1.0, 1.0))
    color = np.array(linear_color(light.GetColorAttr(), authored, reading), np.float64)
    if reading.get(light.GetEnableColorTemperatureAttr(), False):
        color = color * blackbody_color(reading.number(prim, "inputs:colorTemperature", 6500.0))
    radiance = intensity * np.exp2(exposure) * color
    colors = radiance.tolist()
    if not all(abs(value) <= MAX_EMISSION for value in colors) or intensity < 0.0:
        reading.warn(
            path, f"the light is left out: intensity {intensity:g}, exposure {exposure:g} and color must give a "
            f"finite radiance from 0 to {MAX_EMISSION:g}"
        )  # fmt: skip
        return None
    if min(colors) < 0.0:
        reading.warn(path, "the light's color is negative in places; 0 is used there")
        radiance = np.maximum(radiance, 0.0)
    if max(colors) <= 0.0:
        return None
    return Emission(str(path), radiance, bool(reading.get(light.GetNormalizeAttr(), False)))


def is_in_range(path: str, radiance: Any, reading: Reading) -> bool:
    """Whether float32 can hold a light's radiance, its division by the size done; a warning where not."""
    if max(radiance) <= MAX_RADIANCE:
        return True
    reading.warn(path, f"the light is left out: it is so small that its radiance would be above {MAX_RADIANCE:g}")
    return False


def _radiance(light: Light | EmissiveSurface) -> Any:
    return light.material.mean_emission if isinstance(light, EmissiveSurface) else light.radiance


def blackbody_color(temperature: float) -> Vector:
    """UsdLux's colour of a black body of 1000 to 10000 K, shape (3,); NaN for NaN, which crashes pxr."""
    if math.isnan(temperature):
        return np.full(3, np.nan)
    return np.array(UsdLux.BlackbodyTemperatureAsRgb(min(max(temperature, 1000.0), 10000.0)), np.float64)


def _has_place(path: str, shape: list[Any], area: float, reading: Reading) -> bool:
    """Whether a light's world-space shape is finite and has an area; a warning where not."""
    if not all(np.abs(values).max() <= MAX_COORDINATE for values in shape):
        reading.warn(path, "the light is left out: its size or transform is not finite")
        return False
    if not area > 0.0:
        reading.warn(path, "the light is left out: its area is zero")
        return False
    return True


def _spread(matrix: Vector, sizes: tuple[float, float]) -> tuple[Vector, Vector, Vector]:
    """Centre and world images of x and y times `sizes`, such that cross(half_v, half_u) is where -Z emits to."""
    half_u, half_v = sizes[0] * matrix[0, :3], sizes[1] * matrix[1, :3]
    if np.dot(np.cross(half_v, half_u), matrix[2, :3]) > 0.0:
        half_u = -half_u
    return matrix[3, :3].copy(), half_u, half_v


def _rect(prim: Any, matrix: Vector, emission: Emission, reading: Reading) -> Light | None:
    sizes = reading.number(prim, "inputs:width", 1.0) / 2, reading.number(prim, "inputs:height", 1.0) / 2
    center, half_u, half_v = _spread(matrix, sizes)
    area = 4.0 * float(np.linalg.norm(np.cross(half_u, half_v)))
    if not _has_place(emission.path, [center, half_u, half_v], area, reading):
        return None
    return RectLight(emission.path, center, half_u, half_v, emission.over(area))


def _disk(prim: Any, matrix: Vector, emission: Emission, reading: Reading) -> Light | None:
    radius = reading.number(prim, "inputs:radius", 0.5)
    center, half_u, half_v = _spread(matrix, (radius, radius))
    area = math.pi * float(np.linalg.norm(np.cross(half_u, half_v)))
    if not _has_place(emission.path, [center, half_u, half_v], area, reading):
        return None
    return DiskLight(emission.path, center, half_u, half_v, emission.over(area))


def _sphere(prim: Any, matrix: Vector, emission: Emission, reading: Reading) -> Light | EmissiveSurface | None:
    radius = abs(reading.number(prim, "inputs:radius", 0.5))
    if reading.get(prim.GetAttribute("treatAsPoint"), False) or (radius == 0.0 and emission.normalize):
        return _point(matrix, radius, emission, reading)
    scale = uniform_scale(matrix[:3, :3])
    area = sphere_area(matrix[:3, :3], radius, scale)
    if not _has_place(emission.path, [matrix, radius], area, reading):
        return None
    if scale is None:
        return _emissive(sphere(radius), matrix, emission, area)
    return SphereLight(emission.path, matrix[3, :3].copy(), radius * scale, emission.over(area))


def _point(matrix: Vector, radius: float, emission: Emission, reading: Reading) -> Light | None:
    """A sphere as a point: its radiant intensity is its radiance times its mean projected area, a quarter of its area.

    With normalize that is a quarter of the light's intensity, whatever the radius. A radius of 0 means the same: there
    is no area to multiply by, and exporters write it for lights that are points in their program.
    """
    sized = radius > 0.0 and not emission.normalize
    area = ellipsoid_area(matrix[:3, :3], radius) if sized else 1.0
    if not _has_place(emission.path, [matrix, radius], area, reading):
        return None
    return SphereLight(emission.path, matrix[3, :3].copy(), 0.0, emission.radiance * area / 4.0)


def _cylinder(prim: Any, matrix: Vector, emission: Emission, reading: Reading) -> Light | EmissiveSurface | None:
    length = abs(reading.number(prim, "inputs:length", 1.0))
    radius = abs(reading.number(prim, "inputs:radius", 0.5))
    linear = matrix[:3, :3]
    if radius == 0.0 and (emission.normalize or reading.get(prim.GetAttribute("treatAsLine"), False)):
        emission, radius = replace(emission, normalize=True), length * LINE_RADIUS
    area = cylinder_area(linear, length, radius)
    if not _has_place(emission.path, [matrix, length, radius], area, reading):
        return None
    section = np.linalg.norm(linear[1]), np.linalg.norm(linear[2])
    unit = linear / np.linalg.norm(linear, axis=1, keepdims=True)
    right_angles = np.abs(unit @ unit.T - np.eye(3)).max() < SIMILARITY_TOLERANCE
    if not right_angles or not math.isclose(*section, rel_tol=SIMILARITY_TOLERANCE):
        return _emissive(along_axis(open_cylinder(length, radius), "X"), matrix, emission, area)
    return CylinderLight(
        emission.path, matrix[3, :3].copy(), 0.5 * length * linear[0], float(radius * section[0]), emission.over(area)
    )


def _emissive(surface: Surface, matrix: Vector, emission: Emission, area: float) -> EmissiveSurface:
    return EmissiveSurface(surface, matrix, shining_black(emission.path, emission.over(area)))


def shining_black(path: str, radiance: Vector) -> Material:
    """A surface that reflects nothing and emits the radiance, shape (3,)."""
    red, green, blue = radiance.tolist()
    return Material(path=path, diffuse_color=(0.0, 0.0, 0.0), emissive_color=(red, green, blue), lambertian=True)


def _distant(prim: Any, matrix: Vector, emission: Emission, reading: Reading) -> Light | None:
    direction = matrix[2, :3] / (float(np.linalg.norm(matrix[2, :3])) or 1.0)
    angle = reading.number(prim, "inputs:angle", 0.53)
    if not _has_place(emission.path, [direction, angle], float(np.linalg.norm(direction)), reading):
        return None
    half_angle = math.radians(min(max(angle, 0.0), 360.0)) / 2
    return DistantLight(emission.path, direction, half_angle, emission.over(distant_size_factor(half_angle)))


def distant_size_factor(half_angle: float) -> float:
    """The schema's sizeFactor of a DistantLight: the irradiance of radiance 1 on a surface facing it."""
    if half_angle == 0.0:
        return 1.0
    square = math.sin(half_angle) ** 2
    return math.pi * (square if half_angle <= math.pi / 2 else 2.0 - square)


def _dome(prim: Any, matrix: Vector, emission: Emission, reading: Reading) -> Light | None:
    linear = matrix[:3, :3].T
    if not _has_place(emission.path, [linear], abs(float(np.linalg.det(linear))), reading):
        return None
    left, _, right = np.linalg.svd(linear)
    to_world = left @ right
    if _has_z_pole(prim, reading):
        to_world = to_world @ Z_POLE
    return DomeLight(emission.path, to_world, emission.radiance, read_dome_picture(prim, reading))


def _has_z_pole(prim: Any, reading: Reading) -> bool:
    """Whether a DomeLight_1's own pole is +Z, not +Y."""
    pole = str(reading.get(prim.GetAttribute("poleAxis"), "Y"))
    return pole == "Z" or (pole == "scene" and UsdGeom.GetStageUpAxis(reading.stage) == UsdGeom.Tokens.z)


def uniform_scale(linear: Vector) -> float | None:
    """The factor by which a matrix of shape (3, 3) scales all lengths, or None for one that changes shapes."""
    rows = linear.tolist()  # Python is done with nine numbers before NumPy has begun
    gram = [a[0] * b[0] + a[1] * b[1] + a[2] * b[2] for a in rows for b in rows]
    square = (gram[0] + gram[4] + gram[8]) / 3.0
    apart = max(abs(value - (0.0 if i % 4 else square)) for i, value in enumerate(gram))
    return math.sqrt(square) if apart <= SIMILARITY_TOLERANCE * square else None


def sphere_area(linear: Vector, radius: float, scale: float | None) -> float:
    """Area of a sphere's image under a matrix of shape (3, 3), whose uniform scale is known, or None."""
    return ellipsoid_area(linear, radius) if scale is None else 4.0 * math.pi * (radius * scale) ** 2


def ellipsoid_area(linear: Vector, radius: float) -> float:
    """Area of a sphere's image under a matrix of shape (3, 3): radius^2 times the integral of |cofactors n| over n."""
    normals, solid_angles = _directions()
    stretch = np.linalg.norm(normals @ cofactors(linear), axis=-1)
    return float(stretch @ solid_angles) * radius * radius


@cache
def _directions() -> tuple[Vector, Vector]:
    """Nodes of a quadrature over the sphere, shape (n, 3), and the solid angle of each, shape (n,)."""
    cosine, weight = np.polynomial.legendre.leggauss(64)
    angle = 2.0 * np.pi * (np.arange(128) + 0.5) / 128
    sine = np.sqrt(1.0 - cosine**2)[:, None]
    normals = np.stack(
        [sine * np.cos(angle), sine * np.sin(angle), np.broadcast_to(cosine[:, None], (64, 128))], axis=-1
    )
    return normals.reshape(-1, 3), np.repeat(weight, 128) * (2.0 * np.pi / 128)


def cylinder_area(linear: Vector, length: float, radius: float) -> float:
    """Area of the image of a cylinder about X without caps, under a matrix of shape (3, 3)."""
    angle = 2.0 * np.pi * (np.arange(256) + 0.5) / 256
    tangents = np.stack([np.zeros(256), -np.sin(angle), np.cos(angle)], axis=-1)
    stretch = np.linalg.norm(np.cross(linear[0], tangents @ linear), axis=-1)
    return float(stretch.mean()) * 2.0 * np.pi * radius * length


LIGHTS: dict[str, Callable[[Any, Vector, Emission, Reading], Light | EmissiveSurface | None]] = {
    "RectLight": _rect,
    "DiskLight": _disk,
    "SphereLight": _sphere,
    "CylinderLight": _cylinder,
    "DistantLight": _distant,
    "DomeLight": _dome,
    "DomeLight_1": _dome,
}
