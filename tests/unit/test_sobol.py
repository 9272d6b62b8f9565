"""The Sobol sampler: the sequence itself, what scrambling keeps of it, and that every point alone is uniform."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray
from scipy.stats import qmc
from stats import sidak, uniformity

from warpmis.kernels import rng, sobol

COUNT = 1 << 17
PAIRS = ((0, 1), (1, 2), (0, 3), (2, 3))
SIGNIFICANCE = sidak(0.01, 4 * len(PAIRS) + 4 * 3 + 3)

Keys = NDArray[np.int64]  # rows of (seed, pixel, round, sample, block)


@wp.kernel(module="unique", enable_backward=False)
def draw(keys: wp.array2d(dtype=int), points: wp.array(dtype=wp.vec4), choices: wp.array(dtype=float)):
    i = wp.tid()
    key = rng.RngKey()
    key.seed = wp.uint32(keys[i, 0])
    key.pixel = wp.uint32(keys[i, 1])
    key.round = wp.uint32(keys[i, 2])
    key.sample = wp.uint32(keys[i, 3])
    points[i] = sobol.point4(key, keys[i, 4])
    choices[i] = rng.lattice(key, wp.uint32(2717908992))  # 81 / 128


@wp.kernel(module="unique", enable_backward=False)
def take(points: wp.array2d(dtype=wp.uint32), of_step: wp.array(dtype=wp.vec4)):
    i = wp.tid()
    point = sobol.sobol4(wp.uint32(i))
    for d in range(4):
        points[i, d] = sobol.reversed_bits(point[d])
    key = rng.RngKey()
    key.sample = wp.uint32(i)
    of_step[i] = sobol.point4_of_step(key, 5, rng.LIGHT)


def drawn(keys: Keys) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    points, choices = wp.zeros(len(keys), dtype=wp.vec4), wp.zeros(len(keys), dtype=float)
    wp.launch(draw, len(keys), [wp.array(keys.astype(np.int32), dtype=int), points, choices])
    return points.numpy().astype(float), choices.numpy().astype(float)


def keys_of(count: int, seed: int = 3, pixel: int = 17, first: int = 0, sample: int = 0, block: int = 0) -> Keys:
    return np.tile(np.array([seed, pixel, first, sample, block], dtype=np.int64), (count, 1))


def sequence(count: int, **others: int) -> Keys:
    """The first points of one round."""
    keys = keys_of(count, **others)
    keys[:, 3] = keys[:, 2] + np.arange(count)
    return keys


def taken(count: int) -> tuple[NDArray[np.uint32], NDArray[np.float32]]:
    points, of_step = wp.zeros((count, 4), dtype=wp.uint32), wp.zeros(count, dtype=wp.vec4)
    wp.launch(take, count, [points, of_step])
    return points.numpy(), of_step.numpy()


def is_net(points: NDArray[np.float64]) -> bool:
    """Whether each elementary interval of area 1 / n holds one of the n = 2^k points: a (0, k, 2)-net in base 2."""
    k = len(points).bit_length() - 1
    cells = [(points * (1 << a, 1 << (k - a))).astype(int) @ (1 << (k - a), 1) for a in range(k + 1)]
    return all(len(np.unique(cell)) == len(points) for cell in cells)


def test_the_points_are_those_of_joe_and_kuo() -> None:
    """Theirs in SciPy, which counts in Gray code."""
    index = np.arange(1 << 12)
    theirs = qmc.Sobol(4, scramble=False, bits=32).random(len(index)) * 2.0**32
    np.testing.assert_array_equal(taken(len(index))[0][index ^ (index >> 1)], theirs.astype(np.uint32))


@pytest.mark.parametrize("k", [1, 4, 6, 9])
def test_the_first_pair_is_a_net_wherever_a_round_begins(k: int) -> None:
    for first, block in [(0, 0), (0, 22), (8, 0), (12345, 7), (0, rng.LENS)]:
        points = drawn(sequence(3 << k, first=first, block=block))[0]
        for part in range(3):  # also the later stretches of 2^k points: a (0, 2)-sequence
            assert is_net(points[part << k : (part + 1) << k, :2])


def test_independent_points_are_no_net() -> None:
    assert not is_net(np.random.default_rng(1).random((16, 2)))


def test_every_dimension_is_stratified() -> None:
    points = drawn(sequence(256, block=3))[0]
    for d in range(4):
        np.testing.assert_array_equal(np.sort((points[:, d] * 256).astype(int)), np.arange(256))


def test_a_steps_directions_come_from_the_pair_that_is_a_net() -> None:
    of_step = taken(64)[1].astype(float)
    keys = sequence(64, seed=0, pixel=0, block=rng.LIGHT + 5 * rng.BLOCKS)
    np.testing.assert_array_equal(of_step[:, [1, 2, 0, 3]], drawn(keys)[0])
    assert is_net(of_step[:, 1:3])


@pytest.mark.parametrize("sample", [0, 1, 63, 1000])
def test_a_sample_is_uniform_over_pixels(sample: int) -> None:
    """Hence no mean changes, whatever the number of samples."""
    keys = keys_of(COUNT, sample=sample)
    keys[:, 1] = np.arange(COUNT)
    points = drawn(keys)[0]
    assert points.min() >= 0.0 and points.max() < 1.0
    for pair in PAIRS:
        assert uniformity(points[:, pair], 48).p_value > SIGNIFICANCE


@pytest.mark.parametrize("part", ["seed", "first", "block", "pixel"])
def test_neighbours_are_independent(part: str) -> None:
    """Seeds, rounds (what is learned from one must tell nothing of the next), blocks and pixels."""
    keys = keys_of(COUNT)
    keys[:, 0 if part == "pixel" else 1] = np.arange(COUNT)
    other = keys.copy()
    other[:, {"seed": 0, "pixel": 1, "first": 2, "block": 4}[part]] += 1
    for sample in (0, 5, 40):
        keys[:, 3], other[:, 3] = sample, sample + (part == "first")
        both = np.stack([drawn(keys)[0][:, 0], drawn(other)[0][:, 0]], axis=1)
        assert uniformity(both, 48).p_value > SIGNIFICANCE


@pytest.mark.parametrize("sample", [0, 1, 40])
def test_the_choice_of_strategy_is_independent_of_the_point(sample: int) -> None:
    keys = keys_of(COUNT, sample=sample, block=rng.SCATTER)
    keys[:, 1] = np.arange(COUNT)
    points, choices = drawn(keys)
    assert uniformity(np.stack([choices, points[:, 0]], axis=1), 48).p_value > SIGNIFICANCE


def test_a_smooth_function_of_all_four_is_integrated_better_than_by_independent_points() -> None:
    """Means of prod_d (1 + sin(2 pi x_d) / 2) - 1 over 64 points, in 500 pixels: errors nine times smaller."""
    keys = np.concatenate([sequence(64, pixel=pixel) for pixel in range(500)])
    function = np.prod(1.0 + 0.5 * np.sin(2.0 * np.pi * drawn(keys)[0]), axis=1) - 1.0
    errors = function.reshape(500, 64).mean(axis=1)
    independent = np.sqrt((1.125**4 - 1.0) / 64)  # the variance of each factor is 1/8
    assert abs(errors.mean()) < 4.0 * errors.std() / np.sqrt(500)
    assert np.sqrt((errors**2).mean()) < 0.15 * independent
