"""Light records: the bounding sphere that the choice among lights relies on holds the whole light."""

from __future__ import annotations

import numpy as np
import pytest

from warpmis.device.light_records import light_records
from warpmis.scene import CylinderLight, DiskLight, RectLight

WHITE = np.ones(3)
U, V = np.array([1.0, 0.0, 0.0]), np.array([0.8, 0.6, 0.0])  # sheared: at 37 degrees to each other
TURN = np.linspace(0.0, 2.0 * np.pi, 1001)


@pytest.mark.parametrize(
    ("light", "farthest"),
    [
        (RectLight("/r", np.zeros(3), U, V, WHITE), np.linalg.norm(U + V)),
        (RectLight("/r", np.zeros(3), U, -V, WHITE), np.linalg.norm(U + V)),
        (
            DiskLight("/d", np.zeros(3), U, V, WHITE),
            np.linalg.norm(np.outer(np.cos(TURN), U) + np.outer(np.sin(TURN), V), axis=1).max(),
        ),
        (CylinderLight("/c", np.zeros(3), U, 0.5, WHITE), np.hypot(1.0, 0.5)),
    ],
    ids=["rect", "rect mirrored", "disk", "cylinder"],
)
def test_bound_holds_the_light(light: RectLight | DiskLight | CylinderLight, farthest: float) -> None:
    assert farthest * (1.0 - 1e-6) <= light_records([light])["bound"][0] <= 1.2 * farthest
