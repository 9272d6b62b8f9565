"""The counter-based generator: uniform, independent between neighbouring keys, and the same for the same key."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray
from stats import sidak, uniformity

from warpmis.kernels import rng

COUNT = 1 << 18
AXES = ("seed", "pixel", "sample", "block")
SIGNIFICANCE = sidak(0.01, 4 * 4 + 4 * 4 + 6 + 4)


@wp.kernel(module="unique", enable_backward=False)
def draw(keys: wp.array(dtype=wp.vec4i), numbers: wp.array(dtype=wp.vec4), steps: wp.array(dtype=wp.vec4)):
    """Of each (seed, pixel, sample, block) the numbers; and those of step block / 4, purpose block % 4 + 1."""
    i = wp.tid()
    key = rng.RngKey()
    key.seed = wp.uint32(keys[i][0])
    key.pixel = wp.uint32(keys[i][1])
    key.sample = wp.uint32(keys[i][2])
    numbers[i] = rng.uniform4(key, keys[i][3])
    steps[i] = rng.uniform4_of_step(key, keys[i][3] / 4, keys[i][3] % 4 + 1)


@wp.kernel(module="unique", enable_backward=False)
def convert(bits: wp.array(dtype=wp.uint32), numbers: wp.array(dtype=float)):
    i = wp.tid()
    numbers[i] = rng.to_unit(bits[i])


def drawn(keys: NDArray[np.int64]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    numbers, steps = wp.zeros(len(keys), dtype=wp.vec4), wp.zeros(len(keys), dtype=wp.vec4)
    wp.launch(draw, len(keys), [wp.array(keys.astype(np.uint32).view(np.int32), dtype=wp.vec4i), numbers, steps])
    return numbers.numpy(), steps.numpy()


def along(axis: str, count: int = COUNT) -> NDArray[np.int64]:
    """Keys that differ in one part alone, by 1 each."""
    keys = np.tile(np.array([1, 20, 300, 4], dtype=np.int64), (count, 1))
    keys[:, AXES.index(axis)] = np.arange(count)
    return keys


@pytest.mark.parametrize("axis", AXES)
def test_numbers_are_uniform_and_neighbours_independent(axis: str) -> None:
    numbers = drawn(along(axis))[0].astype(float)
    assert 0.0 <= numbers.min() < 1e-4
    assert 0.9999 < numbers.max() < 1.0
    for k in range(4):
        assert uniformity(numbers[:, k], 512).p_value > SIGNIFICANCE
        neighbours = np.stack([numbers[:-1:2, k], numbers[1::2, k]], axis=1)
        assert uniformity(neighbours, 48).p_value > SIGNIFICANCE


def test_the_four_numbers_of_a_block_are_independent() -> None:
    numbers = drawn(along("sample"))[0].astype(float)
    for pair in combinations(range(4), 2):
        assert uniformity(numbers[:, pair], 48).p_value > SIGNIFICANCE


def test_keys_that_share_their_sum_differ() -> None:
    """A hash that only added its parts up would give them the same numbers."""
    for a, b in [(0, 1), (1, 2), (2, 3), (0, 3)]:
        keys = along("sample", COUNT // 2)
        keys[:, :] = 7
        keys[:, a] = np.arange(len(keys))
        swapped = keys.copy()
        swapped[:, [a, b]] = keys[:, [b, a]]
        both = np.stack([drawn(keys)[0][:, 0], drawn(swapped)[0][:, 0]], axis=1).astype(float)
        assert uniformity(both[8:], 48).p_value > SIGNIFICANCE


def test_equal_keys_give_equal_numbers_whatever_was_drawn_before() -> None:
    keys = along("pixel", 1000)
    order = np.random.default_rng(1).permutation(1000)
    np.testing.assert_array_equal(drawn(keys[order])[0], drawn(keys)[0][order])
    assert len(np.unique(drawn(keys)[0][:, 0])) > 990


def test_numbers_are_those_of_pcg4d() -> None:
    """Jarzynski and Olano (2020), in NumPy."""
    keys = np.random.default_rng(2).integers(0, 1 << 32, (1000, 4))
    v = keys.astype(np.uint32) * np.uint32(1664525) + np.uint32(1013904223)

    def mix(v: NDArray[np.uint32]) -> None:
        for target, a, b in ((0, 1, 3), (1, 2, 0), (2, 0, 1), (3, 1, 2)):
            v[:, target] += v[:, a] * v[:, b]

    mix(v)
    v ^= v >> np.uint32(16)
    mix(v)
    np.testing.assert_array_equal(drawn(keys)[0], (v >> np.uint32(8)).astype(np.float64) / (1 << 24))


def test_one_itself_cannot_come_out() -> None:
    bits = np.array([0, 255, 256, 1 << 31, 0xFFFFFFFF], dtype=np.uint32)
    numbers = wp.zeros(len(bits), dtype=float)
    wp.launch(convert, len(bits), [wp.array(bits), numbers])
    np.testing.assert_array_equal(numbers.numpy(), [0.0, 0.0, 2.0**-24, 0.5, 1.0 - 2.0**-24])


def test_each_purpose_of_each_step_has_a_block_of_its_own() -> None:
    """None shares the camera's block, nor another step's."""
    numbers, steps = drawn(along("block", 400))
    purposes = (rng.EVENT, rng.SCATTER, rng.LIGHT, rng.DELTA_LIGHT)
    assert sorted(purposes) == [1, 2, 3, 4]
    assert len(purposes) == rng.BLOCKS
    assert len(np.unique(steps, axis=0)) == 400
    # Step k and purpose p have the block 1 + 4 k + p, so that all are in use and only the camera's is left out.
    np.testing.assert_array_equal(steps[:-1], numbers[1:])
    assert rng.CAMERA == 0
