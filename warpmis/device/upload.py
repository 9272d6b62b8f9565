"""The scene on a device: owns the Warp arrays and trees for as long as kernels may read them."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpmis.device.emitters import upload_emitters
from warpmis.device.environment import distribution, index_of
from warpmis.device.instances import largest_shrinking, place_primvars, upload_instances
from warpmis.device.light import LightTables, light_tables
from warpmis.device.light_control import control_view
from warpmis.device.light_nodes import LightNodes
from warpmis.device.material import MaterialTables, material_tables, upload_materials
from warpmis.device.mesh import front_normals
from warpmis.device.order import first_use_order, morton_order
from warpmis.device.place_lights import place_lights
from warpmis.device.start import start_warp
from warpmis.device.struct_arrays import blank, records
from warpmis.device.trees import upload_trees
from warpmis.device.views import (
    FLAT,
    CameraView,
    ControlView,
    DeltaLightView,
    DomeView,
    LightTreeView,
    LightView,
    SceneView,
    TriangleView,
    VaryingView,
    vec8f,
)
from warpmis.errors import ConfigError
from warpmis.scene import Camera, Scene
from warpmis.scene.geometry import Geometry, bounds, joined


@dataclass(frozen=True, eq=False)
class DeviceScene:
    """A scene in a device's memory. `owned` keeps alive what the views point into; extent: the longest side of the box
    of all triangles [scene units]; light_groups: as LightTables.groups."""

    view: SceneView
    camera: CameraView
    owned: tuple[Any, ...]
    extent: float
    light_groups: tuple[str | None, ...] = ()


def check_device(device: str) -> None:
    """Raise a ConfigError where the machine lacks the device. Starts Warp."""
    start_warp()
    known = [str(found) for found in wp.get_devices()]
    if device not in known and not (device == "cuda" and wp.is_cuda_available()):
        raise ConfigError(f"this machine has no device '{device}'; choose from {', '.join(known)}")


def upload(
    scene: Scene, device: str, mis_compensation: bool = False, ids: bool = False, uploads: Uploads | None = None
) -> DeviceScene:
    """Copy a scene to a device and build its trees, but for those that `uploads` has; `ids` for kernels/identify.py.

    Raises:
        ConfigError: the machine lacks the device.
    """
    check_device(device)
    solids = uploads.solids_of(scene, device) if uploads else upload_solids(scene, device)
    geometry = solids.geometry
    tables = light_tables(scene, solids.in_world, place_lights(scene, geometry, solids.first))
    with wp.ScopedDevice(device):
        view = SceneView()
        for name, value in solids.fields.items():
            setattr(view, name, value)
        varying = upload_surfaces(view, scene, geometry, tables, uploads, device)
        lights = upload_lights(view, solids, tables, mis_compensation)
        if ids:
            upload_ids(view, geometry)
        camera = camera_view(scene.camera, scene.resolution)
    return DeviceScene(view, camera, (*solids.owned, *lights, varying), solids.extent, tables.groups)


@dataclass(frozen=True, eq=False)
class Solids:
    """The triangles on a device.

    Attributes:
        geometry: all of them, in the order in which they are there; in_world: those that stand in world space.
        first: the triangles at which these and each prototype begin, and where the last one ends.
        fields: of a SceneView.
        owned: keeps alive what the fields point into.
        extent: the longest side of the box of all triangles [scene units].
    """

    geometry: Geometry
    in_world: Geometry
    first: list[int]
    fields: dict[str, Any]
    owned: tuple[Any, ...]
    extent: float


@dataclass(eq=False)
class Kept:
    """The last thing made of some arrays for a device."""

    key: tuple[str, bytes] | None = None
    made: Any = None

    def of(self, arrays: Iterable[tuple[str, NDArray[Any]]], device: str, make: Callable[[], Any]) -> Any:
        """What is kept if it was made of such arrays, else what `make` does."""
        key = (device, fingerprint(arrays))
        if self.made is None or key != self.key:
            self.made = None  # before the next one is made: there may be room for one alone
            self.key, self.made = key, make()
        return self.made


@dataclass(eq=False)
class Uploads:
    """What a render has put on a device, for the next one to use again where triangles or pictures are the same.

    Of a sequence in which the camera, lights or materials' numbers alone change, the trees are built once, and the
    textures are packed and copied once.
    """

    solids: Kept = field(default_factory=Kept)
    texels: Kept = field(default_factory=Kept)

    def solids_of(self, scene: Scene, device: str) -> Solids:
        solids: Solids = self.solids.of(columns_of(scene), device, lambda: upload_solids(scene, device))
        return solids

    def texels_of(self, tables: MaterialTables, device: str) -> Any:
        """The texels of the tables' pictures on the device."""
        stacks = enumerate(tables.texels.stacks)
        arrays = [(f"{i} {places}", pixels) for i, stack in stacks for pixels, _, places in stack.pictures]
        return self.texels.of(arrays, device, lambda: upload_texels(tables, device))


def columns_of(scene: Scene) -> Iterator[tuple[str, NDArray[Any]]]:
    """The arrays of a scene's triangles and prototypes, with their names."""
    for owner in (*scene.parts, *scene.prototypes):
        yield from ((name, column) for name, column in vars(owner).items() if isinstance(column, np.ndarray))


def fingerprint(arrays: Iterable[tuple[str, NDArray[Any]]]) -> bytes:
    """The same of arrays that have the same names, types, shapes and contents, and of no others."""
    found = hashlib.sha1(usedforsecurity=False)
    for name, array in arrays:
        found.update(f"{name} {array.dtype} {array.shape}".encode())
        found.update(np.ascontiguousarray(array).data)
    return found.digest()


def upload_texels(tables: MaterialTables, device: str) -> Any:
    words = tables.texels.texels()
    return wp.array(words, dtype=wp.uint32, device=device, copy=not wp.get_device(device).is_cpu)


def upload_solids(scene: Scene, device: str) -> Solids:
    """The triangles in the device's memory, with their trees."""
    parts = [ordered(part) for part in scene.parts]
    geometry = joined(parts)
    first = np.cumsum([0, *(len(part.triangles) for part in parts)]).tolist()
    whole = bounds(scene.geometry, scene.prototypes)
    extent = 0.0 if whole is None else float((whole[1] - whole[0]).max())
    reaches = [extent, *(extent * largest_shrinking(prototype) for prototype in scene.prototypes)]
    with wp.ScopedDevice(device):
        trees = upload_trees(geometry.points, geometry.triangles, first, reaches)
        fields = {
            **trees.fields,
            "indices": wp.array(geometry.triangles, dtype=wp.vec3i),
            "normals": wp.array(geometry.normals, dtype=wp.vec3),
        }
        fields[trees.kind] = trees.handles[0]
        instances, owned = upload_instances(scene.prototypes, trees.kind, trees.handles[1:], first[1:-1], extent)
    arrays = [field for field in fields.values() if isinstance(field, wp.array)]
    return Solids(geometry, parts[0], first, fields | instances, (*trees.owned, *owned, *arrays), extent)


def ordered(geometry: Geometry) -> Geometry:
    """The geometry along a Morton curve; with a triangle far away at least, for a tree cannot be empty."""
    if len(geometry.triangles) == 0:
        return replace(
            geometry,
            points=np.full((3, 3), 1e10, dtype=np.float32),
            triangles=np.array([[0, 1, 2]], dtype=np.int32),
            normal_indices=np.full((1, 3), FLAT, dtype=np.int32),
            materials=np.zeros(1, dtype=np.int32),
            prims=np.zeros(1, dtype=np.int32),
            primvars=np.zeros((1, 3, 0), dtype=np.float32),
            faces=np.zeros(0, dtype=np.int32),
            copies=np.zeros(0, dtype=np.int32),
        )
    order = morton_order(geometry.points, geometry.triangles)
    kept, triangles = first_use_order(geometry.triangles[order], len(geometry.points))
    return replace(geometry.ordered(order), points=geometry.points[kept], triangles=triangles)


def upload_ids(view: SceneView, geometry: Geometry) -> None:
    """Which prim each triangle belongs to, which of its faces and which of its places."""
    none = np.zeros(len(geometry.triangles), dtype=np.int32)
    view.prims = wp.array(geometry.prims, dtype=int)
    view.faces = wp.array(geometry.faces if geometry.faces.size else none, dtype=int)
    view.copies = wp.array(geometry.copies if geometry.copies.size else none, dtype=int)


def upload_surfaces(
    view: SceneView, scene: Scene, geometry: Geometry, tables: LightTables, uploads: Uploads | None, device: str
) -> VaryingView | None:
    # A material that emits on both sides of one prim and on the front alone of another needs a record for either.
    double_sided = np.array([prim.double_sided for prim in scene.prims] or [False], dtype=np.int32)
    material = geometry.materials * 2 + double_sided[geometry.prims]
    emitter = np.full(len(geometry.triangles), -1, dtype=np.int32)
    emitters = tables.emitter_triangles
    emitter[emitters] = np.arange(len(emitters))
    front = front_normals(geometry.points, geometry.triangles)
    columns = {"n": front, "normals": geometry.normal_indices, "material": material, "emitter": emitter}
    view.triangles = records(TriangleView, columns, len(geometry.triangles))
    materials = material_tables(scene)
    texels = uploads.texels_of(materials, device) if uploads else upload_texels(materials, device)
    places = place_primvars(scene.prototypes, geometry.primvars.shape[-1])
    return upload_materials(view, materials, texels, geometry.primvars, places)


def upload_lights(view: SceneView, solids: Solids, tables: LightTables, mis_compensation: bool) -> tuple[Any, ...]:
    """The lights into the view; what it then points into is returned, to be kept alive."""
    view.light_count, view.delta_light_count = len(tables.lights), len(tables.delta_lights)
    view.finite_light_count, view.analytic_light_count = tables.finite, tables.analytic
    view.delta_point_count = tables.points
    none = blank(LightView, 1)
    view.lights = wp.array(tables.lights if len(tables.lights) else none, dtype=LightView)
    if len(tables.delta_lights):
        view.delta_lights = wp.array(tables.delta_lights, dtype=DeltaLightView)
    controls = [control_view(control) for control in tables.controls] if any(c.asks for c in tables.controls) else []
    if controls:
        view.controls = wp.array(controls, dtype=ControlView)
        view.prims = wp.array(solids.geometry.prims, dtype=int)
    if tables.environment is not None:
        view.dome = dome_view(tables, mis_compensation)
    if controls and tables.prim_links is not None:
        view.prim_links = wp.array(tables.prim_links.view(np.int32), dtype=int)
    if tables.point_tree is not None:
        view.delta_tree = tree_view(tables.point_tree)
        view.delta_brightest = tables.brightest_point
    emitters = upload_emitters(view, solids.geometry, tables, solids.extent)
    return (*upload_light_tree(view, tables), *emitters, controls)


def tree_view(nodes: LightNodes) -> LightTreeView:
    view = LightTreeView()
    view.rows = wp.array(nodes.rows, dtype=vec8f)
    view.child_nodes, view.links = (wp.array(a.ravel(), dtype=int) for a in (nodes.children, nodes.links))
    view.analytic = wp.array(nodes.analytic, dtype=int)
    view.paths = wp.array(nodes.paths, dtype=wp.uint64)
    return view


def upload_light_tree(view: SceneView, tables: LightTables) -> list[wp.Bvh]:
    """What chooses among many lights, and what rays meet the analytic ones through."""
    if tables.tree is None or tables.boxes is None:
        return []
    view.light_tree = tree_view(tables.tree)
    if tables.analytic == 0 or wp.get_device().is_cpu:  # whose rays go through the same nodes
        return []
    tree = wp.Bvh(*(wp.array(corners, dtype=wp.vec3) for corners in tables.boxes))
    view.light_bvh = tree.id
    return [tree]


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
        marginal = tables_of_picture.marginal[None]
        view.marginal = wp.array(marginal, dtype=float)
        view.marginal_index = wp.array(index_of(marginal), dtype=int)
        view.conditional = wp.array(tables_of_picture.conditional, dtype=float)
        view.conditional_index = wp.array(index_of(tables_of_picture.conditional), dtype=int)
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
    view.is_orthographic = camera.orthographic
    view.planes = wp.array(camera.clipping_planes, dtype=wp.vec4)
    view.width, view.height = resolution
    return view
