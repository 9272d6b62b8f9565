"""Pictures of some of the light: which sums a render keeps for them, and what they are made of.

All light that no asked picture tells apart goes into one sum (device/aov_views.py). A picture is a sum of sums.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpmis.aovs import light_aovs
from warpmis.device.aov_views import AovView
from warpmis.film.film import Film
from warpmis.path_expression import CLASSES, GLOWING, accepted


@dataclass(frozen=True, eq=False)
class LightPathAovs:
    """What a render keeps apart.

    Attributes:
        names: of the pictures.
        members: which sums each picture is made of, shape (pictures, rows).
        rows: into which sum the light of each group goes by its class, -1 for none, shape (groups, CLASSES).
        groups: of each light, then of each delta light.
    """

    names: tuple[str, ...]
    members: NDArray[np.bool_]
    rows: NDArray[np.int32]
    groups: NDArray[np.int32]

    @property
    def row_count(self) -> int:
        return self.members.shape[1]

    def view(self, pixels: int, device: str) -> AovView:
        """The sums of the samples under way, on the device."""
        view = AovView()
        view.rows = wp.array(self.rows.ravel(), dtype=int, device=device)
        view.groups = wp.array(self.groups if len(self.groups) else np.zeros(1, np.int32), dtype=int, device=device)
        view.row_count, view.group_count = self.row_count, len(self.rows)
        view.sample = wp.zeros(pixels * self.row_count, dtype=wp.vec3, device=device)
        view.on_ray = wp.zeros(2 * pixels * len(self.rows), dtype=wp.vec3, device=device)
        return view

    def pictures(self, film: Film, exposure: float) -> dict[str, NDArray[np.float32]]:
        """Each one's radiance, shape (H, W, 3)."""
        scale = np.float32(exposure)
        return {name: film.mean_aov(rows) * scale for name, rows in zip(self.names, self.members, strict=True)}


def light_path_aovs(asked: Sequence[str], lights: Sequence[str | None]) -> LightPathAovs | None:
    """What to keep for the AOVs asked for; None where none of them is of light.

    Args:
        lights: of each light, then of each delta light, the key of its group, "" without one; None for a surface that
            glows and is no light.
    """
    keys = sorted({key for key in lights if key})
    wanted = light_aovs(asked, keys)
    if not wanted:
        return None
    signature = np.stack([_accepted(aov.expression, keys) for aov in wanted])  # picture, group, class
    groups = np.array([GLOWING if key is None else keys.index(key) + 2 if key else 0 for key in lights], np.int64)
    distinct, rows = np.unique(signature.reshape(len(wanted), -1).T, axis=0, return_inverse=True)
    kept = distinct.any(axis=1)
    number = np.where(kept, np.cumsum(kept) - 1, -1)
    table = number[rows.reshape(-1)].reshape(len(keys) + 2, CLASSES)
    # Groups that no picture tells apart are one.
    merged, group_of = np.unique(table, axis=0, return_inverse=True)
    return LightPathAovs(
        names=tuple(aov.name for aov in wanted),
        members=np.ascontiguousarray(distinct[kept].T),
        rows=merged.astype(np.int32),
        groups=group_of.reshape(-1)[groups].astype(np.int32),
    )


def _accepted(expression: str, keys: Sequence[str]) -> NDArray[np.bool_]:
    if expression:
        return accepted(expression, keys)
    rest = np.zeros((len(keys) + 2, CLASSES), bool)
    rest[:2] = True
    return rest
