"""The bound on what other shares could save: true for every allocation, tight at the best one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from toys import Toy, bumps, perfect, smooth

from warpmis.learn.certificate import excess_variance_bound


def bound_of(toy: Toy, a: np.ndarray, samples: int = 64) -> float:
    moments = samples * toy.moments(a)[None]
    return float(excess_variance_bound(moments, np.array([a]), np.array([samples]))[0])


def simplex(count: int) -> np.ndarray:
    """Allocations on a grid, none of them with a share of 0."""
    parts = np.stack(np.meshgrid(*[np.arange(1, 20)] * (count - 1), indexing="ij"), axis=-1).reshape(-1, count - 1)
    parts = parts[parts.sum(axis=1) < 20]
    return np.column_stack([parts, 20 - parts.sum(axis=1)]) / 20.0


@pytest.mark.parametrize("toy", [smooth(), perfect(), bumps(3, seed=1), bumps(3, seed=2)])
def test_never_below_what_the_best_allocation_saves(toy: Toy) -> None:
    grid = simplex(toy.p.shape[1])
    variances = np.array([toy.variance(a) for a in grid])
    bounds = np.array([bound_of(toy, a) for a in grid])
    assert (bounds >= variances - variances.min() - 1e-12).all()
    # Not by being enormous: of a bad allocation's excess it is but a few times as much.
    excess = variances - variances.min()
    bad = excess > 0.5 * excess.max()
    assert (bounds[bad] < 25.0 * excess[bad]).all()


def test_nothing_is_left_at_the_optimum() -> None:
    toy = smooth()
    best = minimize_scalar(lambda a: toy.second_moment((a, 1.0 - a)), bounds=(0.1, 0.9), options={"xatol": 1e-10}).x
    assert bound_of(toy, np.array([best, 1.0 - best])) < 1e-5 * toy.variance((best, 1.0 - best))
    assert bound_of(toy, np.array([best - 0.1, 1.1 - best])) > 0.1 * toy.variance((best, 1.0 - best))


def test_by_hand() -> None:
    """m = (3, 1) a sample at equal shares: M2 = 2, so that the bound is 3 - 2 = 1, of 10 samples as of one."""
    moments = np.array([[3.0, 1.0, 9.0, 9.0, 9.0], [30.0, 10.0, 0.0, 0.0, 0.0], [0.0] * 5])
    shares = np.full((3, 2), 0.5, np.float32)
    assert excess_variance_bound(moments, shares, np.array([1, 10, 0])) == pytest.approx([1.0, 1.0, 0.0])
