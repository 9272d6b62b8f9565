"""What a scene holds, told without rendering it: counts, bounds, lights and their power, materials, memory, effects."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpmis.device.environment import LUMINANCE, mean_over_sphere
from warpmis.scene import CylinderLight, DiskLight, DistantLight, DomeLight, Light, Prim, RectLight, Scene, SphereLight
from warpmis.scene.features import Features, detect, has_gloss, is_emissive
from warpmis.scene.geometry import Geometry, bounds
from warpmis.scene.texture import Texture, TextureLookup

# Light that leaves a surface: lumen where the scene's unit of length is the metre.
POWER_UNIT = "nit sr unit^2"


@dataclass(frozen=True)
class LightReport:
    """One light, or one prim with one emissive material.

    Attributes:
        emitted: linear Rec.709, in `unit`: radiance [nit]; of a point its intensity [cd], of a distant light of angle 0
            the irradiance that it gives [lux]; of a picture or texture the mean.
        luminance: of `emitted`, in the same unit.
        power: what leaves the light in all, by luminance [POWER_UNIT]; None for one at infinity.
        irradiance: on a surface that faces the light [lux]; None for one at a distance.
    """

    path: str
    kind: str
    emitted: tuple[float, float, float]
    unit: str
    luminance: float
    power: float | None
    irradiance: float | None


@dataclass(frozen=True)
class MaterialReport:
    """One material in use: `inputs` that vary over the surface are named "texture" or "primvar", others given."""

    path: str
    triangles: int
    lambertian: bool
    inputs: dict[str, Any]


@dataclass(frozen=True)
class Effect:
    """A field of Features: whether it is compiled, and the first prim that called for it, "" if it was supplied."""

    name: str
    on: bool
    prim: str | None


@dataclass(frozen=True)
class Inspection:
    """Everything about a scene that can be told without rendering it.

    Attributes:
        counts: of prims, triangles (in each of their places), points (in memory), instances that are traced through
            their transforms, materials, textures, and of each kind of light.
        bounds: smallest and largest corner of the geometry [scene units], or None without any.
        resolution: (width, height) [pixel].
        memory: bytes of geometry, textures and environments, and in all.
        not_honoured: (prim path, message); the path is "" where the stage as a whole is meant.
        notes: what was supplied because the stage has none.
    """

    name: str
    counts: dict[str, int]
    bounds: tuple[list[float], list[float]] | None
    camera: dict[str, Any]
    resolution: tuple[int, int]
    lights: tuple[LightReport, ...]
    materials: tuple[MaterialReport, ...]
    memory: dict[str, int]
    effects: tuple[Effect, ...]
    not_honoured: tuple[tuple[str, str], ...]
    notes: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """As plain values; what is not supported as {path, message}."""
        plain = dataclasses.asdict(self)
        plain["not_honoured"] = [{"path": path, "message": message} for path, message in self.not_honoured]
        plain["power_unit"] = POWER_UNIT
        return plain


def inspect_scene(scene: Scene) -> Inspection:
    """What `warpmis inspect` tells."""
    geometry = scene.geometry
    used = scene.used_materials
    pictures = textures_of(scene)
    lights = (*map(light_report, scene.lights), *emissive_surfaces(scene))
    memory = {
        "geometry": sum(part.nbytes for part in scene.parts),
        "textures": sum(tile.nbytes for texture in pictures for tile in texture.tiles.values()),
        "environments": sum(
            light.picture.nbytes for light in scene.lights if isinstance(light, DomeLight) and light.picture is not None
        ),
    }
    return Inspection(
        name=scene.name,
        counts={
            "prims": len(np.unique(np.concatenate([geometry.prims, *(one.prims for one in scene.prototypes)]))),
            "triangles": scene.triangle_count,
            "points": sum(len(part.points) for part in scene.parts),
            "instances": scene.instance_count,
            "materials": len(used),
            "textures": len(pictures),
            **Counter(light.kind for light in lights),
        },
        bounds=bounds_of_geometry(scene),
        camera=camera_report(scene),
        resolution=scene.resolution,
        lights=lights,
        materials=tuple(material_report(scene, int(index)) for index in used),
        memory={**memory, "total": sum(memory.values())},
        effects=tuple(effects(scene)),
        not_honoured=tuple(split_warning(line) for line in dict.fromkeys(scene.warnings)),
        notes=scene.notes,
    )


def split_warning(line: str) -> tuple[str, str]:
    """A warning as (prim path, message)."""
    path, separator, message = line.partition(": ")
    return (path, message) if separator and path.startswith("/") else ("", line)


def bounds_of_geometry(scene: Scene) -> tuple[list[float], list[float]] | None:
    found = bounds(scene.geometry, scene.prototypes)
    return None if found is None else ((found[0] + scene.origin).tolist(), (found[1] + scene.origin).tolist())


def camera_report(scene: Scene) -> dict[str, Any]:
    """The camera's fields as plain values."""
    camera = replace(scene.camera, position=scene.camera.position + scene.origin)
    values = {field.name: getattr(camera, field.name) for field in dataclasses.fields(camera)}
    return {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in values.items()}


# ---- lights ---------------------------------------------------------------------------------------------------------


def light_report(light: Light) -> LightReport:
    """Power of a Lambertian emitter: pi A L; of a point: 4 pi I. Irradiance of a cone: pi sin^2(half angle) L."""
    emitted, unit, power, irradiance = light.radiance, "nit", None, None
    match light:
        case SphereLight(radius=0.0):
            unit, power = "cd", 4.0 * np.pi
        case RectLight():
            power = np.pi * 4.0 * _parallelogram(light)
        case DiskLight():
            power = np.pi * np.pi * _parallelogram(light)
        case SphereLight():
            power = np.pi * 4.0 * np.pi * light.radius**2
        case CylinderLight():
            power = np.pi * 4.0 * np.pi * light.radius * float(np.linalg.norm(light.half_axis))
        case DistantLight(half_angle=0.0):
            unit, irradiance = "lux", 1.0
        case DistantLight():
            irradiance = np.pi * np.sin(light.half_angle) ** 2
        case DomeLight():
            emitted = light.radiance if light.picture is None else mean_over_sphere(light.picture) * light.radiance
    return _report(light.path, type(light).__name__, emitted, unit, power, irradiance)


def _parallelogram(light: RectLight | DiskLight) -> float:
    return float(np.linalg.norm(np.cross(light.half_u, light.half_v)))


def _report(
    path: str, kind: str, emitted: NDArray[np.float64], unit: str, power: float | None, irradiance: float | None
) -> LightReport:
    """`power` and `irradiance` are those of a luminance of 1."""
    luminance = float(emitted @ LUMINANCE)
    red, green, blue = (float(value) for value in emitted)
    return LightReport(
        path=path,
        kind=kind,
        emitted=(red, green, blue),
        unit=unit,
        luminance=luminance,
        power=None if power is None else power * luminance,
        irradiance=None if irradiance is None else irradiance * luminance,
    )


def emissive_surfaces(scene: Scene) -> Iterator[LightReport]:
    """One report for each prim and emissive material; a double-sided prim shines from both sides."""
    emissive = np.array([is_emissive(material) for material in scene.materials], dtype=bool)
    if not emissive.any():
        return
    found = [surface_areas(scene.geometry, emissive, np.eye(3)[None], None)]
    for one in scene.prototypes:
        found.append(surface_areas(one.geometry, emissive, one.linear, one.prims))
    prims, materials, areas = (np.concatenate(column) for column in zip(*found, strict=True))
    unique, which = np.unique(np.stack([prims, materials], axis=1), axis=0, return_inverse=True)
    for (prim, material), area in zip(unique, np.bincount(which.ravel(), weights=areas), strict=True):
        sides = 2.0 if scene.prims[prim].double_sided else 1.0
        emitted = np.array(scene.materials[material].mean_emission)
        yield _report(scene.prims[prim].path, "EmissiveSurface", emitted, "nit", np.pi * sides * area, None)


def surface_areas(
    geometry: Geometry, emissive: NDArray[np.bool_], linear: NDArray[np.float64], prims: NDArray[np.int32] | None
) -> tuple[NDArray[Any], NDArray[Any], NDArray[np.float64]]:
    """Prim, material and area [square scene unit] of what shines, several of a pair to be added up, shape (n,) each.

    Args:
        linear: of each place, shape (k, 3, 3); prims: of each, shape (k,), or None for those of the triangles.
    """
    shining = np.flatnonzero(emissive[geometry.materials])
    corners = geometry.points[geometry.triangles[shining]].astype(np.float64)
    crosses = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    materials = geometry.materials[shining]
    if prims is None:
        return geometry.prims[shining], materials, 0.5 * np.linalg.norm(crosses, axis=1)
    used, which = np.unique(materials, return_inverse=True)
    areas = np.zeros((len(prims), len(used)))
    for place, matrix in enumerate(linear):
        carried = crosses @ (np.linalg.det(matrix) * np.linalg.inv(matrix))
        areas[place] = np.bincount(which.ravel(), 0.5 * np.linalg.norm(carried, axis=1), len(used))
    return np.repeat(prims, len(used)), np.tile(used, len(prims)), areas.ravel()


# ---- materials ------------------------------------------------------------------------------------------------------


def material_report(scene: Scene, index: int) -> MaterialReport:
    material = scene.materials[index]
    inputs = {name: value for name, value in vars(material).items() if name in INPUTS and value is not None}
    for name, lookup in material.lookups.items():
        inputs[name] = "texture" if isinstance(lookup, TextureLookup) else "primvar"
    triangles = int((scene.geometry.materials == index).sum())
    triangles += sum(len(one.prims) * int((one.geometry.materials == index).sum()) for one in scene.prototypes)
    return MaterialReport(material.path, triangles, material.lambertian, inputs)


INPUTS = (
    "diffuse_color", "emissive_color", "use_specular_workflow", "specular_color", "metallic", "roughness", "clearcoat",
    "clearcoat_roughness", "opacity", "opacity_threshold", "ior", "normal",
)  # fmt: skip


def textures_of(scene: Scene) -> list[Texture]:
    """The pictures that materials in use look up, each once."""
    used = [scene.materials[index] for index in scene.used_materials]
    lookups = [lookup for material in used for lookup in material.lookups.values()]
    return list({id(one.texture): one.texture for one in lookups if isinstance(one, TextureLookup)}.values())


# ---- effects --------------------------------------------------------------------------------------------------------


def effects(scene: Scene) -> Iterator[Effect]:
    """Every effect, on or off, with the first prim that calls for it: alone, or else beside the others."""
    on = _names(detect(scene))
    callers: dict[str, str] = {}
    by_one_prim = on - _TOGETHER.keys()
    for path, part in parts(scene):
        if by_one_prim <= callers.keys():
            break
        for name in _names(detect(part)) & on:
            callers.setdefault(name, path)
    for name in (on & _TOGETHER.keys()) - callers.keys():
        callers[name] = next(path for path, part in parts(scene) if _TOGETHER[name](part))
    for field in dataclasses.fields(Features):
        if field.type == "bool":
            yield Effect(field.name, field.name in on, callers.get(field.name))


def _has_light(scene: Scene) -> bool:
    return bool(scene.lights) or any(is_emissive(scene.materials[index]) for index in scene.used_materials)


# Effects that several prims may call for together, and what each of these prims has to do with it.
_TOGETHER: dict[str, Callable[[Scene], bool]] = {"light_tree": _has_light, "glossy_choice": has_gloss}


def _names(features: Features) -> set[str]:
    return {name for name, value in dataclasses.asdict(features).items() if value is True}


def parts(scene: Scene) -> Iterator[tuple[str, Scene]]:
    """The scene in pieces, each with its prim: the camera alone, each light alone, the triangles of each prim alone,
    each prototype alone."""
    nothing = _triangles(scene, np.zeros(0, np.int64), ())
    yield scene.camera.path, nothing
    for light in scene.lights:
        yield light.path, replace(nothing, lights=(light,))
    order = np.argsort(scene.geometry.prims, kind="stable")
    prims, starts = np.unique(scene.geometry.prims[order], return_index=True)
    for prim, rows in zip(prims, np.split(order, starts[1:]), strict=False):
        yield scene.prims[prim].path, _triangles(scene, rows, (scene.prims[prim],))
    for prototype in scene.prototypes:
        own = tuple(scene.prims[prim] for prim in np.unique(prototype.prims))
        yield own[0].path, replace(nothing, prototypes=(prototype,), prims=own)


def _triangles(scene: Scene, rows: NDArray[np.int64], prims: tuple[Prim, ...]) -> Scene:
    """The camera, some of the triangles in world space, and what `prims` ask for, alone."""
    return replace(scene, geometry=scene.geometry.ordered(rows), prims=prims, lights=(), prototypes=())
