"""Expectation maximisation: against a twin in NumPy, and where it converges to."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize
from toys import Toy, bad_moments, bumps, filled, perfect, smooth, solve

from warpmis.kernels.moments import Layout
from warpmis.learn.expectation import make_expectation

POSTERIOR = ("posterior",)


def step(posterior: np.ndarray, allocation: np.ndarray, least: float) -> np.ndarray:
    layout = Layout(posterior.shape[1], POSTERIOR)
    moments = np.array([filled(layout, posterior=one) for one in posterior])
    return solve(make_expectation(layout), layout.vec, moments, allocation, least)


def posterior_of(toy: Toy, a: np.ndarray) -> np.ndarray:
    """E[F a_s q_s] = int f a_s p_s / p_a."""
    return (toy.f[:, None] * a * toy.quotients(a)).mean(axis=0)


@pytest.mark.parametrize("count", [2, 3])
def test_equals_numpy_twin(count: int) -> None:
    """Each share is what it claims of the light; 0.05 of all samples is every strategy's own, whatever it claims."""
    rng = np.random.default_rng(count)
    claims = rng.gamma(0.5, size=(100, count)) * rng.lognormal(0.0, 20.0, size=(100, 1))
    expected = 0.05 + (1.0 - 0.05 * count) * claims / claims.sum(axis=1, keepdims=True)
    stepped = step(claims, rng.dirichlet(np.ones(count), size=100), 0.05)
    assert stepped == pytest.approx(expected, abs=1e-6)
    assert stepped.min() >= 0.05 - 1e-7


def test_by_hand() -> None:
    """Claims of 3 and 1: shares of 3/4 and 1/4; with 0.1 for each, 0.1 + 0.8 * 3/4 = 0.7 and 0.3."""
    assert step(np.array([[3.0, 1.0]]), [[0.5, 0.5]], 0.0)[0] == pytest.approx([0.75, 0.25])
    assert step(np.array([[3.0, 1.0]]), [[0.5, 0.5]], 0.1)[0] == pytest.approx([0.7, 0.3])


@pytest.mark.parametrize("count", [2, 3])
def test_converges_to_the_least_divergence(count: int) -> None:
    """To the allocation that maximises int f log p_a, from any start, never going down on the way."""
    toy = smooth() if count == 2 else bumps(3, seed=1)

    def likelihood(a: np.ndarray) -> float:
        return float((toy.f * np.log(toy.p @ a)).mean())

    best = minimize(
        lambda a: -likelihood(a),
        np.full(count, 1.0 / count),
        bounds=[(1e-6, 1.0)] * count,
        constraints={"type": "eq", "fun": lambda a: a.sum() - 1.0},
        tol=1e-14,
    ).x
    assert best.min() > 0.05
    a = np.append(np.full(count - 1, 0.05), 1.0 - 0.05 * (count - 1))
    reached = [likelihood(a)]
    for _ in range(400):
        a = step(posterior_of(toy, a)[None], a[None], 0.0)[0]
        reached.append(likelihood(a))
    assert a == pytest.approx(best, abs=2e-3)
    assert (np.diff(reached) > -1e-6).all()


def test_a_mixture_that_equals_the_integrand_is_found() -> None:
    """There it agrees with the least variance, which is 0."""
    p = smooth().p
    toy = Toy(p @ (0.3, 0.7), p)
    a = np.array([0.6, 0.4])
    for _ in range(200):
        a = step(posterior_of(toy, a)[None], a[None], 0.0)[0]
    assert a == pytest.approx([0.3, 0.7], abs=1e-3)
    assert toy.variance(a) < 1e-5


def test_perfect_strategy_is_found_at_once() -> None:
    """The other one draws nothing of the integrand: it claims nothing and has its least share after a step."""
    toy = perfect()
    stepped = step(posterior_of(toy, np.array([0.5, 0.5]))[None], [[0.5, 0.5]], 0.1)
    assert stepped[0] == pytest.approx([0.9, 0.1], abs=1e-6)


def test_allocation_is_kept_where_nothing_can_be_learned() -> None:
    for case, claims in bad_moments(np.array([0.4, 0.6])).items():
        assert step(claims[None], [[0.2, 0.8]], 0.1)[0] == pytest.approx([0.2, 0.8], abs=1e-7), case
