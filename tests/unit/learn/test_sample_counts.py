"""Counts of light samples and paths from a pilot's moments: against cases worked by hand."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from warpmis.learn.sample_counts import CANDIDATES, Cost, best_counts, covariances, variance

# Columns of mean 0, at right angles, of length^2 8: what varies between eight rounds.
SIGNS = np.array([1.0, -1.0])
HADAMARD = np.array(
    [[SIGNS[(i >> 2 & a >> 2 & 1) ^ (i >> 1 & a >> 1 & 1) ^ (i & a & 1)] for a in range(8)] for i in range(8)]
)


def pilot(common: float, light: float, path: float, pixels: int = 3) -> NDArray[np.float64]:
    """Rounds whose samples have in common, and each on its own, a variance of so many squares, x 8 / 7."""
    u = [10.0 + common**0.5 * HADAMARD[:, 1] + light**0.5 * HADAMARD[:, i] for i in (2, 3)]
    b = [2.0 + path**0.5 * HADAMARD[:, i] for i in (4, 5)]
    return np.repeat(np.stack([*u, *b], axis=-1)[:, np.newaxis], pixels, axis=1)


def test_variance_of_counts_by_hand() -> None:
    """V_U = 3, C_U = 1, V_B = 5, C_B = 2, C_UB = 1/2: 1 + 2 / n + 2 + 3 / m + 1."""
    of = np.array([[3.0, 1.0, 0.5, 0.5], [1.0, 3.0, 0.5, 0.5], [0.5, 0.5, 5.0, 2.0], [0.5, 0.5, 2.0, 5.0]])
    assert variance(of, 1, 1) == pytest.approx(9.0)
    assert variance(of, 2, 1) == pytest.approx(8.0)
    assert variance(of, 1, 2) == pytest.approx(7.5)
    assert variance(of, 4, 4) == pytest.approx(4.0 + 0.5 + 0.75)


def test_covariances_are_those_between_rounds() -> None:
    found = covariances(pilot(common=1.0, light=0.5, path=4.0))[0] * (12.0**2 * 1.01)
    expected = np.array([[1.5, 1.0, 0.0, 0.0], [1.0, 1.5, 0.0, 0.0], [0.0, 0.0, 4.0, 0.0], [0.0, 0.0, 0.0, 4.0]])
    np.testing.assert_allclose(found, expected * 8.0 / 7.0, atol=1e-12)


def test_splitting_as_in_the_paper() -> None:
    """Rath et al. (2022): of a variance V_0 at the cost c_0 before a vertex and V, c after it, sqrt(V c_0 / (V_0 c))
    paths are best. With V = 4 V_0 and c = c_0 / 4 that is 4: variance x cost is 5 x 5, 3 x 6, 2 x 8 for 1, 2, 4."""
    cost = Cost(base=3.5, light=0.5, path=1.0)
    rounds = pilot(common=1.0, light=0.0, path=4.0)
    of = covariances(rounds)[0]
    products = [variance(of, 1, paths) * cost.of(1, paths) for paths in (1, 2, 4)]
    np.testing.assert_allclose(products / products[0], [1.0, 18.0 / 25.0, 16.0 / 25.0])
    assert best_counts(rounds, cost) == (1, 2), "of those that are tried"
    assert best_counts(pilot(common=1.0, light=0.0, path=1.0), cost) == (1, 1)  # 2 x 5, 1.5 x 6, 1.25 x 8
    assert best_counts(pilot(common=1.0, light=0.0, path=0.1), cost) == (1, 1)


def test_light_samples() -> None:
    """Variance x cost is 5 x 2 and 3 x 2.1 for 1 and 2 light samples, and a second path brings nothing."""
    cost = Cost(base=0.9, light=0.1, path=1.0)
    assert best_counts(pilot(common=1.0, light=4.0, path=0.0), cost) == (2, 1)


def test_a_small_gain_is_none() -> None:
    """Variance x cost is 6 x 2 with one path and 3.9 x 3 with two, 1.03 times as good, before what its kernel takes."""
    cost = Cost(base=0.5, light=0.5, path=1.0)
    rounds = pilot(common=1.8, light=0.0, path=4.2)
    products = {counts: variance(covariances(rounds)[0], *counts) * cost.of(*counts) for counts in CANDIDATES}
    assert min(products, key=lambda counts: products[counts]) == (1, 2)
    assert best_counts(rounds, cost) == (1, 1)


@pytest.mark.parametrize("unit", [1e-30, 1e30])
def test_unit_of_radiance_does_not_matter(unit: float) -> None:
    cost = Cost(base=3.5, light=0.5, path=1.0)
    assert best_counts(unit * pilot(common=1.0, light=0.0, path=4.0), cost) == (1, 2)


def test_nothing_to_learn() -> None:
    assert best_counts(np.zeros((4, 5, 4)), Cost(1.0, 0.5, 2.0)) == (1, 1)
