"""A mesh refined a number of times: its polygons on the limit surface, and the way of any primvar to their corners."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpmis.usd.shapes.subdiv.facevarying import value_topology
from warpmis.usd.shapes.subdiv.limit import limit_values
from warpmis.usd.shapes.subdiv.masks import BILINEAR, LINEAR_TRIANGLES, LOOP, Scheme
from warpmis.usd.shapes.subdiv.normals import limit_normals
from warpmis.usd.shapes.subdiv.topology import FloatArray, IntArray, Topology


@dataclass(frozen=True, eq=False)
class Refinement:
    """Refines what is given on a cage; every method's result is at the finest level.

    Attributes:
        cage: the faces to refine, all of three corners or more.
        scheme: how the points are refined.
        levels: how many times, at least 1.
        linear: faceVaryingLinearInterpolation.
    """

    cage: Topology
    scheme: Scheme
    levels: int
    linear: str = "cornersPlus1"

    @cached_property
    def topologies(self) -> list[Topology]:
        """The cage's topology and that of every level below it, the finest last."""
        return _split(self.cage, self.scheme, self.levels)

    @property
    def finest(self) -> Topology:
        return self.topologies[-1]

    @cached_property
    def parents(self) -> IntArray:
        """The cage's face that each face lies in, shape (m,)."""
        faces = np.arange(len(self.cage.counts))
        for topology in self.topologies[:-1]:
            faces = faces[self.scheme.parents(topology)]
        return faces

    def points(self, values: FloatArray) -> FloatArray:
        """Limits of values at the cage's vertices, interpolated as its points are, shapes (n, k) and (n', k)."""
        return _limits(self.topologies, self.scheme, values)

    def surface(self, points: FloatArray) -> tuple[FloatArray, tuple[FloatArray, IntArray]]:
        """`points` of the cage's points; and normals, broken at creases and of any length, with each corner's row."""
        refined = _refined(self.topologies, self.scheme, points)
        limits = limit_values(self.scheme, self.finest, refined)
        return limits, limit_normals(self.scheme, self.finest, refined, limits)

    def varying(self, values: FloatArray) -> FloatArray:
        """Values at the cage's vertices interpolated linearly, shapes (n, k) and (n', k)."""
        return _limits(self.topologies, self._linear_scheme, values)

    def face_varying(self, values: FloatArray, rows: IntArray) -> tuple[FloatArray, IntArray]:
        """Values at the cage's corners, of which corner i has row `rows[i]`: refined values and rows, shape (c',)."""
        scheme = self._linear_scheme if self.linear == "all" else self.scheme
        topology, distinct = value_topology(self.cage, rows, self.linear)
        topologies = _split(topology, scheme, self.levels)
        return _limits(topologies, scheme, values[distinct]), topologies[-1].indices

    @property
    def _linear_scheme(self) -> Scheme:
        return LINEAR_TRIANGLES if self.scheme is LOOP else BILINEAR


def _split(cage: Topology, scheme: Scheme, levels: int) -> list[Topology]:
    topologies = [cage]
    for _ in range(levels):
        topologies.append(scheme.split(topologies[-1]))
    return topologies


def _refined(topologies: list[Topology], scheme: Scheme, values: FloatArray) -> FloatArray:
    for topology in topologies[:-1]:
        values = scheme.refine(topology, values)
    return values


def _limits(topologies: list[Topology], scheme: Scheme, values: FloatArray) -> FloatArray:
    return limit_values(scheme, topologies[-1], _refined(topologies, scheme, values))
