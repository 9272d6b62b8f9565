"""Scene lights as the records that kernels read."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from warpmis.device.environment import LUMINANCE, Environment, combine
from warpmis.device.views import (
    CYLINDER,
    DELTA_DISTANT,
    DELTA_POINT,
    DISK,
    DISTANT,
    DOME,
    MESH,
    NO_LIGHT,
    RECT,
    SPHERE,
    DeltaLightView,
    LightView,
)
from warpmis.scene import (
    CylinderLight,
    DiskLight,
    DistantLight,
    DomeLight,
    Light,
    RectLight,
    Scene,
    SphereLight,
)
from warpmis.scene.features import is_delta, is_emissive
from warpmis.scene.geometry import Geometry
from warpmis.scene.light_control import LightControl

# No light counts for less than this share of the brightest one when lights are chosen.
MIN_SHARE = 1e-20


@dataclass(eq=False)
class LightTables:
    """The lights of a scene, ready to upload.

    Attributes:
        lights, delta_lights: records; the lights at a distance come first, then those at infinity.
        triangle_light: per triangle the mesh light that it belongs to, or NO_LIGHT, shape (F,) int32.
        emitter_triangles, emitter_cdf: the mesh lights' triangles, one light after the other, with the cumulative
            share of the light's area.
        environment: all domes as one, or None.
        controls: what is asked of each of the lights and then of the delta lights.
    """

    lights: list[LightView] = field(default_factory=list)
    delta_lights: list[DeltaLightView] = field(default_factory=list)
    triangle_light: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, np.int32))
    emitter_triangles: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, np.int32))
    emitter_cdf: NDArray[np.float32] = field(default_factory=lambda: np.zeros(0, np.float32))
    environment: Environment | None = None
    controls: list[LightControl] = field(default_factory=list)


def light_tables(scene: Scene, geometry: Geometry) -> LightTables:
    """Records of all lights; `geometry` is the scene's, in the order in which it is uploaded."""
    tables = LightTables(triangle_light=np.full(len(geometry.triangles), NO_LIGHT, dtype=np.int32))
    domes = [light for light in scene.lights if isinstance(light, DomeLight)]
    delta = [light for light in scene.lights if is_delta(light)]
    tables.delta_lights += [delta_record(light) for light in delta]
    extended = [light for light in scene.lights if not is_delta(light) and not isinstance(light, DomeLight)]
    add_records(tables, [light for light in extended if not isinstance(light, DistantLight)])
    add_mesh_lights(tables, scene, geometry)
    add_records(tables, [light for light in extended if isinstance(light, DistantLight)])
    if domes:
        tables.environment = combine(domes)
        dome = blank_record(DOME, tables.environment.radiance)
        dome.luminance = tables.environment.luminance
        tables.lights.append(dome)
        tables.controls.append(domes[0].control)
    tables.controls += [light.control for light in delta]
    make_luminance_relative(tables.lights)
    return tables


def make_luminance_relative(lights: list[LightView]) -> None:
    """Luminance as a share of the brightest light's: the choice among lights needs no more, and float32 could not hold
    some lights' times their solid angle. The share stays above 0, or the light would never be sampled."""
    brightest = max((light.luminance for light in lights), default=0.0)
    for light in lights:
        light.luminance = max(light.luminance / brightest, MIN_SHARE) if brightest > 0.0 else 1.0


def add_records(tables: LightTables, lights: list[Light]) -> None:
    for light in lights:
        view = record(light)
        view.luminance = float(np.dot(light.radiance * light.control.mean_share, LUMINANCE))
        tables.lights.append(view)
        tables.controls.append(light.control)


def blank_record(kind: int, radiance: NDArray[np.float64]) -> LightView:
    view = LightView()
    view.kind = kind
    view.radiance = tuple(radiance)
    view.luminance = float(np.dot(radiance, LUMINANCE))
    return view


def record(light: Light) -> LightView:
    """A light that has an extent, other than a dome."""
    if isinstance(light, RectLight | DiskLight):
        return flat_record(light)
    if isinstance(light, SphereLight):
        view = blank_record(SPHERE, light.radiance)
        view.center = tuple(light.center)
        view.radius = view.bound = light.radius
        view.area = 4.0 * np.pi * light.radius**2
        return view
    if isinstance(light, CylinderLight):
        half_length = float(np.linalg.norm(light.half_axis))
        view = blank_record(CYLINDER, light.radiance)
        view.center = tuple(light.center)
        view.u = tuple(light.half_axis)
        view.radius = light.radius
        view.bound = float(np.hypot(half_length, light.radius))
        view.area = 4.0 * np.pi * light.radius * half_length
        return view
    assert isinstance(light, DistantLight)
    view = blank_record(DISTANT, light.radiance)
    view.n = tuple(light.direction)
    view.one_minus_cos = 2.0 * np.sin(0.5 * light.half_angle) ** 2
    return view


def flat_record(light: RectLight | DiskLight) -> LightView:
    normal = np.cross(light.half_v, light.half_u)
    length = float(np.linalg.norm(normal))
    rect = isinstance(light, RectLight)
    view = blank_record(RECT if rect else DISK, light.radiance)
    view.center = tuple(light.center)
    view.u = tuple(light.half_u)
    view.v = tuple(light.half_v)
    view.n = tuple(normal / length)
    view.dual_u, view.dual_v = (tuple(row) for row in np.linalg.pinv(np.stack([light.half_u, light.half_v], axis=1)))
    half_x, half_y = (float(np.linalg.norm(half)) for half in (light.half_u, light.half_v))
    view.lengths = (half_x, half_y)
    # A sheared rectangle is farthest at a corner; no point of an ellipse lies beyond the root of its axes' squares.
    corner = max(np.linalg.norm(light.half_u + light.half_v), np.linalg.norm(light.half_u - light.half_v))
    view.bound = float(corner if rect else np.hypot(half_x, half_y))
    view.area = (4.0 if rect else np.pi) * length
    view.samples_solid_angle = bool(rect and abs(light.half_u @ light.half_v) < 1e-6 * half_x * half_y)
    return view


def delta_record(light: Light) -> DeltaLightView:
    view = DeltaLightView()
    assert isinstance(light, SphereLight | DistantLight)
    view.kind = DELTA_POINT if isinstance(light, SphereLight) else DELTA_DISTANT
    view.vector = tuple(light.center if isinstance(light, SphereLight) else light.direction)
    view.intensity = tuple(light.radiance)
    view.luminance = float(np.dot(light.radiance, LUMINANCE))
    return view


def add_mesh_lights(tables: LightTables, scene: Scene, geometry: Geometry) -> None:
    """One light for each pair of prim and emissive material."""
    emissive = np.array([is_emissive(material) for material in scene.materials], dtype=bool)
    if not emissive.any():  # a scene of lights alone has no materials at all
        return
    shining = np.flatnonzero(emissive[geometry.materials])
    corners = geometry.points[geometry.triangles[shining]].astype(np.float64)
    areas = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    shining, areas, corners = shining[areas > 0.0], areas[areas > 0.0], corners[areas > 0.0]
    if len(shining) == 0:
        return
    keys = geometry.prims[shining].astype(np.int64) * len(scene.materials) + geometry.materials[shining]
    order = np.argsort(keys, kind="stable")
    starts = np.flatnonzero(np.diff(keys[order], prepend=-1))
    cdfs = []
    for first, group in zip(starts, np.split(order, starts[1:]), strict=True):
        triangle = shining[group[0]]
        control = scene.prims[geometry.prims[triangle]].control
        emission = np.array(scene.materials[geometry.materials[triangle]].mean_emission)
        view = blank_record(MESH, emission)
        view.luminance = float(np.dot(emission * control.mean_share, LUMINANCE))
        points = corners[group].reshape(-1, 3)
        center = 0.5 * (points.min(axis=0) + points.max(axis=0))
        view.center = tuple(center)
        view.bound = float(np.sqrt(((points - center) ** 2).sum(axis=1).max()))
        view.area = float(areas[group].sum())
        view.first, view.count = int(first), len(group)
        view.two_sided = bool(scene.prims[geometry.prims[triangle]].double_sided)
        tables.triangle_light[shining[group]] = len(tables.lights)
        tables.lights.append(view)
        tables.controls.append(control)
        share = np.cumsum(areas[group])
        cdfs.append((share / share[-1]).astype(np.float32))
    tables.emitter_triangles = shining[order].astype(np.int32)
    tables.emitter_cdf = np.concatenate(cdfs)
