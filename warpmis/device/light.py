"""The lights of a scene as tables, ready to upload: records, the mesh lights' triangles, the tree."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from warpmis.device.environment import LUMINANCE, Environment, combine
from warpmis.device.light_leaves import analytic_leaves, link_bits, point_leaves, triangle_leaves
from warpmis.device.light_nodes import LightNodes, light_nodes
from warpmis.device.light_records import FloatArray, delta_records, dome_record, light_records
from warpmis.device.light_tree import IntArray
from warpmis.device.mesh import grown_boxes
from warpmis.device.mesh_lights import MeshLights, mesh_lights
from warpmis.device.place_lights import PlaceLights, emitter_nodes, place_leaves, two_levels
from warpmis.device.struct_arrays import Records, blank
from warpmis.device.views import LightView
from warpmis.scene import DistantLight, DomeLight, Scene
from warpmis.scene.features import has_light_tree, has_point_tree, is_delta
from warpmis.scene.geometry import Geometry
from warpmis.scene.light_control import LightControl

# No light counts for less than this share of the brightest one when lights are chosen.
MIN_SHARE = 1e-20


@dataclass(frozen=True, eq=False)
class LightTables:
    """The lights of a scene, ready to upload.

    Attributes:
        lights: records: first the analytic lights at a distance, `analytic` of them, then the mesh lights and those of
            prototypes, up to `finite`, then those at infinity; delta_lights: first the points, `points` of them.
        mesh, placed: the mesh lights, and those of prototypes, in the same order.
        environment: all domes as one, or None.
        controls: what is asked of each of the lights and then of the delta lights.
        tree: over the analytic lights at a distance and then the triangles of the mesh lights, or None; with
            prototypes that emit, as of place_lights.two_levels, which says what `roots` are.
        boxes: of the former, lower and upper corners, shape (analytic, 3) each, where there is a tree.
        point_tree: over the points, or None; its weights are shares of brightest_point, a luminance.
        prim_links: per prim the bits of the lights that reach it, where there is a tree.
    """

    lights: Records
    delta_lights: Records
    analytic: int
    finite: int
    points: int
    mesh: MeshLights
    placed: PlaceLights
    environment: Environment | None
    controls: list[LightControl]
    tree: LightNodes | None = None
    roots: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))
    boxes: tuple[NDArray[np.float32], NDArray[np.float32]] | None = None
    point_tree: LightNodes | None = None
    brightest_point: float = 1.0
    prim_links: NDArray[np.uint32] | None = None

    @property
    def emitter_triangles(self) -> NDArray[np.int32]:
        """Rows of SceneView.triangles of the emissive ones: those in world space, then those of prototypes."""
        return np.concatenate([self.mesh.triangles, self.placed.triangles])

    @property
    def groups(self) -> tuple[str | None, ...]:
        """Of each of the lights and then of the delta lights: the key of its group; None where a surface glows."""
        keys: list[str | None] = [control.group for control in self.controls]
        for row, glows in enumerate(self.mesh.glows + self.placed.glows, start=self.analytic):
            if glows:
                keys[row] = None
        return tuple(keys)


def light_tables(scene: Scene, geometry: Geometry, placed: PlaceLights) -> LightTables:
    """Records of all lights; `geometry` is the scene's, in the order in which it is uploaded."""
    domes = [light for light in scene.lights if isinstance(light, DomeLight)]
    points = [light for light in scene.lights if is_delta(light) and not isinstance(light, DistantLight)]
    delta = points + [light for light in scene.lights if is_delta(light) and isinstance(light, DistantLight)]
    extended = [light for light in scene.lights if not is_delta(light) and not isinstance(light, DomeLight)]
    distant = [light for light in extended if isinstance(light, DistantLight)]
    analytic = [light for light in extended if not isinstance(light, DistantLight)]
    mesh = mesh_lights(scene, geometry)
    environment = combine(domes) if domes else None
    sky = blank(LightView, 0) if environment is None else dome_record(environment)
    found = [light_records(analytic), mesh.records, placed.records, light_records(distant), sky]
    lights = blank(LightView, sum(map(len, found)))
    lights[:] = np.concatenate(found)  # which drops the gaps between fields
    lights["luminance"] = relative(lights["luminance"])
    controls = [light.control for light in analytic] + mesh.controls + placed.controls
    controls += [light.control for light in distant]
    tables = LightTables(
        lights=lights,
        delta_lights=delta_records(delta),
        analytic=len(analytic),
        finite=len(analytic) + len(mesh.records) + len(placed.records),
        points=len(points),
        mesh=mesh,
        placed=placed,
        environment=environment,
        controls=controls + [dome.control for dome in domes[:1]] + [light.control for light in delta],
    )
    return with_trees(tables, scene) if has_light_tree(scene) or has_point_tree(scene) else tables


def relative(luminance: NDArray[np.float32]) -> FloatArray:
    """Luminance as a share of the brightest light's: the choice among lights needs no more, and float32 could not hold
    some lights' times their solid angle. The share stays above 0, or the light would never be sampled."""
    # A light of infinite radiance is drawn like the brightest that there can be; its samples are rejected one by one.
    found = np.minimum(luminance.astype(np.float64), np.finfo(np.float32).max)
    brightest = found.max(initial=0.0)
    return np.maximum(found / brightest, MIN_SHARE) if brightest > 0.0 else np.ones_like(found)


def with_trees(tables: LightTables, scene: Scene) -> LightTables:
    """The tables with a tree over the lights at a distance, and one over the points, where they are many."""
    links, prim_links = link_bits(tables.controls, len(scene.prims))
    tables = replace(tables, prim_links=prim_links)
    if has_light_tree(scene):
        tables = with_tree(tables, links)
    if has_point_tree(scene):
        points = slice(len(tables.lights), len(tables.lights) + tables.points)
        records, controls = tables.delta_lights[: tables.points], tables.controls[points]
        intensity = (records["intensity"] * [control.mean_share for control in controls]) @ LUMINANCE
        leaves = point_leaves(records["vector"].astype(np.float64), relative(intensity), controls, links[points])
        brightest = float(np.nanmax(np.minimum(intensity, np.finfo(np.float32).max)))
        tables = replace(tables, point_tree=light_nodes(leaves, 0), brightest_point=brightest)
    return tables


def with_tree(tables: LightTables, links: NDArray[np.uint32]) -> LightTables:
    """The tables with a tree over the lights at a distance; `links` as of link_bits, for each of `controls`."""
    records, mesh, of_mesh = tables.lights[: tables.analytic], tables.mesh, tables.analytic + tables.mesh.lights
    leaves = analytic_leaves(records, tables.controls, links[: tables.analytic])
    boxes = grown_boxes(leaves.low, leaves.high)
    if len(mesh.triangles):
        luminance = tables.lights["luminance"][of_mesh].astype(np.float64)
        two_sided = mesh.records["two_sided"][mesh.lights] != 0
        leaves = leaves.then(triangle_leaves(mesh.corners, luminance, two_sided, links[of_mesh]))
    if not tables.placed.prototypes:
        return replace(tables, tree=light_nodes(leaves, tables.analytic), boxes=boxes)
    singles, placed = len(leaves), tables.placed
    of_places = slice(tables.analytic + len(mesh.records), tables.finite)
    luminance = tables.lights["luminance"][of_places].astype(np.float64)
    for some in place_leaves(placed, luminance, links[of_places]):
        leaves = leaves.then(some)
    lower = [emitter_nodes(one, placed.records, luminance) for one in placed.prototypes]
    tree, roots = two_levels(light_nodes(leaves, tables.analytic, singles), singles, lower)
    return replace(tables, tree=tree, roots=roots, boxes=boxes)
