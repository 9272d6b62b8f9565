"""The scene between USD and the renderer: plain frozen NumPy data in world space, no pxr and no Warp.

World space is the stage's own: its up axis and its unit of length are kept, so nothing here depends on
metersPerUnit or upAxis. Colours are linear Rec.709; radiance is in nits as UsdLux defines it, so that a light of
intensity 1 seen by the camera is a pixel of 1.

Instances are flattened, but for those whose copies would take much memory: these stand as prototypes with a transform
for each place.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpmis.geometry import Float32Array, Geometry, Prototype
from warpmis.light_control import PLAIN, LightControl
from warpmis.texture import Lookup, TextureLookup, is_lookup, mean_of

Color = tuple[float, float, float]


@dataclass(frozen=True)
class Prim:
    """A gprim as rendered: its path (instances: the instance proxy's path) and its sidedness.

    Surfaces are laminae: both sides reflect. `double_sided` decides whether an emissive surface shines on both
    sides or from its front alone. `control` is what a light prim made of geometry asks for.
    """

    path: str
    double_sided: bool = False
    control: LightControl = PLAIN


@dataclass(frozen=True)
class Material:
    """UsdPreviewSurface (names, ranges and defaults are the specification's), each input a constant or a lookup.

    `lambertian` is the surface of a prim with no material: diffuse alone, no specular lobe at all. `normal` is a
    vector in the frame of the shading normal and the texture coordinates' directions, None for the shading normal
    itself. `opacity_threshold`, if above 0, makes an opacity that is looked up 0 or 1; a constant one is so already.
    """

    path: str = ""
    diffuse_color: Color | Lookup = (0.18, 0.18, 0.18)
    emissive_color: Color | Lookup = (0.0, 0.0, 0.0)
    use_specular_workflow: bool = False
    specular_color: Color | Lookup = (0.0, 0.0, 0.0)
    metallic: float | Lookup = 0.0
    roughness: float | Lookup = 0.5
    clearcoat: float | Lookup = 0.0
    clearcoat_roughness: float | Lookup = 0.01
    opacity: float | Lookup = 1.0
    opacity_threshold: float = 0.0
    opacity_mode: str = "transparent"  # or "presence"
    ior: float = 1.5
    normal: TextureLookup | None = None
    lambertian: bool = False

    @property
    def lookups(self) -> dict[str, Lookup]:
        """The inputs that are not constant, by name."""
        return {name: value for name, value in vars(self).items() if is_lookup(value)}

    @cached_property
    def mean(self) -> Material:
        """The material with constant inputs alone, a lookup's mean for each, and the surface's own normal."""
        means = {
            name: mean_of(value, high=np.inf if name == "emissive_color" else 1.0)
            for name, value in self.lookups.items()
            if name not in ("opacity", "normal")
        }
        for name in COLOR_INPUTS:
            if isinstance(means.get(name), float):
                means[name] = (means[name],) * 3
        opacity = mean_of(self.opacity, threshold=self.opacity_threshold)
        return replace(self, **means, opacity=opacity, normal=None)

    @property
    def mean_emission(self) -> tuple[float, float, float]:
        """Emitted radiance [nit]: where opacity means presence, what is not there does not shine either.

        Where inputs are lookups, a mean over their texels: 0 if and only if the material emits nowhere.
        """
        constant: Any = self.mean
        share = constant.opacity if constant.opacity_mode == "presence" else 1.0
        red, green, blue = constant.emissive_color
        return (share * red, share * green, share * blue)


COLOR_INPUTS = ("diffuse_color", "emissive_color", "specular_color")


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


@dataclass(frozen=True, eq=False)
class Camera:
    """A camera with a pinhole or a thin lens, or an orthographic one.

    The ray through the picture point (x, y), both in [0, 1) with (0, 0) the upper left corner, leaves `position`
    along  forward + (left + x (right - left)) right_axis + (top + y (bottom - top)) up_axis  with the window
    (left, right, bottom, top) at unit distance, already fitted to `resolution`'s aspect. An orthographic camera's
    ray leaves that point of the window about `position`, along `forward`.

    Attributes:
        position: [scene units], shape (3,) float64.
        right_axis, up_axis, forward: orthonormal, world space, shape (3,) float64.
        window: (left, right, bottom, top) at unit distance; of an orthographic camera [scene units].
        lens_radius: of a thin lens, perspective alone; 0 is a pinhole [scene units].
        focus_distance: along `forward`, above 0 where there is a lens [scene units].
        exposure: factor on the picture.
        shutter: when it opens and closes, relative to Scene.time [time codes]; both equal without motion blur.
        clipping_planes: rows (n, d), world space; the camera sees a point p where n . (p - position) + d >= 0
            for all of them, light goes everywhere, shape (n, 4) float64.
    """

    path: str
    position: NDArray[np.float64]
    right_axis: NDArray[np.float64]
    up_axis: NDArray[np.float64]
    forward: NDArray[np.float64]
    window: tuple[float, float, float, float]
    orthographic: bool = False
    lens_radius: float = 0.0
    focus_distance: float = 0.0
    exposure: float = 1.0
    shutter: tuple[float, float] = (0.0, 0.0)
    clipping_planes: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 4)))


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything that the renderer needs of a stage at one time.

    Emissive surfaces are ordinary triangles whose material has an emissive_color: the renderer finds them itself.

    Attributes:
        name: the stage's file name or identifier.
        resolution: (width, height) [pixel].
        geometry: the triangles in world space; prototypes: those that are traced through transforms.
        origin: of all positions here, in the stage's world space: 0 but for scenes far from it [scene units], shape
            (3,) float64.
        time: of the stage [time code].
        warnings: what was found but not honoured, a line each, with the prim path.
        notes: what was supplied because the stage has none (camera, light), a line each.
    """

    name: str
    camera: Camera
    resolution: tuple[int, int]
    geometry: Geometry
    materials: tuple[Material, ...]
    prims: tuple[Prim, ...]
    lights: tuple[Light, ...]
    origin: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    time: float = 0.0
    warnings: tuple[str, ...] = field(default=())
    notes: tuple[str, ...] = field(default=())
    prototypes: tuple[Prototype, ...] = ()

    @property
    def parts(self) -> tuple[Geometry, ...]:
        """The triangles in world space, and those of each prototype."""
        return (self.geometry, *(prototype.geometry for prototype in self.prototypes))

    @property
    def used_materials(self) -> NDArray[np.int32]:
        """The indices of the materials that triangles have, ascending."""
        return np.unique(np.concatenate([np.unique(part.materials) for part in self.parts]))

    @property
    def instance_count(self) -> int:
        """How many places the prototypes have."""
        return sum(len(prototype.prims) for prototype in self.prototypes)

    @property
    def triangle_count(self) -> int:
        """Triangles to be seen, those of a prototype in each of its places."""
        copied = sum(len(one.prims) * len(one.geometry.triangles) for one in self.prototypes)
        return len(self.geometry.triangles) + copied
