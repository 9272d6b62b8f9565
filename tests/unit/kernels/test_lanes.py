"""Eight floats at a time: masks of comparisons, minima, maxima."""

from __future__ import annotations

import numpy as np
import warp as wp

from warpmis.device.views import vec8f
from warpmis.kernels.lanes import first_set_bit, mask_less_equal, max8, min8


@wp.kernel(module="unique", enable_backward=False)
def compare(
    a: wp.array(dtype=vec8f), b: wp.array(dtype=vec8f), masks: wp.array(dtype=int), lowest: wp.array(dtype=int)
):
    i = wp.tid()
    mask = mask_less_equal(a[i], b[i])
    masks[i] = mask
    lowest[i] = -1
    if mask != 0:
        lowest[i] = first_set_bit(mask)


@wp.kernel(module="unique", enable_backward=False)
def part(a: wp.array(dtype=vec8f), b: wp.array(dtype=vec8f), least: wp.array(dtype=vec8f), most: wp.array(dtype=vec8f)):
    i = wp.tid()
    least[i] = min8(a[i], b[i])
    most[i] = max8(a[i], b[i])


VALUES = np.array([-np.inf, -1.0, -1e-37, -0.0, 0.0, 1e-37, 1.0, np.inf], np.float32)


def test_minima_and_maxima() -> None:
    """The min8 and the max8 of each two lanes; the second where either is NaN."""
    a, b = np.random.default_rng(2).choice(np.append(VALUES, np.nan), (2, 1 << 10, 8))
    inputs = [wp.array(e, dtype=vec8f, device="cpu") for e in (a, b)]
    least, most = (wp.zeros(len(a), dtype=vec8f, device="cpu") for _ in range(2))
    wp.launch(part, len(a), [*inputs, least, most], device="cpu")
    np.testing.assert_array_equal(least.numpy(), np.where(a < b, a, b))
    np.testing.assert_array_equal(most.numpy(), np.where(a > b, a, b))


def test_masks_of_comparisons() -> None:
    """Every mask there is, by values that are equal, of either sign, infinite, 0 and -0."""
    rng = np.random.default_rng(1)
    a, b = rng.choice(VALUES, (2, 1 << 15, 8))
    masks, lowest = (wp.zeros(len(a), dtype=int, device="cpu") for _ in range(2))
    inputs = [wp.array(e, dtype=vec8f, device="cpu") for e in (a, b)]
    wp.launch(compare, len(a), [*inputs, masks, lowest], device="cpu")
    expected = ((a <= b) << np.arange(8)).sum(axis=1)
    assert set(expected) == set(range(256))
    np.testing.assert_array_equal(masks.numpy(), expected)
    np.testing.assert_array_equal(
        lowest.numpy(), np.where(expected > 0, np.log2(np.maximum(expected & -expected, 1)), -1)
    )
