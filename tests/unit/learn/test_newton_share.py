"""Newton in one variable: Lu et al.'s closed form, Sbert et al.'s iteration, a twin in NumPy, cases worked by hand."""

from __future__ import annotations

import numpy as np
import pytest
from toys import Toy, bad_moments, perfect, random_moments, smooth, solve, sums

from warpmis.kernels.moments import Layout
from warpmis.learn.newton_share import make_newton_share

LAYOUT = Layout(2)


def step(moments: np.ndarray, allocation: np.ndarray, low: float = 0.1, high: float = 0.9) -> np.ndarray:
    return solve(make_newton_share(LAYOUT), LAYOUT.vec, moments, allocation, low, high)


def iterates(toy: Toy, share: float, steps: int, low: float = 0.1, high: float = 0.9) -> list[float]:
    shares = []
    for _ in range(steps):
        ((share, _),) = step(toy.moments((share, 1.0 - share))[None], [[share, 1.0 - share]], low, high)
        shares.append(share)
    return shares


@pytest.mark.parametrize(("low", "high"), [(0.25, 0.75), (0.1, 0.9)])
def test_equals_numpy_twin(low: float, high: float) -> None:
    """alpha - V' / V'' straight from the samples."""
    F2, q, a = random_moments(2, pixels=300, seed=1)
    r = q[..., 0] - q[..., 1]
    twin = np.clip(a[:, 0] + (F2 * r).mean(axis=1) / (2.0 * (F2 * r * r).mean(axis=1)), low, high)
    stepped = step(sums(F2, q), a, low, high)
    assert np.abs(stepped[:, 0] - twin).max() < 1e-6
    assert np.abs(stepped.sum(axis=1) - 1.0).max() < 1e-6
    # The cases must not all end on a bound, or the step itself would go untested.
    assert ((twin > low) & (twin < high)).mean() > 0.5
    assert (twin == low).any() and (twin == high).any()


def test_closed_form_of_one_step_from_a_half() -> None:
    """Lu et al.'s: from 1/2, q_s = 2 p_s / (p_1 + p_2), so alpha = 1/2 + sum(F^2 d) / (4 sum(F^2 d^2)) for
    d = (p_1 - p_2) / (p_1 + p_2), here of three samples worked by hand.

    d = 1/2, -1/3, 0 with F^2 = 1, 2, 5: sum(F^2 d) = -1/6 and sum(F^2 d^2) = 1/4 + 2/9 = 17/36, so
    alpha = 1/2 - (1/6) / (17/9) = 1/2 - 3/34.
    """
    d = np.array([0.5, -1.0 / 3.0, 0.0])
    q = np.stack([1.0 + d, 1.0 - d], axis=1)[None]
    stepped = step(sums(np.array([[1.0, 2.0, 5.0]]), q), [[0.5, 0.5]], 0.25, 0.75)
    assert stepped[0] == pytest.approx([0.5 - 3.0 / 34.0, 0.5 + 3.0 / 34.0], abs=1e-7)


@pytest.mark.parametrize(("first", "expected"), [(0, 0.75), (1, 0.25)])
def test_one_step_towards_a_perfect_strategy(first: int, expected: float) -> None:
    toy = Toy(perfect().f, perfect().p[:, ::-1] if first else perfect().p)
    assert iterates(toy, 0.5, 1, 0.25, 0.75) == pytest.approx([expected], abs=1e-6)
    assert iterates(toy, 0.5, 1, 0.3, 0.7) == pytest.approx([np.clip(expected, 0.3, 0.7)], abs=1e-6)


def test_perfect_strategy_is_approached_by_half_steps_until_the_clamp() -> None:
    """M2 = c / a, whose Newton step is a - (-c / a^2) / (2 c / a^3) = 1.5 a."""
    assert iterates(perfect(), 0.5, 3) == pytest.approx([0.75, 0.9, 0.9], abs=1e-6)
    assert iterates(perfect(), 0.2, 3) == pytest.approx([0.3, 0.45, 0.675], abs=1e-6)


@pytest.mark.parametrize("start", [0.3, 0.5, 0.7])
def test_two_steps_find_the_minimum_of_a_smooth_toy(start: float) -> None:
    """To 5e-3 after two steps and to the grid's 1e-4 after three, as quadratic convergence has it; then it stays."""
    best = smooth().best()
    assert 0.15 < best < 0.85
    shares = iterates(smooth(), start, 6)
    assert shares[1] == pytest.approx(best, abs=5e-3)
    assert shares[2:] == pytest.approx([best] * 4, abs=1e-4)


def test_without_the_factor_two_it_swings_for_ever() -> None:
    """Half the Hessian doubles every step: close to the optimum a* the error becomes -1 times itself.

    The moments h_st are halved on their way to the kernel, which is what a Hessian without the 2 would read.
    """

    def swing(share: float, factor: float) -> float:
        moments = toy.moments((share, 1.0 - share))
        moments[2:] *= factor
        return float(step(moments[None], [[share, 1.0 - share]])[0, 0])

    toy = smooth()
    best = toy.best()
    for factor, settles in ((1.0, True), (0.5, False)):
        share = best + 0.1
        errors = []
        for _ in range(12):
            share = swing(share, factor)
            errors.append(share - best)
        assert (abs(errors[-1]) < 2e-4) == settles
        if not settles:
            assert np.abs(errors).min() > 0.02
            assert (np.sign(errors[1:]) == -np.sign(errors[:-1])).all()


GOOD = smooth().moments((0.3, 0.7))


@pytest.mark.parametrize("case", bad_moments(GOOD))
def test_allocation_is_kept_where_nothing_can_be_learned(case: str) -> None:
    assert step(bad_moments(GOOD)[case][None], [[0.3, 0.7]])[0] == pytest.approx([0.3, 0.7], abs=1e-7)


def test_equal_densities_keep_the_allocation() -> None:
    assert step(np.full((1, 5), 4.0), [[0.3, 0.7]])[0] == pytest.approx([0.3, 0.7], abs=1e-7)


@pytest.mark.parametrize("scale", [1e-60, 1e60])
def test_step_does_not_depend_on_the_unit_of_radiance(scale: float) -> None:
    F2, q, a = random_moments(2, pixels=20, seed=9)
    assert step(sums(F2, q) * scale, a) == pytest.approx(step(sums(F2, q), a), abs=1e-6)
