"""The scene on a device: owns the Warp arrays and trees for as long as kernels may read them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import warp as wp

from warpmis.device.controls import control_view
from warpmis.device.environment import distribution
from warpmis.device.instances import upload_instances
from warpmis.device.lights import LightTables, light_tables
from warpmis.device.materials import material_tables, upload_materials
from warpmis.device.order import first_use_order, morton_order
from warpmis.device.records import records
from warpmis.device.views import (
    DISTANT,
    DOME,
    CameraView,
    ControlView,
    DeltaLightView,
    DomeView,
    LightView,
    SceneView,
    TriangleView,
    VaryingView,
)
from warpmis.errors import ConfigError
from warpmis.geometry import Geometry, joined
from warpmis.scene import Camera, Scene

# Triangles a leaf of the mesh's BVH; measured by scripts/bench/bvh.py.
LEAF_SIZE = 4


@dataclass(frozen=True, eq=False)
class DeviceScene:
    """A scene in a device's memory. `owned` keeps alive what the views point into."""

    view: SceneView
    camera: CameraView
    owned: tuple[Any, ...]


def check_device(device: str) -> None:
    """Raise a ConfigError where the machine lacks the device."""
    known = [str(found) for found in wp.get_devices()]
    if device not in known and not (device == "cuda" and wp.is_cuda_available()):
        raise ConfigError(f"this machine has no device '{device}'; choose from {', '.join(known)}")


def upload(scene: Scene, device: str, mis_compensation: bool = False, ids: bool = False) -> DeviceScene:
    """Copy a scene to a device and build its trees; `ids` for what kernels/identify.py reads.

    Raises:
        ConfigError: the machine lacks the device.
    """
    check_device(device)
    parts = [ordered(part) for part in scene.parts]
    tables = light_tables(scene, parts[0])
    geometry = joined(parts)
    first = np.cumsum([0, *(len(part.triangles) for part in parts)]).tolist()
    with wp.ScopedDevice(device):
        view = SceneView()
        meshes = upload_meshes(view, geometry, first)
        instances = upload_instances(view, scene.prototypes, meshes[1:], first[1:-1])
        varying = upload_surfaces(view, scene, geometry, tables)
        lights = upload_lights(view, geometry, tables, mis_compensation)
        if ids:
            upload_ids(view, geometry)
        camera = camera_view(scene.camera, scene.resolution)
    return DeviceScene(view, camera, (*meshes, *instances, *lights, varying))


def ordered(geometry: Geometry) -> Geometry:
    """The geometry along a Morton curve; with a triangle far away at least, for a tree cannot be empty."""
    if len(geometry.triangles) == 0:
        return replace(
            geometry,
            points=np.full((3, 3), 1e10, dtype=np.float32),
            triangles=np.array([[0, 1, 2]], dtype=np.int32),
            normal_indices=np.full((1, 3), -1, dtype=np.int32),
            materials=np.zeros(1, dtype=np.int32),
            prims=np.zeros(1, dtype=np.int32),
            primvars=np.zeros((1, 3, 0), dtype=np.float32),
            faces=np.zeros(0, dtype=np.int32),
            copies=np.zeros(0, dtype=np.int32),
        )
    order = morton_order(geometry.points, geometry.triangles)
    kept, triangles = first_use_order(geometry.triangles[order], len(geometry.points))
    return replace(geometry.ordered(order), points=geometry.points[kept], triangles=triangles)


def upload_meshes(view: SceneView, geometry: Geometry, first: list[int]) -> list[wp.Mesh]:
    """The triangles into the view, and a tree for each of the stretches that begin and end at the rows `first`."""
    view.points = wp.array(geometry.points, dtype=wp.vec3)
    view.indices = wp.array(geometry.triangles, dtype=wp.vec3i)
    view.normals = wp.array(geometry.normals, dtype=wp.vec3)
    corners = wp.array(geometry.triangles.ravel(), dtype=wp.int32)
    stretches = [corners[3 * start : 3 * end] for start, end in pairwise(first)]
    meshes = [wp.Mesh(view.points, stretch, bvh_leaf_size=LEAF_SIZE) for stretch in stretches]
    view.mesh = meshes[0].id
    return meshes


def upload_ids(view: SceneView, geometry: Geometry) -> None:
    """Which prim each triangle belongs to, which of its faces and which of its places."""
    none = np.zeros(len(geometry.triangles), dtype=np.int32)
    view.prims = wp.array(geometry.prims, dtype=int)
    view.faces = wp.array(geometry.faces if geometry.faces.size else none, dtype=int)
    view.copies = wp.array(geometry.copies if geometry.copies.size else none, dtype=int)


def upload_surfaces(view: SceneView, scene: Scene, geometry: Geometry, tables: LightTables) -> VaryingView | None:
    # A material that emits on both sides of one prim and on the front alone of another needs a record for either.
    double_sided = np.array([prim.double_sided for prim in scene.prims] or [False], dtype=np.int32)
    material = geometry.materials * 2 + double_sided[geometry.prims]
    light = np.full(len(geometry.triangles), -1, dtype=np.int32)
    light[: len(tables.triangle_light)] = tables.triangle_light
    columns = {"normals": geometry.normal_indices, "material": material, "light": light}
    view.triangles = records(TriangleView, columns, len(geometry.triangles))
    return upload_materials(view, material_tables(scene), geometry.primvars)


def upload_lights(view: SceneView, geometry: Geometry, tables: LightTables, mis_compensation: bool) -> tuple[Any, ...]:
    """The lights into the view; what it then points into is returned, to be kept alive."""
    view.light_count, view.delta_light_count = len(tables.lights), len(tables.delta_lights)
    view.finite_light_count = sum(light.kind not in (DISTANT, DOME) for light in tables.lights)
    view.lights = wp.array(tables.lights or [LightView()], dtype=LightView)
    if tables.delta_lights:
        view.delta_lights = wp.array(tables.delta_lights, dtype=DeltaLightView)
    controls = [control_view(control) for control in tables.controls] if any(c.asks for c in tables.controls) else []
    if controls:
        view.controls = wp.array(controls, dtype=ControlView)
        view.prims = wp.array(geometry.prims, dtype=int)
    if tables.environment is not None:
        view.dome = dome_view(tables, mis_compensation)
    if len(tables.emitter_triangles) == 0:
        return (controls,)
    view.emitter_triangles = wp.array(tables.emitter_triangles, dtype=int)
    view.emitter_cdf = wp.array(tables.emitter_cdf, dtype=float)
    corners = geometry.points[geometry.triangles[tables.emitter_triangles]]
    tree = wp.Bvh(wp.array(corners.min(axis=1), dtype=wp.vec3), wp.array(corners.max(axis=1), dtype=wp.vec3))
    view.emitter_bvh = tree.id
    return tree, controls


def dome_view(tables: LightTables, mis_compensation: bool) -> DomeView:
    environment = tables.environment
    assert environment is not None
    view = DomeView()
    view.to_world = wp.mat33(*environment.to_world.ravel())
    view.to_dome = wp.mat33(*environment.to_world.T.ravel())
    view.radiance = tuple(environment.radiance)
    if environment.picture is not None:
        tables_of_picture = distribution(environment, mis_compensation)
        view.picture = wp.array(environment.picture, dtype=wp.vec3)
        view.marginal = wp.array(tables_of_picture.marginal, dtype=float)
        view.conditional = wp.array(tables_of_picture.conditional, dtype=float)
        view.density = wp.array(tables_of_picture.density, dtype=float)
        view.rows, view.columns = environment.picture.shape[:2]
    return view


def camera_view(camera: Camera, resolution: tuple[int, int]) -> CameraView:
    left, right, bottom, top = camera.window
    view = CameraView()
    view.position = tuple(camera.position)
    ahead = np.zeros(3) if camera.orthographic else camera.forward
    view.corner = tuple(ahead + left * camera.right_axis + top * camera.up_axis)
    view.across = tuple((right - left) * camera.right_axis)
    view.down = tuple((bottom - top) * camera.up_axis)
    view.forward = tuple(camera.forward)
    view.lens_u = tuple(camera.lens_radius * camera.right_axis)
    view.lens_v = tuple(camera.lens_radius * camera.up_axis)
    view.focus_distance = camera.focus_distance
    view.orthographic = int(camera.orthographic)
    view.planes = wp.array(camera.clipping_planes, dtype=wp.vec4)
    view.width, view.height = resolution
    return view
