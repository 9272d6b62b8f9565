"""Which surfaces are flattened into world space, and which are traced through the transforms of their places."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from warpmis.errors import StageError
from warpmis.scene import Material, Prim
from warpmis.scene.geometry import Geometry, Prototype, joined
from warpmis.usd.reading import MAX_COORDINATE, Reading
from warpmis.usd.shapes.surfaces import NO_PLACES, FloatArray, IntArray, Shading, Surface, cofactors, placed

# Geometry indexes with int32.
MAX_ROWS = 2**31 - 1
# Copied triangles that the instances of a stage may cost together when they are flattened, at about 300 bytes each
# while the scene is read and uploaded. One tree of all triangles serves instances that overlap better than two levels;
# instances that stand apart were traced alike (scripts/bench/instances.py writes such a stage).
MAX_COPIES = 1 << 20
# The same of triangles that emit, which the choice among lights makes three times as large. Where they are chosen by a
# tree over places and one over a place's triangles, they are in memory once, too.
MAX_EMISSIVE_COPIES = 1 << 14
# Places that stretch one direction so much more than another are flattened: float32 would carry rays too coarsely.
MAX_STRETCH = 1e3


class Block(NamedTuple):
    """Places of a surface.

    Attributes:
        matrices: local to world, USD's row-vector convention, shape (k, 4, 4).
        prims: of each the index into GeometryBuilder.prims, shape (k,); copies: which of that prim's places it is.
        values: as Shading.places.
    """

    matrices: FloatArray
    prims: IntArray
    copies: IntArray
    values: NDArray[np.float32]

    def at(self, rows: NDArray[np.bool_]) -> Block:
        values = self.values[rows] if len(self.values) else self.values
        return Block(self.matrices[rows], self.prims[rows], self.copies[rows], values)


@dataclass(eq=False)
class Places:
    """A surface and where it stands.

    Attributes:
        shading: without what the places have of their own.
        blocks: for all prims of one surface and shading.
    """

    surface: Surface
    shading: Shading
    blocks: list[Block] = field(default_factory=list)

    def add(self, matrices: FloatArray, prim: int, values: NDArray[np.float32]) -> None:
        self.blocks.append(Block(matrices, np.full(len(matrices), prim), np.arange(len(matrices)), values))

    @property
    def count(self) -> int:
        return sum(len(block.prims) for block in self.blocks)

    @property
    def copies(self) -> int:
        """How many more triangles there are when the surface is flattened."""
        return (self.count - 1) * len(self.surface.triangles)

    def joined(self) -> Block:
        matrices, prims, copies, values = zip(*self.blocks, strict=True)
        return Block(np.concatenate(matrices), np.concatenate(prims), np.concatenate(copies), np.concatenate(values))


@dataclass(eq=False)
class GeometryBuilder:
    """Collects the surfaces of a stage and where they stand; `build` puts them there.

    Attributes:
        parts: in the stage's order, what stands in one place and is flattened already, and what may stand in several.
        shared: those of the latter that further prims join, by their surface, sidedness and shading.
    """

    reading: Reading
    prims: list[Prim] = field(default_factory=list)
    parts: list[Geometry | Places] = field(default_factory=list)
    shared: dict[tuple[int, bool, bytes], Places] = field(default_factory=dict)

    def add(
        self, prim: Prim, surface: Surface, shading: Shading, matrices: FloatArray, is_shared: bool = False
    ) -> None:
        """Adds a prim that stands where each matrix says (shape (k, 4, 4), finite).

        `is_shared` tells that other prims come with the same surface, as those of native instances do.
        """
        number = len(self.prims)
        self.prims.append(prim)
        if len(matrices) == 1 and not is_shared:
            places = Places(surface, shading)
            places.add(matrices, number, shading.places)
            self.parts.append(self._flattened(places))
            return
        key = (id(surface), prim.double_sided, digest(shading))
        if key not in self.shared:
            self.shared[key] = Places(surface, shading)
            self.parts.append(self.shared[key])
        self.shared[key].add(matrices, number, shading.places)

    def build(self, materials: Sequence[Material]) -> tuple[Geometry, tuple[Prototype, ...]]:
        """All triangles in world space, and those that are traced through transforms.

        Raises:
            StageError: there are more triangles than can be numbered.
        """
        emits = np.array([max(material.mean_emission) > 0.0 for material in materials])
        apart = traced_through([part for part in self.parts if isinstance(part, Places)], emits)
        flat: list[Geometry] = []
        prototypes: list[Prototype] = []
        for part in self.parts:
            if isinstance(part, Geometry):
                flat.append(part)
                continue
            prototype, rest = self._divided(part) if part in apart else (None, part)
            prototypes += [] if prototype is None else [prototype]
            if rest.count:
                rows = sum(len(one.triangles) for one in flat) + rest.count * len(rest.surface.triangles)
                if rows > MAX_ROWS:
                    path = self.prims[rest.blocks[0].prims[0]].path
                    raise StageError(f"more than {MAX_ROWS} triangles when its instances are flattened", path)
                flat.append(self._flattened(rest))
        return joined(flat), tuple(prototypes)

    def _flattened(self, places: Places) -> Geometry:
        block = places.joined()
        shading = replace(places.shading, places=block.values)
        geometry, inside = placed(places.surface, shading, block.matrices, block.prims, block.copies)
        self._warn_of_distant(block.prims, inside)
        return geometry

    def _divided(self, places: Places) -> tuple[Prototype | None, Places]:
        """The places that rays can be carried through, and the rest."""
        surface, block = places.surface, places.joined()
        matrices, prims, shading = block.matrices, block.prims, replace(places.shading, places=NO_PLACES)
        low, high = surface.points.min(axis=0), surface.points.max(axis=0)
        center = (low + high) / 2.0
        # About its middle, so that float32 loses the least.
        about_center = np.eye(4)[None].copy()
        about_center[0, 3, :3] = -center
        geometry, inside = placed(surface, shading, about_center, prims[:1], block.copies[:1])
        through = stretch(matrices) < MAX_STRETCH
        if not len(geometry.triangles) or not through.any():
            return None, places
        linear, translation = matrices[:, :3, :3], center @ matrices[:, :3, :3] + matrices[:, 3, :3]
        reach = (high - low) / 2.0 @ np.abs(linear)
        inside = (np.abs(translation) + reach < MAX_COORDINATE).all(axis=1)
        self._warn_of_distant(prims[through], inside[through])
        kept = block.at(through & inside)
        prototype = Prototype(
            geometry=geometry,
            linear=linear[through & inside].swapaxes(1, 2),
            translation=translation[through & inside],
            prims=kept.prims.astype(np.int32),
            copies=kept.copies.astype(np.int32),
            primvars=kept.values,
        )
        rest = Places(surface, shading, [block.at(~through)])
        return (prototype if len(kept.prims) else None), rest

    def _warn_of_distant(self, prims: IntArray, inside: NDArray[np.bool_]) -> None:
        for number, count in zip(*np.unique(prims[~inside], return_counts=True), strict=True):
            which = f"{count} of its instances are" if (prims == number).sum() > 1 else "it is"
            self.reading.warn(self.prims[number].path, f"{which} left out: the points lie too far from the origin")


def traced_through(parts: Sequence[Places], emits: NDArray[np.bool_]) -> set[Places]:
    """Those with the most copies, until the copies of all others are at most MAX_COPIES; and of those that emit light
    at most MAX_EMISSIVE_COPIES."""
    lit = [part for part in parts if emits[part.shading.materials].any()]
    bright = with_most_copies(lit, MAX_EMISSIVE_COPIES)
    return bright | with_most_copies([part for part in parts if part not in bright], MAX_COPIES)


def with_most_copies(parts: Sequence[Places], most: int) -> set[Places]:
    """Those with the most copies, until the copies of all others are at most so many."""
    smallest_first = sorted(parts, key=lambda part: part.copies)
    copies = np.cumsum([part.copies for part in smallest_first])
    return {part for part, total in zip(smallest_first, copies, strict=True) if total > most}


def stretch(matrices: FloatArray) -> FloatArray:
    """How far transforms are from turning and scaling alike: 1 of those, infinite of singular ones, shape (k,).

    |A| |A^-1| / 3 in the Frobenius norm.
    """
    linear = matrices[:, :3, :3]
    inverse = cofactors(linear)
    determinant = (linear[:, 0] * inverse[:, 0]).sum(axis=1)
    norms = np.linalg.norm(linear, axis=(1, 2)) * np.linalg.norm(inverse, axis=(1, 2))
    return np.where(determinant != 0.0, norms / np.abs(determinant), np.inf) / 3.0


def digest(shading: Shading) -> bytes:
    """The same of equal shadings, and of no others."""
    found = hashlib.sha1(usedforsecurity=False)
    for column in (shading.materials, shading.primvars):
        found.update(repr(column.shape).encode())
        found.update(np.ascontiguousarray(column).data)
    return found.digest()
