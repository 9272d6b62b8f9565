"""Triangles as the device has them."""

from __future__ import annotations

import numpy as np
import pytest

from warpmis.device.mesh import front_normals

TRIANGLE = np.array([[0, 1, 2]], np.int32)


@pytest.mark.parametrize("size", [1e-30, 1e-12, 1.0, 1e12, 1e30])
def test_normals_have_length_1_whatever_the_triangle_s_size(size: float) -> None:
    points = np.float32(size) * np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 2.0]], np.float32)
    (normal,) = front_normals(points, TRIANGLE)
    assert normal == pytest.approx([0.0, -(0.5**0.5), 0.5**0.5], abs=1e-7)


def test_a_triangle_without_area_has_no_normal() -> None:
    points = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [3.0, 3.0, 3.0]], np.float32)
    assert (front_normals(points, TRIANGLE) == 0.0).all()
