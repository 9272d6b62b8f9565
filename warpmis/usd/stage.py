"""From a USD stage to a Scene: open, read every prim in its place, and supply what is missing."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom, UsdLux

from warpmis.errors import StageError
from warpmis.scene import DomeLight, Light, Prim, Scene
from warpmis.usd.camera import first_sight, read_camera
from warpmis.usd.extent import StageExtent
from warpmis.usd.framing import light_boxes
from warpmis.usd.instances import Placement, placements
from warpmis.usd.lights.light import EmissiveSurface, is_light, read_light
from warpmis.usd.lights.light_linking import linked_lights, linked_prims
from warpmis.usd.lights.mesh_light import read_mesh_light
from warpmis.usd.materials.material import MaterialReader
from warpmis.usd.messages import Messages
from warpmis.usd.mtlx_arcs import has_mtlx_errors
from warpmis.usd.opening import open_stage, with_mtlx
from warpmis.usd.origin import Bounds, moved, placed_box, scene_origin
from warpmis.usd.placing import GeometryBuilder
from warpmis.usd.reading import (
    PxrError,
    Reading,
    add_diagnostics,
    captured_diagnostics,
    composition_warnings,
    one_line,
)
from warpmis.usd.request import Request, checked_source
from warpmis.usd.settings import Settings, read_settings
from warpmis.usd.shapes.curves import read_curves
from warpmis.usd.shapes.mesh import read_mesh
from warpmis.usd.shapes.points import read_points
from warpmis.usd.shapes.primitives import is_primitive, read_primitive
from warpmis.usd.shapes.skinning import bake_skinning, has_skeletons
from warpmis.usd.shapes.surfaces import Shading, Surface
from warpmis.usd.unread import warn_unread
from warpmis.usd.view import find_view

PORTAL_NOTE = "portals are hints for sampling and change no picture; they are not used"


def load_stage(
    path_or_stage: str | os.PathLike[str] | Usd.Stage,
    *,
    camera: str | None = None,
    time: float | None = None,
    width: int | None = None,
    height: int | None = None,
    purposes: Sequence[str] | None = None,
    render_settings: str | None = None,
    product: str | None = None,
    complexity: str = "high",
    variants: Sequence[str] = (),
    mask: Sequence[str] = (),
    session_layer: str | os.PathLike[str] | None = None,
    disable_depth_of_field: bool | None = None,
    disable_motion_blur: bool | None = None,
    pixel_aspect_ratio: float | None = None,
    aspect_ratio_conform_policy: str | None = None,
    data_window_ndc: Sequence[float] | None = None,
    material_binding_purposes: Sequence[str] | None = None,
) -> Scene:
    """Read a stage at one time into a Scene in world space.

    Everything that is not supported becomes a line of Scene.warnings. pxr's own messages go there too, and not to
    standard error. A Usd.Stage that you pass in is not changed.

    Args:
        path_or_stage: path of a USD file, or a Usd.Stage.
        camera: path or name of the camera, or "frame-all" for one that frames the geometry; None takes the
            RenderSettings', else `main_cam`, else the stage's first, else the view that Omniverse Kit saved, else one
            that frames the geometry.
        time: time code; None takes the stage's startTimeCode, or 0 where it is not authored, as in usdrecord.
        width: image width [pixel]; it follows from the height and the camera's aperture if only that is given. None for
            both takes the RenderSettings' resolution, or a width of 960.
        height: image height [pixel]; it follows from the width if only that is given.
        purposes: purposes to render besides "default", from "render", "proxy" and "guide"; None takes the
            RenderSettings', or "render".
        render_settings: path of the RenderSettings prim; None takes the one that the stage's metadata name.
        product: path of a RenderProduct; its camera, resolution and the like override the RenderSettings'.
        complexity: how often subdivision surfaces are refined: "low" not at all, "medium" once, "high" twice,
            "veryhigh" three times.
        variants: variants to select, such as "/World/Car{paint=red}", in order.
        mask: paths of the only prims to load, with what they refer to; empty for all.
        session_layer: a layer file to open over the stage, stronger than it.
        disable_depth_of_field: True makes every camera a pinhole; None follows the RenderSettings.
        disable_motion_blur: True ignores every shutter interval; None follows the RenderSettings.
        pixel_aspect_ratio: width over height of a pixel; None takes the RenderSettings', or 1.
        aspect_ratio_conform_policy: how the camera's window fits a picture of another aspect, by its UsdRender name,
            such as "cropAperture"; None takes the RenderSettings', or "expandAperture".
        data_window_ndc: the part of the picture to render, (xmin, ymin, xmax, ymax), from (0, 0) at the lower left to
            (1, 1) at the upper right; None takes the RenderSettings', or all of it.
        material_binding_purposes: purposes of material bindings, such as ("preview", ""): the first that a prim has
            counts, "" is for all purposes; None takes the RenderSettings', or ("full", "").

    Raises:
        StageError: the stage is missing, unreadable or empty, or has no such camera, settings, prim or variant.
        ConfigError: an argument is of a wrong type or out of its range.
    """
    request = Request(
        camera=camera, time=time, width=width, height=height, purposes=purposes, render_settings=render_settings,
        product=product, complexity=complexity, variants=variants, mask=mask, session_layer=session_layer,
        disable_depth_of_field=disable_depth_of_field, disable_motion_blur=disable_motion_blur,
        pixel_aspect_ratio=pixel_aspect_ratio, aspect_ratio_conform_policy=aspect_ratio_conform_policy,
        data_window_ndc=data_window_ndc, material_binding_purposes=material_binding_purposes,
    )  # fmt: skip
    return _load(checked_source(path_or_stage), request)


def _load(stage: Any, request: Request) -> Scene:
    warnings = Messages()
    try:
        # What is not finite is looked for and warned about by name; NumPy's own warnings would add nothing.
        with captured_diagnostics() as messages, np.errstate(all="ignore"):
            changed = request.variants or request.mask or request.session_layer
            if not isinstance(stage, Usd.Stage) or changed or has_skeletons(stage):
                stage = open_stage(stage, request.variants, request.mask, request.session_layer)
            stage, unread = with_mtlx(stage) if has_mtlx_errors(stage) else (stage, {})
            reading = Reading(
                stage=stage,
                time=Usd.TimeCode(stage.GetStartTimeCode() if request.time is None else float(request.time)),
                purposes=frozenset({"default", "render"}),
                levels=request.levels,
                warnings=warnings,
            )
            composition_warnings(reading, unread)
            if has_skeletons(stage):
                bake_skinning(reading)
            settings = request.over(read_settings(reading, request.render_settings, request.product))
            if settings.purposes is not None:
                reading = replace(reading, purposes=frozenset({"default", *settings.purposes}))
            scene = _read_scene(reading, settings, request.camera, request.width)
    except StageError as error:
        add_diagnostics(messages, warnings)
        raise error.explained_by(tuple(warnings)) from None
    add_diagnostics(messages, warnings)
    return replace(scene, warnings=tuple(warnings))


def _read_scene(reading: Reading, settings: Settings, camera: str | None, width: int | None) -> Scene:
    placed = list(placements(reading))
    reading = replace(reading, extent=StageExtent(placed, reading.time))
    view = find_view(reading, settings, camera)
    reading = replace(reading, sight=first_sight(reading, settings, view, width))
    contents = _read_contents(placed, reading, settings, np.zeros(3))
    origin = scene_origin([*contents.boxes, *light_boxes(contents.lights)])
    if origin.any():
        contents = _read_contents(placed, reading, settings, origin)
    materials = tuple(contents.materials.materials)
    geometry, prototypes = contents.geometry.build(materials)
    name = Path(reading.stage.GetRootLayer().GetDisplayName()).name
    if not len(geometry.triangles) and not prototypes and not contents.lights:
        purposes = ", ".join(sorted(reading.purposes))
        hidden = sum(prim.IsA(UsdGeom.Gprim) for prim in reading.stage.Traverse()) - len(contents.boxes)
        there = f"; {hidden} gprims are invisible, of another purpose or left out" if hidden > 0 else ""
        raise StageError(f"the stage is empty: no visible geometry or light of purpose {purposes}{there}", name)
    parts = (geometry, *(prototype.geometry for prototype in prototypes))
    used = np.unique(np.concatenate([part.materials for part in parts]))
    emissive = any(max(materials[index].mean_emission) > 0.0 for index in used)
    if not contents.light_prims and not emissive:
        contents.lights.append(DomeLight("", np.eye(3), np.ones(3)))
        reading.note("the stage has no light: a dome of radiance 1 is used")
    found, resolution = read_camera(reading, settings, view, width, geometry, prototypes, contents.lights, origin)
    return Scene(
        name=name,
        camera=found,
        resolution=resolution,
        geometry=geometry,
        materials=materials,
        prims=linked_prims(contents.geometry.prims, reading),
        prototypes=prototypes,
        lights=linked_lights(contents.lights, contents.geometry.prims, reading),
        origin=origin,
        time=float(reading.time.GetValue()),
        notes=tuple(reading.notes),
    )


def _read_contents(
    placed: list[Placement], reading: Reading, settings: Settings, origin: NDArray[np.float64]
) -> StageContents:
    if reading.sight is not None:
        reading = replace(reading, sight=reading.sight.moved(origin))
    contents = StageContents(reading, settings.material_purposes, origin, native_places(placed, origin))
    for placement in placed:
        try:
            contents.add(placement)
        except PxrError as error:
            reading.warn(placement.prim.GetPath(), f"left out: {one_line(error)}")
    return contents


@dataclass(eq=False)
class StageContents:
    """What has been read of a stage so far.

    Attributes:
        origin: of the scene's coordinates, in the stage's world, shape (3,).
        places: as native_places gives them.
        surfaces: gprims of native prototypes that have been read already, by the prim in the prototype.
        material_purposes: of bindings, as Settings.material_purposes.
        light_prims: number of light prims of a supported type, those included that turned out to emit nothing.
        boxes: of all instances of each gprim.
    """

    reading: Reading
    material_purposes: tuple[str, ...]
    origin: NDArray[np.float64]
    places: dict[Any, NDArray[np.float64]]
    lights: list[Light] = field(default_factory=list)
    surfaces: dict[Any, Surface | None] = field(default_factory=dict)
    light_prims: int = 0
    boxes: list[Bounds] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.geometry = GeometryBuilder(self.reading)
        self.materials = MaterialReader(self.reading, self.material_purposes)

    def add(self, placement: Placement) -> None:
        """Reads one prim, whatever it is, at all its places."""
        placement = replace(placement, matrices=moved(placement.matrices, self.origin))
        prim = placement.prim
        warn_unread(prim, self.reading)
        if prim.IsA(UsdGeom.Gprim):
            self._add_gprim(placement)
        elif prim.HasAPI(UsdLux.LightAPI):
            self._add_light(placement)

    def _add_gprim(self, placement: Placement) -> None:
        prim = placement.prim
        surface = self._surface(prim, placement.matrices)
        if surface is None or not len(surface.triangles):
            return
        double_sided = bool(self.reading.get(UsdGeom.Gprim(prim).GetDoubleSidedAttr(), False))
        if prim.HasAPI(UsdLux.LightAPI):
            self.light_prims += 1
            is_shared = bool(prim.IsInstanceProxy()) or len(placement.matrices) > 1
            for row, matrix in enumerate(placement.matrices):
                scopes = tuple(scope.of_places([row]) for scope in placement.scopes)
                shading, control = read_mesh_light(prim, surface, matrix, scopes, self.materials, self.reading)
                light = Prim(str(prim.GetPath()), double_sided, control, is_light=True)
                self._place(light, surface, shading, matrix[None], is_shared)
            return
        shading = self.materials.of_surface(prim, surface, placement.scopes)
        is_shared = bool(prim.IsInstanceProxy())
        self._place(Prim(str(prim.GetPath()), double_sided), surface, shading, placement.matrices, is_shared)

    def _surface(self, prim: Any, matrices: NDArray[np.float64]) -> Surface | None:
        """The gprim's triangles; those of a native instance are read once for all instances."""
        reading = self.reading
        if prim.HasAPI(UsdLux.LightAPI) or self.materials.glows(prim):
            reading = replace(reading, sight=None)  # how large a light is must not depend on the camera
        if not prim.IsInstanceProxy():
            return read_surface(prim, matrices, reading)
        source = prim.GetPrimInPrototype().GetPath()
        if source not in self.surfaces:
            self.surfaces[source] = read_surface(prim, self.places[source], reading)
        return self.surfaces[source]

    def _place(
        self, prim: Prim, surface: Surface, shading: Shading, matrices: NDArray[np.float64], is_shared: bool = False
    ) -> None:
        self.boxes.append(placed_box(surface, matrices))
        self.geometry.add(prim, surface, shading, matrices, is_shared)

    def _add_light(self, placement: Placement) -> None:
        prim = placement.prim
        if str(prim.GetTypeName()) == "PortalLight":
            self.reading.note(PORTAL_NOTE)
            return
        if not is_light(str(prim.GetTypeName())):
            self.reading.warn(prim.GetPath(), f"{prim.GetTypeName()} is not supported; the light is left out")
            return
        self.light_prims += 1
        for light in read_light(prim, placement.matrices, self.reading):
            if isinstance(light, EmissiveSurface):
                count, index = len(light.surface.triangles), self.materials.index(light.material)
                shading = Shading(np.full(count, index), np.zeros((count, 3, 0), np.float32))
                prim_of_light = Prim(light.material.path, control=light.control, is_light=True)
                self._place(prim_of_light, light.surface, shading, light.matrix[None])
            else:
                self.lights.append(light)


def native_places(placed: list[Placement], origin: NDArray[np.float64]) -> dict[Any, NDArray[np.float64]]:
    """Where each prim of a native prototype stands in all instances, local to the scene's coordinates, by its path."""
    found: dict[Any, list[NDArray[np.float64]]] = {}
    for placement in placed:
        if placement.prim.IsInstanceProxy() and placement.prim.IsA(UsdGeom.Gprim):
            found.setdefault(placement.prim.GetPrimInPrototype().GetPath(), []).append(placement.matrices)
    return {path: moved(np.concatenate(matrices), origin) for path, matrices in found.items()}


def read_surface(prim: Any, matrices: NDArray[np.float64], reading: Reading) -> Surface | None:
    """The triangles of a gprim in its own space; None, with a warning, for a type that is not supported.

    Args:
        matrices: local to world, shape (k, 4, 4).
    """
    if prim.IsA(UsdGeom.Mesh):
        return read_mesh(prim, matrices, reading)
    if prim.IsA(UsdGeom.BasisCurves):
        return read_curves(prim, matrices, reading)
    if prim.IsA(UsdGeom.Points):
        return read_points(prim, matrices, reading)
    type_name = str(prim.GetTypeName())
    if is_primitive(type_name):
        return read_primitive(prim, reading)
    reading.warn(prim.GetPath(), f"{type_name} is not supported; it is left out")
    return None
