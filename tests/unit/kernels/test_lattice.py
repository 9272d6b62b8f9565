"""The lattice sampler: how good its vectors are, what a shift keeps of a lattice, and that each point is uniform."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray
from stats import sidak, uniformity

from warpmis.kernels import lattice, rng
from warpmis.rendering.generating_vector import DIMENSIONS, LARGEST, generating_vector, lattice_length, lattice_steps

COUNT = 1 << 17
COORDINATES = len(DIMENSIONS)
SIGNIFICANCE = sidak(0.01, 3 + 4 + COORDINATES * 3 + COORDINATES * (COORDINATES - 1) // 2 + 3 * 3)

Keys = NDArray[np.int64]  # rows of (seed, pixel, round, sample)
Points = NDArray[np.float64]


@wp.kernel(module="unique", enable_backward=False)
def draw(keys: wp.array2d(dtype=wp.uint32), steps: rng.vec_lattice, points: wp.array2d(dtype=float)):
    i = wp.tid()
    key = rng.RngKey()
    key.seed = keys[i, 0]
    key.pixel = keys[i, 1]
    key.round = keys[i, 2]
    key.sample = keys[i, 3]
    key.lattice = steps
    # In the order of DIMENSIONS.
    camera = lattice.point4(key, rng.CAMERA)
    lens = lattice.point4(key, rng.LENS)
    points[i, 0] = lattice.choice(key)
    points[i, 1] = lattice.point4_of_step(key, 0, rng.LIGHT)[2]
    points[i, 2] = lattice.point4_of_step(key, 0, rng.SCATTER)[2]
    points[i, 3] = camera[0]
    points[i, 4] = camera[1]
    points[i, 5] = lattice.point4_of_step(key, 0, rng.EVENT)[0]
    points[i, 6] = lens[0]
    points[i, 7] = lens[1]
    points[i, 8] = lattice.point4_of_step(key, 0, rng.LIGHT)[3]


@wp.kernel(module="unique", enable_backward=False)
def draw_later(of_lattice: wp.array(dtype=wp.vec4), independent: wp.array(dtype=wp.vec4)):
    key = rng.RngKey()
    key.sample = wp.uint32(wp.tid())
    of_lattice[wp.tid()] = lattice.point4_of_step(key, 1, rng.LIGHT)
    independent[wp.tid()] = rng.uniform4_of_step(key, 1, rng.LIGHT)


def drawn(keys: Keys, of: int) -> Points:
    """The points of these keys, in rounds of `of` samples."""
    points = wp.zeros((len(keys), COORDINATES), dtype=float)
    inputs = [wp.array(keys.astype(np.uint32), dtype=wp.uint32), rng.vec_lattice(*lattice_steps(of)), points]
    wp.launch(draw, len(keys), inputs)
    return points.numpy().astype(float)


def keys_of(count: int, seed: int = 3, pixel: int = 17, first: int = 0, sample: int = 0) -> Keys:
    return np.tile(np.array([seed, pixel, first, first + sample], dtype=np.int64), (count, 1))


def one_round(count: int, pixel: int = 5, first: int = 0, of: int = 0) -> Points:
    """The first points of a round of `of`, or of as many as there are."""
    keys = keys_of(count, pixel=pixel, first=first)
    keys[:, 3] += np.arange(count)
    return drawn(keys, of or count)


def over_pixels(sample: int = 0, of: int = 64, **others: int) -> Points:
    """One sample in many pixels."""
    keys = keys_of(COUNT, sample=sample, **others)
    keys[:, 1] = np.arange(COUNT)
    return drawn(keys, of)


def error_of(vector: tuple[int, ...], count: int) -> float:
    """The figure that generating vectors are chosen by, for equal weights."""
    x = np.outer(vector, np.arange(count)) % count / count
    return float(np.prod(1.0 + 12.0 * (x * x - x + 1.0 / 6.0), axis=0).mean() - 1.0)


@pytest.mark.parametrize("count", [1, 2, 3, 8, 56, 64, 257, 1000, 1024, 4093, 4096])
def test_every_component_reaches_all_places(count: int) -> None:
    vector = generating_vector(count)
    assert len(vector) == COORDINATES
    assert all(math.gcd(z, count) == 1 and (0 < z < count or count == 1) for z in vector)


@pytest.mark.parametrize("count", [16, 53, 64, 100, 256, 1024])
def test_the_numbers_of_one_direction_lie_on_a_good_lattice(count: int) -> None:
    """Within 2.5 times the least error that any two-dimensional lattice of so many points has; random ones have 2 to 60
    times that, the more the longer the round."""
    coprime = [z for z in range(1, count) if math.gcd(z, count) == 1]
    errors = [error_of((1, z), count) for z in coprime]
    vector = generating_vector(count)
    for pair in ((0, 1), (0, 2), (3, 4)):
        assert error_of(tuple(vector[d] for d in pair), count) < 2.5 * min(errors)
    assert np.mean(errors) > 1.9 * min(errors)


@pytest.mark.parametrize("samples", [1, 64, LARGEST, LARGEST + 1, 10_000, 262_144])
def test_long_sequences_are_made_of_equal_lattices(samples: int) -> None:
    length = lattice_length(samples)
    assert length <= LARGEST
    lattices = -(-samples // length)
    assert lattices == -(-samples // LARGEST)
    assert lattices * length - samples < lattices


def test_vectors_are_the_same_on_every_machine() -> None:
    assert generating_vector(64) == (39, 27, 29, 1, 15, 9, 21, 19, 23)
    assert generating_vector(1000) == (619, 371, 491, 399, 451, 487, 489, 341, 407)


@pytest.mark.parametrize("count", [1, 2, 3, 7, 64, 1000, 4096])
def test_every_coordinate_is_equidistant_over_a_round(count: int) -> None:
    """Wherever a round begins; so each share of a strategy gets its samples, exactly if they are a whole number.

    24 bits tell where each number is, and steps are rounded to 2^-32."""
    for pixel, first in [(0, 0), (5, 64), (77, 12345), (77, 2**31 - 1 - count)]:
        points = one_round(count, pixel, first)
        assert points.min() >= 0.0 and points.max() < 1.0
        gaps = np.diff(np.sort(points, axis=0), axis=0, append=points.min(axis=0)[None] + 1.0)
        assert np.abs(gaps - 1.0 / count).max() < 2.0**-23 + count * 2.0**-32
        if count % 2 == 0:
            assert (points[:, 0] < 0.5).sum() == count // 2


def discrepancy(numbers: Points) -> float:
    """Greatest difference between the numbers' distribution and the uniform one (star discrepancy)."""
    ordered, count = np.sort(numbers), len(numbers)
    return float(np.maximum(np.arange(1, count + 1) / count - ordered, ordered - np.arange(count) / count).max())


@pytest.mark.parametrize("count", [3, 7, 64, 1000])
@pytest.mark.parametrize("of", [1500, 4093, 4096])
def test_the_first_choices_of_a_longer_round_are_even_too(count: int, of: int) -> None:
    """Niederreiter (1992), theorem 3.3: count x discrepancy grows like the logarithm, for the golden ratio slowest."""
    for pixel, first in [(0, 0), (5, 0), (77, 12345)]:
        assert count * discrepancy(one_round(count, pixel, first, of)[:, 0]) < 1.0 + np.log(count + 1.0)
    if count >= 64:
        random = np.random.default_rng(1).random((20, count))
        ours = [discrepancy(one_round(count, pixel, of=of)[:, 0]) for pixel in range(20)]
        assert np.mean(ours) < 0.4 * np.mean([discrepancy(numbers) for numbers in random])


@pytest.mark.parametrize("sample", [0, 1, 63])
def test_a_sample_is_uniform_over_pixels(sample: int) -> None:
    """Each coordinate, and all pairs of them: hence no mean changes, whatever the number of samples."""
    points = over_pixels(sample)
    assert points.min() >= 0.0 and points.max() < 1.0
    for d in range(COORDINATES):
        assert uniformity(points[:, d], 512).p_value > SIGNIFICANCE
    for pair in combinations(range(COORDINATES), 2) if sample == 1 else ():
        assert uniformity(points[:, pair], 48).p_value > SIGNIFICANCE


@pytest.mark.parametrize("first, again", [(0, 1), (0, 8), (8, 16)])
def test_a_round_says_nothing_of_the_next_one(first: int, again: int) -> None:
    """What is learned from a round depends on its numbers; the next round's must not depend on what is learned."""
    one, other = over_pixels(first=first), over_pixels(first=again, sample=5)
    for d in (0, 1, 3):
        assert uniformity(np.stack([one[:, d], other[:, d]], axis=1), 48).p_value > SIGNIFICANCE


def test_neighbours_are_independent() -> None:
    """Pixels, and seeds."""
    one = over_pixels()
    assert uniformity(np.stack([one[:-1:2, 1], one[1::2, 1]], axis=1), 48).p_value > SIGNIFICANCE
    other = over_pixels(seed=4)
    for d in (0, 1, 3):
        assert uniformity(np.stack([one[:, d], other[:, d]], axis=1), 48).p_value > SIGNIFICANCE


def test_later_steps_have_independent_numbers() -> None:
    later, independent = (wp.zeros(64, dtype=wp.vec4) for _ in range(2))
    wp.launch(draw_later, 64, [later, independent])
    np.testing.assert_array_equal(later.numpy(), independent.numpy())


@pytest.mark.parametrize("count, ratio", [(16, 0.3), (64, 0.1), (50, 0.15), (1024, 0.03), (4096, 0.02)])
def test_a_direction_is_integrated_better_than_by_independent_points(count: int, ratio: float) -> None:
    """Standard deviation of the mean of a smooth function of a light sample over pixels, over that of
    independent points."""
    pixels = 200
    points = np.concatenate([one_round(count, pixel)[:, [0, 1]] for pixel in range(pixels)])
    function = np.prod(1.0 + 0.5 * np.sin(2.0 * np.pi * points), axis=1) - 1.0
    errors = function.reshape(pixels, count).mean(axis=1)
    independent = np.sqrt((1.125**2 - 1.0) / count)  # the variance of each factor is 1/8
    assert abs(errors.mean()) < 4.0 * errors.std() / np.sqrt(pixels)
    assert np.sqrt((errors**2).mean()) < ratio * independent
