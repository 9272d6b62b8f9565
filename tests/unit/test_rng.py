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
SIGNIFICANCE = sidak(0.01, 4 * 4 + 4 * 4 + 6 + 4 + 3 + 4)


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


@wp.kernel(module="unique", enable_backward=False)
def step_evenly(seed: int, pixel: int, first_sample: int, step: wp.uint32, numbers: wp.array(dtype=float)):
    """The lattice's numbers: thread i is sample i of the pixel, or sample first_sample of pixel i if pixel < 0."""
    i = wp.tid()
    key = rng.RngKey()
    key.seed = wp.uint32(seed)
    key.pixel = wp.uint32(wp.where(pixel < 0, i, pixel))
    key.sample = wp.uint32(first_sample + wp.where(pixel < 0, 0, i))
    key.round = wp.uint32(first_sample)
    numbers[i] = rng.lattice(key, step)


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


def evenly(count: int, pixel: int = -1, first_sample: int = 0, seed: int = 1, of: int = 0) -> NDArray[np.float64]:
    """The first numbers of a round of `of` samples, or of as many as there are."""
    numbers = wp.zeros(count, dtype=float)
    wp.launch(step_evenly, count, [seed, pixel, first_sample, rng.lattice_step(of or count), numbers])
    return numbers.numpy().astype(float)


def discrepancy(numbers: NDArray[np.float64]) -> float:
    """Greatest difference between the numbers' distribution and the uniform one (star discrepancy)."""
    ordered, count = np.sort(numbers), len(numbers)
    return float(np.maximum(np.arange(1, count + 1) / count - ordered, ordered - np.arange(count) / count).max())


@pytest.mark.parametrize("count", [1, 2, 3, 7, 64, 1000, 6720, 1 << 15])
def test_lattice_gives_each_share_of_a_round_its_samples(count: int) -> None:
    """Exactly, whatever the start, if they are a whole number: from one sample to the next, counted from anywhere.

    24 bits tell where each number is: the points of large rounds are off by 2^-24."""
    for pixel, first in [(0, 0), (5, 64), (77, 12345), (77, 2**31 - 1 - count)]:
        numbers = evenly(count, pixel, first)
        assert numbers.min() >= 0.0 and numbers.max() < 1.0
        gaps = np.diff(np.sort(numbers), append=np.min(numbers) + 1.0)
        assert np.abs(gaps - 1.0 / count).max() < 2.0**-23 + count * 2.0**-32
        if count % 2 == 0:
            assert (numbers < 0.5).sum() == count // 2


@pytest.mark.parametrize("count", [3, 7, 64, 1000, 1 << 16])
@pytest.mark.parametrize("of", [1 << 17, 9_999_991, 1 << 30])
def test_the_first_of_a_longer_round_are_even_too(count: int, of: int) -> None:
    """Niederreiter (1992), theorem 3.3: count x discrepancy grows like the logarithm, for the golden ratio slowest."""
    for pixel, first in [(0, 0), (5, 0), (77, 12345)]:
        assert count * discrepancy(evenly(count, pixel, first, of=of)) < 1.0 + np.log(count + 1.0)
    if count >= 64:
        random = np.random.default_rng(1).random((20, count))
        assert discrepancy(evenly(count, 5, of=of)) < 0.5 * min(map(discrepancy, random))


@pytest.mark.parametrize("first", [0, 8, 1000])
def test_lattice_is_uniform_over_pixels(first: int) -> None:
    """Each sample alone is as if drawn at random: no share of a strategy is missed."""
    numbers = evenly(COUNT, first_sample=first)
    assert uniformity(numbers, 512).p_value > SIGNIFICANCE


def test_lattice_of_a_round_says_nothing_of_the_next_one() -> None:
    """What is learned from a round depends on its numbers; the next round's must not depend on what is learned."""
    for first, again in [(0, 1), (0, 8), (8, 16)]:
        both = np.stack([evenly(COUNT, first_sample=first), evenly(COUNT, first_sample=again)], axis=1)
        assert uniformity(both, 48).p_value > SIGNIFICANCE
    # Nor does one seed say anything of another.
    both = np.stack([evenly(COUNT, seed=1), evenly(COUNT, seed=2)], axis=1)
    assert uniformity(both, 48).p_value > SIGNIFICANCE
