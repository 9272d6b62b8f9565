"""What a glossy receiver makes of light by its direction."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray

from warpmis.kernels.lanes import splat8
from warpmis.kernels.light.records import Response
from warpmis.kernels.light.response import STRENGTH, towards, towards_eight

COUNT = 4096
N = np.array([0.0, 0.0, 1.0])


@wp.kernel(module="unique", enable_backward=False)
def ask(
    responses: wp.array(dtype=Response),
    n: wp.vec3,
    wis: wp.array(dtype=wp.vec3),
    extents: wp.array(dtype=float),
    one: wp.array(dtype=float),
    eight: wp.array(dtype=float),
):
    """By the function for one light, and by the one for eight."""
    i = wp.tid()
    wi = wis[i]
    one[i] = towards(responses[i], n, wi, extents[i])
    of_eight = towards_eight(responses[i], n, splat8(wi[0]), splat8(wi[1]), splat8(wi[2]), splat8(extents[i]))
    eight[i] = of_eight[i % 8]


def asked(lobes: NDArray[np.float64], wo: NDArray[np.float64], wi: NDArray[np.float64], extent: float) -> NDArray:
    """Both answers, shape (2, n); lobes: matte, gloss, alpha2, coat, coat_alpha2 of each, shape (n, 5)."""
    table = np.zeros(len(wi), Response.numpy_dtype())
    table["wo"] = wo
    for column, name in enumerate(("matte", "gloss", "alpha2", "coat", "coat_alpha2")):
        table[name] = lobes[:, column]
    found = [wp.zeros(len(wi), dtype=float) for _ in range(2)]
    directions = wp.array(wi.astype(np.float32), dtype=wp.vec3)
    inputs = [wp.array(table, dtype=Response), wp.vec3(*N), directions, wp.full(len(wi), extent, dtype=float)]
    wp.launch(ask, len(wi), [*inputs, *found])
    return np.array([one.numpy() for one in found], np.float64)


def above(random: np.random.Generator, count: int) -> NDArray[np.float64]:
    found = random.normal(size=(count, 3))
    found[:, 2] = np.abs(found[:, 2])
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def some_lobes(random: np.random.Generator, count: int) -> NDArray[np.float64]:
    weights = random.dirichlet(np.ones(3), count)
    widths = 10.0 ** random.uniform(-6.0, 0.0, (count, 2))
    return np.stack([weights[:, 0], weights[:, 1], widths[:, 0], weights[:, 2], widths[:, 1]], axis=1)


@pytest.mark.parametrize("extent", [0.0, 1e-4, 0.3, 50.0])
def test_one_light_and_eight_have_the_same_response(extent: float) -> None:
    random = np.random.default_rng(1)
    one, eight = asked(some_lobes(random, COUNT), above(random, COUNT), above(random, COUNT), extent)
    np.testing.assert_allclose(eight, one, rtol=1e-3)
    assert (one >= 1.0).all()


@pytest.mark.parametrize("alpha2", [0.0, 1e-30, 1e-6, 0.1])
@pytest.mark.parametrize("coat", [0.0, 0.3])
def test_finite_right_in_the_mirrors_direction(alpha2: float, coat: float) -> None:
    """Where a lobe without width would be 0 / 0, an absent one, too."""
    random = np.random.default_rng(2)
    wo = above(random, COUNT)
    wo[: COUNT // 2] = N
    mirrored = wo * [-1.0, -1.0, 1.0]
    lobes = np.tile([0.1, 0.9 - coat, alpha2, coat, 0.0], (COUNT, 1))
    found = asked(lobes, wo, mirrored, 0.0)
    assert np.isfinite(found).all() and (found > 1.0).all() and (found < 1e15).all()


def test_a_lobe_is_pi_times_d_over_four_squared_cosines() -> None:
    """Walter et al. (2007), equation 33, in float64."""
    random = np.random.default_rng(3)
    wo, wi = above(random, COUNT), above(random, COUNT)
    h = wo + wi
    length = np.linalg.norm(h, axis=1)
    usable = length > 0.3
    cos_h, alpha2 = h[:, 2] / length, 0.04
    d = alpha2 / (np.pi * (cos_h**2 * (alpha2 - 1.0) + 1.0) ** 2)
    expected = 1.0 + float(STRENGTH) * np.pi * d / (4.0 * np.sum(wo * h / length[:, None], axis=1) ** 2)
    one, _ = asked(np.tile([0.0, 1.0, alpha2, 0.0, 0.0], (COUNT, 1)), wo, wi, 0.0)
    np.testing.assert_allclose(one[usable], expected[usable], rtol=1e-4)


def test_a_matte_receiver_is_not_asked() -> None:
    random = np.random.default_rng(4)
    found = asked(np.zeros((COUNT, 5)), above(random, COUNT), above(random, COUNT), 0.1)
    assert (found[0] == 1.0).all()
