"""The environment on the device: the picture's distribution, domes added up, and where a picture's columns look."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray

from warpmis.device.environment import LUMINANCE, combine, distribution, mean_over_sphere, resample, row_solid_angles
from warpmis.kernels.light.dome import dome_direction, dome_uv
from warpmis.scene import DomeLight

TURN = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
# Quarter turn about +Y that takes +Z to +X.
QUARTER = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])


@wp.kernel(module="unique", enable_backward=False)
def look(uv: wp.array(dtype=wp.vec2), directions: wp.array(dtype=wp.vec3), back: wp.array(dtype=wp.vec2)):
    i = wp.tid()
    directions[i] = dome_direction(uv[i][0], uv[i][1])
    back[i] = dome_uv(directions[i])


def looked(uv: NDArray[np.float64]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    directions, back = wp.zeros(len(uv), dtype=wp.vec3), wp.zeros(len(uv), dtype=wp.vec2)
    wp.launch(look, len(uv), [wp.array(uv.astype(np.float32), dtype=wp.vec2), directions, back])
    return directions.numpy(), back.numpy()


IDENTITY = np.eye(3)


def dome(
    picture: NDArray[np.float32] | None,
    radiance: tuple[float, ...] = (1.0, 1.0, 1.0),
    turn: NDArray[np.float64] = IDENTITY,
) -> DomeLight:
    return DomeLight("/dome", turn, np.array(radiance), picture)


def noise(rows: int, columns: int, lit: float = 1.0, seed: int = 1) -> NDArray[np.float32]:
    """A picture of which a share of the texels is lit."""
    random = np.random.default_rng(seed)
    picture = random.exponential(1.0, (rows, columns, 3)) * (random.random((rows, columns, 1)) < lit)
    return picture.astype(np.float32)


def test_columns_and_rows_look_where_the_scene_says() -> None:
    uv = np.array([[0.25, 0.5], [0.5, 0.5], [0.75, 0.5], [0.0, 0.5], [0.3, 0.0]])
    expected = [[1, 0, 0], [0, 0, 1], [-1, 0, 0], [0, 0, -1], [0, 1, 0]]
    np.testing.assert_allclose(looked(uv)[0], expected, atol=1e-6)


def test_looking_back_finds_the_same_place() -> None:
    uv = np.random.default_rng(1).random((10_000, 2)) * [1.0, 0.98] + [0.0, 0.01]
    directions, back = looked(uv)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, atol=1e-6)
    assert (back >= 0.0).all() and (back < 1.0).all()
    apart = np.abs(back - uv)
    assert np.minimum(apart, 1.0 - apart)[:, 0].max() < 1e-5
    assert apart[:, 1].max() < 1e-6


@pytest.mark.parametrize("shape", [(1, 1), (2, 3), (16, 32), (7, 100)])
@pytest.mark.parametrize("lit", [1.0, 0.1, 0.0])
def test_distribution_is_normalised_and_its_density_is_that_of_its_tables(shape: tuple[int, int], lit: float) -> None:
    rows, columns = shape
    d = distribution(combine([dome(noise(rows, columns, lit), (1.0, 2.0, 0.5))]))
    assert d.marginal[-1] == 1.0
    assert (d.conditional[:, -1] == 1.0).all()
    assert (np.diff(d.marginal, prepend=0.0) >= 0.0).all()
    assert (np.diff(d.conditional, prepend=0.0, axis=1) >= 0.0).all()
    assert (d.density >= 0.0).all()
    assert d.density.mean(dtype=float) == pytest.approx(1.0, abs=1e-6)
    mass = np.diff(d.marginal, prepend=0.0)[:, None] * np.diff(d.conditional, prepend=0.0, axis=1)
    np.testing.assert_allclose(d.density, mass * rows * columns, rtol=1e-5, atol=1e-6)


def test_density_follows_luminance_times_solid_angle() -> None:
    """In a picture with no detail finer than its texels' blur: one that varies from row to row by a constant slope."""
    rows, columns = 32, 64
    ramp = np.broadcast_to(np.arange(1.0, rows + 1.0)[:, None, None], (rows, columns, 3)).astype(np.float32)
    d = distribution(combine([dome(ramp)]))
    expected = np.arange(1.0, rows + 1.0) * row_solid_angles(rows, columns)
    expected *= rows / expected.sum()
    np.testing.assert_allclose(d.density[1:-1], np.broadcast_to(expected[1:-1, None], (rows - 2, columns)), rtol=5e-3)


def test_radiance_of_the_dome_weighs_the_colours() -> None:
    picture = np.zeros((4, 8, 3), dtype=np.float32)
    picture[1, 1] = (1.0, 0.0, 0.0)
    picture[1, 5] = (0.0, 1.0, 0.0)
    d = distribution(combine([dome(picture, (2.0, 1.0, 1.0))]))
    ratio = d.density[1, 1] / d.density[1, 5]
    assert ratio == pytest.approx(2.0 * LUMINANCE[0] / LUMINANCE[1], rel=1e-4)


def test_no_place_that_interpolation_lights_has_density_0() -> None:
    picture = noise(9, 20, lit=0.05)
    d = distribution(combine([dome(picture)]))
    assert (d.density == 0.0).any()
    for v, u in np.random.default_rng(2).random((20_000, 2)):
        x, y = u * 20 - 0.5, v * 9 - 0.5
        column, row = int(np.floor(x)), int(np.floor(y))
        around = [picture[np.clip(row + i, 0, 8), (column + j) % 20].sum() for i in (0, 1) for j in (0, 1)]
        if max(around) > 0.0:
            assert d.density[int(v * 9), int(u * 20)] > 0.0


def test_black_picture_is_sampled_uniformly_over_the_sphere() -> None:
    d = distribution(combine([dome(np.zeros((8, 16, 3), dtype=np.float32))]))
    expected = row_solid_angles(8, 16) * 8 * 16 / (4.0 * np.pi)
    np.testing.assert_allclose(d.density, np.broadcast_to(expected[:, None], (8, 16)), rtol=1e-5)


def test_compensated_density_follows_what_is_above_the_mean() -> None:
    """A dim sky with a bright square: Karlik et al. (2019), equation 14."""
    picture = np.full((32, 64, 3), 0.1, dtype=np.float32)
    picture[8:16, 20:30] = 4.0
    environment = combine([dome(picture)])
    d = distribution(environment, mis_compensation=True)
    solid_angles = row_solid_angles(32, 64)
    inside = (slice(9, 15), slice(21, 29))  # beyond the reach of the texels' blur
    excess = (4.0 - environment.luminance) * solid_angles[9:15, None]
    ratio = d.density[inside] / excess
    np.testing.assert_allclose(ratio, ratio[0, 0], rtol=1e-4)
    far = np.ones((32, 64), dtype=bool)
    far[7:17, 19:31] = False
    assert (d.density[far] == 0.0).all()
    assert d.density.mean(dtype=float) == pytest.approx(1.0, abs=1e-6)
    # The plain density spends a part of the samples on the sky.
    assert distribution(environment).density[inside].sum() < 0.95 * d.density[inside].sum()


@pytest.mark.parametrize("value", [0.0, 0.3, 1.7])
def test_compensated_picture_of_one_colour_is_sampled_uniformly_over_the_sphere(value: float) -> None:
    """Nothing is above the mean: then there is nothing to go after."""
    d = distribution(combine([dome(np.full((33, 64, 3), value, dtype=np.float32))]), mis_compensation=True)
    expected = row_solid_angles(33, 64) * 33 * 64 / (4.0 * np.pi)
    np.testing.assert_allclose(d.density, np.broadcast_to(expected[:, None], (33, 64)), rtol=1e-3)


def test_solid_angles_fill_the_sphere_and_the_mean_uses_them() -> None:
    assert (row_solid_angles(7, 5) * 5).sum() == pytest.approx(4.0 * np.pi)
    picture = np.zeros((4, 8, 3), dtype=np.float32)
    picture[0] = (1.0, 2.0, 3.0)
    # The cap down to 45 degrees.
    np.testing.assert_allclose(mean_over_sphere(picture), np.array([1.0, 2.0, 3.0]) * (1.0 - np.sqrt(0.5)) / 2.0)


def test_constant_domes_add_up() -> None:
    environment = combine([dome(None, (1.0, 0.0, 2.0)), dome(None, (0.5, 1.0, 0.0), TURN)])
    assert environment.picture is None
    np.testing.assert_allclose(environment.radiance, [1.5, 1.0, 2.0])
    assert environment.luminance == pytest.approx(float(np.array([1.5, 1.0, 2.0]) @ LUMINANCE))


def test_single_picture_is_kept_as_it_is() -> None:
    picture = noise(8, 16)
    environment = combine([dome(picture, (2.0, 1.0, 1.0), TURN)])
    assert environment.picture is picture
    np.testing.assert_array_equal(environment.to_world, TURN)
    np.testing.assert_array_equal(environment.radiance, [2.0, 1.0, 1.0])
    mean = (picture.astype(float) * [2.0, 1.0, 1.0] * row_solid_angles(8, 16)[:, None, None]).sum(axis=(0, 1))
    assert environment.luminance == pytest.approx(float(mean @ LUMINANCE) / (4.0 * np.pi), rel=1e-6)


def test_pictures_add_up_in_world_directions() -> None:
    """A spot towards each dome's +Z, one of the domes turned so that its +Z is the world's +X, and a constant."""
    spot = np.zeros((8, 16, 3), dtype=np.float32)
    spot[3:5, 7:9] = 1.0
    domes = [dome(spot, (1.0, 0.0, 0.0)), dome(spot, (0.0, 5.0, 0.0), QUARTER), dome(None, (0.0, 0.0, 0.25))]
    environment = combine(domes)
    assert environment.picture is not None
    np.testing.assert_array_equal(environment.to_world, np.eye(3))
    expected = np.zeros((8, 16, 3))
    expected[..., 2] = 0.25
    expected[3:5, 7:9, 0] = 1.0  # u = 0.5: +Z
    expected[3:5, 3:5, 1] = 5.0  # u = 0.25: +X
    np.testing.assert_allclose(environment.picture * environment.radiance, expected, atol=1e-6)


def test_sum_takes_the_finest_resolution_and_keeps_the_mean() -> None:
    coarse, fine = noise(8, 16), noise(64, 128, seed=2)
    environment = combine([dome(coarse, turn=TURN), dome(fine)])
    assert environment.picture is not None
    assert environment.picture.shape == (64, 128, 3)
    expected = mean_over_sphere(coarse) + mean_over_sphere(fine)
    np.testing.assert_allclose(mean_over_sphere(environment.picture), expected, rtol=2e-2)
    np.testing.assert_array_equal(resample(dome(fine), 64, 128), fine)
