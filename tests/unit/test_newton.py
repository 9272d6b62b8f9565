"""The Newton kernel: against a NumPy twin, and on cases worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp

from warpmis.config import MIN_SHARE
from warpmis.kernels.moments import moment_count
from warpmis.learn.newton import RIDGE, make_newton


def run_kernel(moments: np.ndarray, allocation: np.ndarray) -> np.ndarray:
    count = allocation.shape[1]
    vec_s = wp.types.vector(length=count, dtype=wp.float32)
    vec_k = wp.types.vector(length=moment_count(count), dtype=wp.float64)
    shares = wp.array(allocation.astype(np.float32), dtype=vec_s, device="cpu")
    inputs = [wp.array(moments, dtype=vec_k, device="cpu"), shares, MIN_SHARE]
    wp.launch(make_newton(count), dim=len(allocation), inputs=inputs, device="cpu")
    return shares.numpy()


def project(a: np.ndarray) -> np.ndarray:
    """Euclidean projection onto {a_s >= MIN_SHARE, sum a_s = 1}: by sorting (Held, Wolfe, Crowder 1974)."""
    scaled = (a - MIN_SHARE) / (1.0 - len(a) * MIN_SHARE)
    descending = np.sort(scaled)[::-1]
    over = (np.cumsum(descending) - 1.0) / np.arange(1, len(a) + 1)
    shift = over[np.flatnonzero(descending > over)[-1]]
    return np.maximum(scaled - shift, 0.0) * (1.0 - len(a) * MIN_SHARE) + MIN_SHARE


def newton_twin(F2: np.ndarray, q: np.ndarray, a: np.ndarray) -> np.ndarray:
    """The step straight from the samples: F2 shape (n,), q shape (n, S), a shape (S,)."""
    r = q[:, :-1] - q[:, -1:]
    gradient = -(F2[:, None] * r).mean(axis=0)
    hessian = 2.0 * np.einsum("n,ns,nt->st", F2, r, r) / len(F2)
    hessian += RIDGE * np.trace(hessian) / len(gradient) * np.eye(len(gradient))
    moved = a[:-1] - np.linalg.solve(hessian, gradient)
    return project(np.append(moved, 1.0 - moved.sum()))


def moments_of(F2: np.ndarray, q: np.ndarray) -> np.ndarray:
    rows, columns = np.triu_indices(q.shape[1])
    return np.concatenate([F2 @ q, np.einsum("n,nk->k", F2, q[:, rows] * q[:, columns])])


def random_samples(count: int, pixels: int, rng: np.random.Generator, n: int = 200):
    """F2 and q for random densities, sampled integrand and allocation; heavy-tailed like a renderer's."""
    a = rng.dirichlet(np.full(count, 3.0), size=pixels) * (1.0 - count * MIN_SHARE) + MIN_SHARE
    p = rng.gamma(1.0, size=(pixels, n, count)) ** 2
    q = p / np.einsum("ps,pns->pn", a, p)[..., None]
    return rng.lognormal(0.0, 1.5, size=(pixels, n)), q, a.astype(np.float32)


@pytest.mark.parametrize("count", [2, 3, 5])
def test_kernel_equals_numpy_twin(count: int) -> None:
    F2, q, a = random_samples(count, pixels=200, rng=np.random.default_rng(count))
    stepped = run_kernel(np.array([moments_of(*sample) for sample in zip(F2, q, strict=True)]), a)
    twin = np.array([newton_twin(*sample) for sample in zip(F2, q, a.astype(np.float64), strict=True)])
    assert np.abs(stepped - twin).max() < 1e-5
    assert np.abs(stepped.sum(axis=1) - 1.0).max() < 1e-6
    assert stepped.min() >= MIN_SHARE - 1e-6
    # The cases must not all end on the bound, or the step itself would go untested.
    assert (stepped > MIN_SHARE + 0.01).all(axis=1).mean() > 0.1


def quadrature_moments(f: np.ndarray, p: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Exact moments of a one-dimensional toy on equal cells of [0, 1]: f shape (n,), p shape (n, S)."""
    p_a = p @ a
    q = p / p_a[:, None]
    return moments_of(f**2 / p_a / len(f), q)


def test_perfect_strategy_is_approached_by_half_steps_until_the_clamp() -> None:
    """Where f is proportional to p_1, M2 = E[...] and Newton goes a -> 1.5 a from a share a: 0.5, 0.75, then 0.9.

    p_1 lives on one half of the domain, p_2 on the other: q_1 = 1 / a, q_2 = 0 where f > 0, so M2 = c / a, whose
    Newton step is a - (-c / a^2) / (2 c / a^3) = 1.5 a. Without the Hessian's factor 2 it would be 2 a.
    """
    x = np.arange(1000)
    p = np.stack([np.where(x < 500, 2.0, 0.0), np.where(x < 500, 0.0, 2.0)], axis=1)
    f = p[:, 0]
    a = np.array([[0.5, 0.5]])
    shares = []
    for _ in range(3):
        a = run_kernel(quadrature_moments(f, p, a[0].astype(np.float64))[None], a)
        shares.append(float(a[0, 0]))
    assert shares == pytest.approx([0.75, 0.9, 0.9], abs=1e-5)


def test_smooth_toy_converges_in_a_few_steps() -> None:
    """f between two overlapping densities: the minimum of M2 on a fine grid of shares is found, and stays found."""
    x = (np.arange(2000) + 0.5) / 2000
    p = np.stack([2.0 * x, np.full_like(x, 1.0)], axis=1)
    f = 0.6 * 2.0 * x + 0.4 * (0.5 + 0.5 * np.sin(3.0 * x))
    grid = np.linspace(0.1, 0.9, 8001)
    best = grid[np.argmin([(f**2 / (p @ np.array([g, 1.0 - g]))).mean() for g in grid])]
    assert 0.15 < best < 0.85
    for start in (0.1, 0.5, 0.9):
        a = np.array([[start, 1.0 - start]])
        for _ in range(8):
            a = run_kernel(quadrature_moments(f, p, a[0].astype(np.float64))[None], a)
        assert a[0, 0] == pytest.approx(best, abs=2e-4)


@pytest.mark.parametrize(
    "moments",
    [
        np.zeros(5),
        np.array([4.0, 4.0, 4.0, 4.0, 4.0]),  # equal densities: q = 1 for both
        np.full(5, np.inf),
        np.full(5, np.nan),
    ],
    ids=["no light", "equal densities", "infinite", "nan"],
)
def test_allocation_is_kept_where_nothing_can_be_learned(moments: np.ndarray) -> None:
    start = np.array([[0.3, 0.7]])
    assert run_kernel(moments[None], start) == pytest.approx(start)


@pytest.mark.parametrize("scale", [1e-60, 1.0, 1e60])
def test_step_does_not_depend_on_the_unit_of_radiance(scale: float) -> None:
    F2, q, a = random_samples(2, pixels=20, rng=np.random.default_rng(9))
    moments = np.array([moments_of(*sample) for sample in zip(F2, q, strict=True)])
    assert run_kernel(moments * scale, a) == pytest.approx(run_kernel(moments, a), abs=1e-6)
