"""Maps from the unit square: uniform where they say so, in range for every number that the generator can draw."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray
from stats import polar, sidak, uniformity

from warpmis.kernels import warps

COUNT = 1 << 18
SIGNIFICANCE = sidak(0.01, 8)
CONES = (1e-12, 1e-5, 0.3, 1.9)
LAST = 1.0 - 2.0**-24


@wp.struct
class Mapped:
    disk: wp.vec2
    cosine: wp.vec3
    hemisphere: wp.vec3
    cone: wp.vec3
    triangle: wp.vec2


@wp.kernel(module="unique", enable_backward=False)
def apply(square: wp.array(dtype=wp.vec2), one_minus_cos: float, out: wp.array(dtype=Mapped)):
    i = wp.tid()
    u = square[i][0]
    v = square[i][1]
    m = Mapped()
    m.disk = warps.square_to_disk(u, v)
    m.cosine = warps.square_to_cosine_hemisphere(u, v)
    m.hemisphere = warps.square_to_uniform_hemisphere(u, v)
    m.cone = warps.square_to_uniform_cone(u, v, one_minus_cos)
    m.triangle = warps.square_to_triangle(u, v)
    out[i] = m


def mapped(square: NDArray[np.float32], one_minus_cos: float = 0.5) -> dict[str, NDArray[np.float64]]:
    out = wp.zeros(len(square), dtype=Mapped)
    wp.launch(apply, len(square), [wp.array(square.astype(np.float32), dtype=wp.vec2), one_minus_cos, out])
    table = out.numpy()
    return {name: table[name].astype(np.float64) for name in table.dtype.names}


@cache
def square() -> NDArray[np.float32]:
    """What the generator draws: multiples of 2^-24."""
    return (np.random.default_rng(1).integers(0, 1 << 24, (COUNT, 2)) / (1 << 24)).astype(np.float32)


def turn(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.mod(np.arctan2(y, x) / (2.0 * np.pi), 1.0)


def assert_uniform(*coordinates: NDArray[np.float64]) -> None:
    """The coordinates, in which the density is constant, fill the unit square evenly."""
    points = np.stack(coordinates, axis=1)
    assert points.min() > -1e-5
    assert points.max() < 1.0 + 1e-5
    assert uniformity(np.clip(points, 0.0, 1.0 - 1e-9), 48).p_value > SIGNIFICANCE


def test_disk_is_uniform() -> None:
    x, y = mapped(square())["disk"].T
    assert_uniform(x**2 + y**2, turn(x, y))


def test_cosine_hemisphere_has_the_density_of_the_cosine() -> None:
    """The squared sine is uniform."""
    x, y, z = mapped(square())["cosine"].T
    assert (z >= 0.0).all()
    np.testing.assert_allclose(x**2 + y**2 + z**2, 1.0, atol=1e-6)
    assert_uniform(1.0 - z**2, turn(x, y))


def test_uniform_hemisphere_is_uniform_in_height() -> None:
    x, y, z = mapped(square())["hemisphere"].T
    np.testing.assert_allclose(x**2 + y**2 + z**2, 1.0, atol=1e-6)
    assert_uniform(z, turn(x, y))


@pytest.mark.parametrize("one_minus_cos", CONES)
def test_cone_is_uniform_however_narrow(one_minus_cos: float) -> None:
    d = mapped(square(), one_minus_cos)["cone"]
    np.testing.assert_allclose(np.linalg.norm(d, axis=1), 1.0, atol=1e-6)
    height = polar(np.eye(3), d)[0] if one_minus_cos > 0.1 else 0.5 * (d[:, 0] ** 2 + d[:, 1] ** 2)
    assert_uniform(height / one_minus_cos, turn(d[:, 0], d[:, 1]))


def test_triangle_is_uniform() -> None:
    """The part that lies beyond b0 is (1 - b0)^2; across, b1 is uniform."""
    b0, b1 = mapped(square())["triangle"].T
    assert (b0 >= 0.0).all() and (b1 >= 0.0).all() and (b0 + b1 <= 1.0 + 1e-6).all()
    assert_uniform((1.0 - b0) ** 2, b1 / (1.0 - b0))


def test_corners_edges_and_centre_stay_in_range() -> None:
    steps = np.array([0.0, 2.0**-24, 0.25, 0.5 - 2.0**-25, 0.5, 0.5 + 2.0**-24, 0.75, LAST])
    u, v = np.meshgrid(steps, steps)
    for one_minus_cos in (*CONES, 2.0):
        m = mapped(np.stack([u.ravel(), v.ravel()], axis=1), one_minus_cos)
        for values in m.values():
            assert np.isfinite(values).all()
        assert (np.linalg.norm(m["disk"], axis=1) <= 1.0 + 1e-6).all()
        for name in ("cosine", "hemisphere", "cone"):
            np.testing.assert_allclose(np.linalg.norm(m[name], axis=1), 1.0, atol=1e-6)
        assert (m["triangle"] >= 0.0).all() and (m["triangle"].sum(axis=1) <= 1.0 + 1e-6).all()


@pytest.mark.parametrize("name", ["disk", "hemisphere", "cone", "triangle"])
def test_neighbours_stay_together(name: str) -> None:
    """No seams: stratified numbers stay stratified."""
    steps = np.linspace(0.0, LAST, 257)
    grid = np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1)
    p = mapped(grid.reshape(-1, 2))[name].reshape(257, 257, -1)
    for axis in (0, 1):
        assert np.linalg.norm(np.diff(p, axis=axis), axis=-1).max() < 5.0 / 256
