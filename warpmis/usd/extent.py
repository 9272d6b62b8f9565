"""How large the stage is, before its shapes have been made: the box around its gprims as their attributes give it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import UsdGeom

from warpmis.usd.instances import Placement
from warpmis.usd.origin import Bounds, placed_corners
from warpmis.usd.reading import PxrError

FloatArray = NDArray[np.float64]


@dataclass(eq=False)
class StageExtent:
    """The box around what is placed, in the stage's world. Extents that a stage authors may be stale, and are not read.

    Attributes:
        own: the box of each gprim in its own space, shape (2, 3), or None, by the path of the prim that defines it.
    """

    placements: Sequence[Placement]
    time: Any
    own: dict[Any, FloatArray | None] = field(default_factory=dict)

    @cached_property
    def box(self) -> Bounds | None:
        """Smallest and largest corner, shape (3,) each; None for a stage without gprims that have a finite box."""
        ends = [
            placed_corners(own, placement.matrices)
            for placement in self.placements
            if placement.prim.IsA(UsdGeom.Gprim) and (own := self.of_gprim(placement.prim)) is not None
        ]
        finite = [box for box in ends if np.isfinite(box).all()]
        if not finite:
            return None
        return np.min([low for low, _ in finite], axis=0), np.max([high for _, high in finite], axis=0)

    @property
    def size(self) -> float:
        """The box's diagonal [scene units], 0 without one."""
        return 0.0 if self.box is None else float(np.linalg.norm(self.box[1] - self.box[0]))

    def of_gprim(self, prim: Any) -> FloatArray | None:
        """The gprim's box in its own space, shape (2, 3); None where it has none."""
        path = (prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim).GetPath()
        if path not in self.own:
            self.own[path] = _computed(prim, self.time)
        return self.own[path]


def _computed(prim: Any, time: Any) -> FloatArray | None:
    try:
        found = UsdGeom.Boundable.ComputeExtentFromPlugins(UsdGeom.Boundable(prim), time)
    except PxrError:  # told when the prim itself is read
        return None
    box = np.array(found if found else (), np.float64).reshape(-1, 3)
    return box if len(box) == 2 and np.isfinite(box).all() and (box[0] <= box[1]).all() else None
