"""Newton for any number of strategies as Murray et al. published it: against a twin in NumPy, and by hand."""

from __future__ import annotations

import numpy as np
import pytest
from toys import bad_moments, bumps, perfect, random_moments, smooth, solve, sums

from warpmis.kernels.moments import Layout
from warpmis.learn.newton_seed import LEAST, RIDGE, make_newton_seed
from warpmis.learn.newton_share import make_newton_share

LOW, HIGH = 0.1, 0.9


def step(moments: np.ndarray, allocation: np.ndarray, low: float = LOW, high: float = HIGH) -> np.ndarray:
    layout = Layout(np.shape(allocation)[1])
    return solve(make_newton_seed(layout), layout.vec, moments, allocation, low, high)


def clamped(shares: np.ndarray) -> np.ndarray:
    """All shares but the last, none below LEAST, scaled so that their sum is between LOW and HIGH; the last is what
    is left."""
    others = np.maximum(shares, LEAST)
    others = others * np.clip(others.sum(), LOW, HIGH) / others.sum()
    return np.append(others, 1.0 - others.sum())


def twin(F2: np.ndarray, q: np.ndarray, a: np.ndarray) -> np.ndarray:
    """The step straight from the samples: F2 shape (n,), q shape (n, S), a shape (S,)."""
    r = q[:, :-1] - q[:, -1:]
    gradient = -(F2[:, None] * r).mean(axis=0)
    hessian = 2.0 * np.einsum("n,ns,nt->st", F2, r, r) / len(F2)
    hessian += RIDGE * np.trace(hessian) / len(gradient) * np.eye(len(gradient))
    return clamped(a[:-1] - np.clip(np.linalg.solve(hessian, gradient), -2.0, 2.0))


@pytest.mark.parametrize("count", [3, 5])
def test_equals_numpy_twin(count: int) -> None:
    F2, q, a = random_moments(count, pixels=300, seed=count)
    stepped = step(sums(F2, q), a)
    expected = np.array([twin(*sample) for sample in zip(F2, q, a, strict=True)])
    assert np.abs(stepped - expected).max() < 1e-5
    assert np.abs(stepped.sum(axis=1) - 1.0).max() < 1e-6
    # Each bound is met in some pixels, and in some none is, or a part of the step would go untested.
    others = expected[:, :-1].sum(axis=1)
    assert (others > HIGH - 1e-9).any()
    assert (np.isclose(expected[:, :-1], LEAST).any(axis=1) & (others < HIGH - 1e-9)).any()
    assert ((expected[:, :-1] > LEAST + 1e-6).all(axis=1) & (others > LOW + 1e-3) & (others < HIGH - 1e-3)).sum() > 30


@pytest.mark.parametrize(("low", "high"), [(0.1, 0.9), (0.25, 0.75)])
def test_two_strategies_take_the_step_in_one_share(low: float, high: float) -> None:
    """newton_share with the same bounds, but for the ridge: 1e-6 of the step, at most 2."""
    F2, q, a = random_moments(2, pixels=300, seed=2)
    of_share = solve(make_newton_share(Layout(2)), Layout(2).vec, sums(F2, q), a, low, high)
    assert np.abs(step(sums(F2, q), a, low, high) - of_share).max() < 3e-6


def test_perfect_strategy_is_approached_by_half_steps_until_the_clamp() -> None:
    """M2 = c / a, whose Newton step is 1.5 a; without the Hessian's factor 2 it would be 2 a."""
    share, shares = 0.5, []
    for _ in range(3):
        share = step(perfect().moments((share, 1.0 - share))[None], [[share, 1.0 - share]])[0, 0]
        shares.append(share)
    assert shares == pytest.approx([0.75, 0.9, 0.9], abs=1e-5)


@pytest.mark.parametrize("moved", [(0.5, 0.4), (0.8, 0.3), (0.02, 0.03), (-0.4, 0.6), (-0.3, -0.2)])
def test_sum_of_all_shares_but_the_last_is_clamped(moved: tuple[float, float]) -> None:
    """Moments made by hand, h = the unit matrix in r: the step from (0.3, 0.3, 0.4) leads just to `moved`.

    With m_3 = h_s3 = 0, r_s = q_s: the gradient is -m_s and the Hessian 2 h, so the step is m_s / (2 h_ss). The unit
    is chosen so that m stays below the ridge's reach; what is negative is LEAST, then both are scaled alike.
    """
    start = np.array([0.3, 0.3, 0.4])
    m1, m2 = 2.0 * (np.array(moved) - start[:2])
    m3 = (1.0 - 0.3 * (m1 + m2)) / 0.4  # so that M2 = sum a_s m_s is 1, as for any samples
    h = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.0]])
    moments = np.concatenate([[m1 + m3, m2 + m3, m3], h[np.triu_indices(3)]])
    moments[:3] -= 0.6 * m3  # M2 is 1 again
    stepped = step(moments[None], start[None])[0]
    assert stepped == pytest.approx(clamped(np.array(moved)), abs=1e-5)
    assert LOW - 1e-6 <= stepped[:2].sum() <= HIGH + 1e-6


def test_two_of_three_shares_keep_their_proportion_at_the_clamp() -> None:
    """(0.8, 0.4): a sum of 1.2 is scaled to 0.9, which makes (0.6, 0.3) and leaves 0.1."""
    assert clamped(np.array([0.8, 0.4])) == pytest.approx([0.6, 0.3, 0.1])


@pytest.mark.parametrize("seed", range(4))
def test_finds_the_minimum_inside(seed: int) -> None:
    """Three strategies, the optimum off all bounds: steps lead to where m_s = M2 for every one."""
    toy = bumps(3, seed=seed)
    a = np.array([[0.2, 0.3, 0.5]])
    for _ in range(8):
        a = step(toy.moments(a[0])[None], a)
    assert a.min() > LEAST + 0.01 and a[0, 2] > 1.0 - HIGH + 0.01
    assert toy.moments(a[0])[:3] == pytest.approx(np.full(3, toy.second_moment(a[0])), rel=1e-4)


@pytest.mark.parametrize("count", [2, 3])
def test_allocation_is_kept_where_nothing_can_be_learned(count: int) -> None:
    start = np.linspace(1.0, 2.0, count)[None] / np.linspace(1.0, 2.0, count).sum()
    good = smooth().moments((0.3, 0.7)) if count == 2 else bumps(count, seed=1).moments(start[0])
    for case, moments in bad_moments(good).items():
        assert step(moments[None], start)[0] == pytest.approx(start[0], abs=1e-6), case


def test_equal_densities_keep_the_allocation() -> None:
    assert step(np.full((1, 9), 4.0), [[0.2, 0.3, 0.5]])[0] == pytest.approx([0.2, 0.3, 0.5], abs=1e-7)


@pytest.mark.parametrize("scale", [1e-60, 1e60])
def test_step_does_not_depend_on_the_unit_of_radiance(scale: float) -> None:
    F2, q, a = random_moments(3, pixels=20, seed=9)
    assert step(sums(F2, q) * scale, a) == pytest.approx(step(sums(F2, q), a), abs=1e-6)
