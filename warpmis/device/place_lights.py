"""The lights that prototypes are in each of their places: their emissive triangles are in memory once.

A light tree has two levels there. The upper one is over the places, in world space, beside all other lights; the lower
one is over a prototype's triangles in its own space, and serves all its places (kernels/light/place.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from warpmis.device.environment import LUMINANCE
from warpmis.device.light_leaves import FloatArray, LightLeaves, triangle_leaves
from warpmis.device.light_nodes import EMPTY, LightNodes, light_nodes
from warpmis.device.light_tree import IntArray, grouped
from warpmis.device.struct_arrays import Records, blank
from warpmis.device.views import MESH, LightView
from warpmis.scene import Scene
from warpmis.scene.features import is_emissive
from warpmis.scene.geometry import Geometry, Prototype
from warpmis.scene.light_control import LightControl

# Places are carried to world space in batches of about this many triangles, which bounds the scratch memory.
BATCH_TRIANGLES = 1 << 18
EVERY_LINK = np.uint32(0xFFFFFFFF)


@dataclass(frozen=True, eq=False)
class EmissivePrototype:
    """A prototype of which triangles emit, and the places where it stands.

    Attributes:
        triangles, corners: of its emitters, rows of SceneView.triangles and places in its own space, shape (t,) and
            (t, 3, 3); slots: of each the number of its material among those that emit, shape (t,).
        first_instance: row of SceneView.instances of its first place; the others follow.
        first_light: of each place the row of PlaceLights.records of the light of slot 0, shape (k,).
    """

    prototype: Prototype
    triangles: NDArray[np.int32]
    corners: FloatArray
    slots: IntArray
    first_instance: int
    first_light: IntArray

    @property
    def place_count(self) -> int:
        return len(self.first_light)


@dataclass(frozen=True, eq=False)
class PlaceLights:
    """Lights of prototypes, one for each prim that stands in a place and each of its emissive materials.

    Attributes:
        records: of views.LightView; controls, glows: as of MeshLights.
        prototypes: those with emitters.
    """

    records: Records
    controls: list[LightControl]
    glows: list[bool]
    prototypes: tuple[EmissivePrototype, ...]

    @property
    def triangles(self) -> NDArray[np.int32]:
        """Of all emitters, one prototype after the other, shape (t,)."""
        return np.concatenate([np.zeros(0, np.int32), *(one.triangles for one in self.prototypes)])

    @property
    def slots(self) -> IntArray:
        return np.concatenate([np.zeros(0, np.int64), *(one.slots for one in self.prototypes)])

    @property
    def first_emitters(self) -> IntArray:
        """Of each prototype its first one among all these emitters, and their number, shape (q + 1,)."""
        return np.cumsum([0, *(len(one.triangles) for one in self.prototypes)])


def place_lights(scene: Scene, geometry: Geometry, first: Sequence[int]) -> PlaceLights:
    """The lights of the scene's prototypes.

    Args:
        geometry: of the scene and then of all prototypes, in the order in which it is uploaded.
        first: the triangles at which these parts begin, and where the last one ends.
    """
    emissive = np.array([is_emissive(material) for material in scene.materials] or [False])
    found: list[EmissivePrototype] = []
    records: list[Records] = [blank(LightView, 0)]
    controls: list[LightControl] = []
    glows: list[bool] = []
    instances = np.cumsum([0, *(len(prototype.prims) for prototype in scene.prototypes)])
    for number, prototype in enumerate(scene.prototypes):
        rows = np.arange(first[number + 1], first[number + 2])
        rows = rows[emissive[geometry.materials[rows]]]
        corners = geometry.points[geometry.triangles[rows]].astype(np.float64)
        sound = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).any(axis=1)
        if not sound.any():
            continue
        materials, slots = np.unique(geometry.materials[rows[sound]], return_inverse=True)
        prims, which = np.unique(prototype.prims, return_inverse=True)
        first_light = len(controls) + which.ravel() * len(materials)
        records.append(pair_records(scene, prims, materials))
        for prim in prims:
            controls += [scene.prims[prim].control] * len(materials)
            glows += [not scene.prims[prim].is_light] * len(materials)
        triangles = rows[sound].astype(np.int32)
        one = EmissivePrototype(
            prototype, triangles, corners[sound], slots.ravel(), int(instances[number]), first_light
        )
        found.append(one)
    return PlaceLights(np.concatenate(records), controls, glows, tuple(found))


def pair_records(scene: Scene, prims: NDArray[np.int32], materials: NDArray[np.int32]) -> Records:
    """Of each prim and, within that, of each material."""
    emission = np.tile([scene.materials[material].mean_emission for material in materials], (len(prims), 1))
    pairs = [scene.prims[prim] for prim in prims for _ in materials]
    shares = np.array([prim.control.mean_share for prim in pairs])
    records = blank(LightView, len(pairs))
    records["kind"], records["radiance"], records["luminance"] = MESH, emission, (emission * shares) @ LUMINANCE
    records["two_sided"] = [prim.double_sided for prim in pairs]
    return records


def place_leaves(lights: PlaceLights, luminance: FloatArray, links: NDArray[np.uint32]) -> list[LightLeaves]:
    """What a tree is built over that has each place as one leaf: of each batch of places.

    Args:
        luminance, links: of each of the records, shape (n,).
    """
    found = []
    for one in lights.prototypes:
        count = len(one.triangles)
        batch = max(1, BATCH_TRIANGLES // count)
        for start in range(0, one.place_count, batch):
            places = slice(start, start + batch)
            light = (one.first_light[places, None] + one.slots).ravel()
            two_sided = lights.records["two_sided"][light] != 0
            corners = carried_corners(one, places)
            leaves = triangle_leaves(corners, luminance[light], two_sided, links[light])
            of_places = grouped(leaves, np.arange(0, len(light), count))
            # Moved only now: far from the origin rounding would leave slivers no area.
            at = one.prototype.translation[places]
            found.append(replace(of_places, low=of_places.low + at, high=of_places.high + at, mean=of_places.mean + at))
    return found


def carried_corners(one: EmissivePrototype, places: slice) -> FloatArray:
    """The emitters' corners in these places but for the translation, place after place, counter-clockwise from the
    front, shape (n, 3, 3)."""
    linear = one.prototype.linear[places]
    corners = np.einsum("kij,tcj->ktci", linear, one.corners)
    mirrored = np.linalg.det(linear) < 0.0
    corners[mirrored] = corners[mirrored][:, :, ::-1]
    return corners.reshape(-1, 3, 3)


def emitter_nodes(one: EmissivePrototype, records: Records, luminance: FloatArray) -> LightNodes:
    """The tree over a prototype's emitters, in its own space, by the lights of its first place."""
    light = one.first_light[0] + one.slots
    links = np.full(len(light), EVERY_LINK)
    return light_nodes(triangle_leaves(one.corners, luminance[light], records["two_sided"][light] != 0, links), 0)


def two_levels(upper: LightNodes, singles: int, lower: Sequence[LightNodes]) -> tuple[LightNodes, IntArray]:
    """A tree whose leaves from `singles` on are places, and those of prototypes, in common arrays; and the root of each
    of the latter. Leaves are numbered: the single lights, the emitters of prototypes, the places."""
    emitters = np.cumsum([singles, *(len(one.paths) for one in lower)])
    nodes = np.cumsum([len(upper.children), *(len(one.children) for one in lower)])
    children = [renumbered(upper.children, 0, 0)]
    children[0][is_leaf(upper.children, singles)] -= emitters[-1] - singles
    for one, node, emitter in zip(lower, nodes, emitters, strict=False):
        children.append(renumbered(one.children, int(node), int(emitter)))
    every = (upper, *lower)
    paths = [upper.paths[:singles], *(one.paths for one in lower), upper.paths[singles:]]
    joined = LightNodes(
        rows=np.concatenate([one.rows for one in every]),
        children=np.concatenate(children),
        links=np.concatenate([one.links for one in every]),
        analytic=np.concatenate([one.analytic for one in every]),
        paths=np.concatenate(paths),
    )
    return joined, nodes[:-1]


def is_leaf(children: NDArray[np.int32], first: int) -> NDArray[np.bool_]:
    """Which children are leaves from this one on."""
    found: NDArray[np.bool_] = (children != EMPTY) & (children < -first)
    return found


def renumbered(children: NDArray[np.int32], nodes: int, leaves: int) -> NDArray[np.int32]:
    """The children of a tree before whose nodes and leaves so many others stand."""
    moved = np.where(children >= 0, children + nodes, children - leaves)
    return np.where(children == EMPTY, EMPTY, moved).astype(np.int32)
