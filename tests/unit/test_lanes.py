"""Eight floats at a time: what becomes of eight comparisons."""

from __future__ import annotations

import numpy as np
import warp as wp

from warpmis.device.views import vec8f
from warpmis.kernels.lanes import lanes_up_to, lowest_bit
from warpmis.kernels.trace import CPU_FLAGS


@wp.kernel(module="unique", module_options={"cpu_compiler_flags": CPU_FLAGS}, enable_backward=False)
def compare(
    a: wp.array(dtype=vec8f), b: wp.array(dtype=vec8f), masks: wp.array(dtype=int), lowest: wp.array(dtype=int)
):
    i = wp.tid()
    mask = lanes_up_to(a[i], b[i])
    masks[i] = mask
    lowest[i] = -1
    if mask != 0:
        lowest[i] = lowest_bit(mask)


def test_masks_of_comparisons() -> None:
    """Every mask there is, by values that are equal, of either sign, infinite, 0 and -0."""
    values = np.array([-np.inf, -1.0, -1e-37, -0.0, 0.0, 1e-37, 1.0, np.inf], np.float32)
    rng = np.random.default_rng(1)
    a, b = rng.choice(values, (2, 1 << 15, 8))
    masks, lowest = (wp.zeros(len(a), dtype=int, device="cpu") for _ in range(2))
    inputs = [wp.array(e, dtype=vec8f, device="cpu") for e in (a, b)]
    wp.launch(compare, len(a), [*inputs, masks, lowest], device="cpu")
    expected = ((a <= b) << np.arange(8)).sum(axis=1)
    assert set(expected) == set(range(256))
    np.testing.assert_array_equal(masks.numpy(), expected)
    np.testing.assert_array_equal(
        lowest.numpy(), np.where(expected > 0, np.log2(np.maximum(expected & -expected, 1)), -1)
    )
