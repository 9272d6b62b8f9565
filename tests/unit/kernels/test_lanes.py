"""Eight floats at a time: masks, choices, roots, minima, maxima; and a mean that the tree over lights fits."""

from __future__ import annotations

import numpy as np
import warp as wp

from warpmis.device.views import vec8f
from warpmis.kernels.lanes import any_above, at_least, first_set_bit, mask_less_equal, max8, min8, square_roots
from warpmis.kernels.light.tree import mean_over_ball


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


@wp.kernel(module="unique", enable_backward=False)
def choose(
    a: wp.array(dtype=vec8f),
    b: wp.array(dtype=vec8f),
    chosen: wp.array(dtype=vec8f),
    roots: wp.array(dtype=vec8f),
    above: wp.array(dtype=bool),
):
    i = wp.tid()
    chosen[i] = at_least(a[i], b[i], a[i] * 2.0, b[i] * 3.0)
    roots[i] = square_roots(a[i])
    above[i] = any_above(a[i], b[i][0])


@wp.kernel(module="unique", enable_backward=False)
def fit(near: wp.array(dtype=vec8f), found: wp.array(dtype=vec8f)):
    found[wp.tid()] = mean_over_ball(near[wp.tid()])


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


def test_choices_roots_and_whether_any_is_above() -> None:
    """Of lanes that are equal, of either sign, infinite or no number, as numpy has them."""
    values = np.append(VALUES, np.float32(np.nan))
    a, b = np.random.default_rng(3).choice(values, (2, 1 << 10, 8))
    inputs = [wp.array(e, dtype=vec8f, device="cpu") for e in (a, b)]
    chosen, roots = (wp.zeros(len(a), dtype=vec8f, device="cpu") for _ in range(2))
    above = wp.zeros(len(a), dtype=bool, device="cpu")
    wp.launch(choose, len(a), [*inputs, chosen, roots, above], device="cpu")
    with np.errstate(invalid="ignore"):
        np.testing.assert_array_equal(chosen.numpy(), np.where(a >= b, a * np.float32(2), b * np.float32(3)))
        np.testing.assert_array_equal(roots.numpy(), np.sqrt(a))
    np.testing.assert_array_equal(above.numpy(), (a > b[:, :1]).any(axis=1))


def test_the_mean_over_a_ball_is_fitted_to_11_percent() -> None:
    """Against the mean of 1 / distance^2 by shells: over one of radius s it is ln |(d + s) / (d - s)| / (2 d s)."""
    near = np.linspace(0.004, 0.996, 1 << 6, dtype=np.float32).reshape(-1, 8)
    found = wp.zeros(len(near), dtype=vec8f, device="cpu")
    wp.launch(fit, len(near), [wp.array(near, dtype=vec8f, device="cpu"), found], device="cpu")
    radius, distance = np.sqrt(near.astype(float))[..., None], np.sqrt(1.0 - near.astype(float))[..., None]
    shell = radius * (np.arange(20_000) + 0.5) / 20_000
    of_shell = np.log(np.abs((distance + shell) / (distance - shell))) / (2.0 * distance * shell)
    expected = (of_shell * 3.0 * shell**2 / radius**3 * radius / 20_000).sum(axis=-1)
    np.testing.assert_allclose(found.numpy(), expected, rtol=0.11)
