"""Newton on the simplex: against brute force over all active sets, and what it converges to."""

from __future__ import annotations

from itertools import chain, combinations

import numpy as np
import pytest
from toys import Toy, bad_moments, bumps, filled, perfect, random_moments, smooth, solve, sums

from warpmis.kernels.moments import Layout
from warpmis.learn.newton_seed import make_newton_seed
from warpmis.learn.newton_simplex import make_newton_simplex

PLAIN = ("mean",)
COSTLY = ("mean", "cost")


def step(moments: np.ndarray, allocation: np.ndarray, least: float, statistics: tuple[str, ...] = PLAIN) -> np.ndarray:
    layout = Layout(np.shape(allocation)[1], statistics)
    return solve(make_newton_simplex(layout), layout.relative_vec, moments, allocation, least)


def vectors(F2: np.ndarray, q: np.ndarray) -> np.ndarray:
    """What pooling hands over, per sample."""
    layout = Layout(q.shape[-1], PLAIN)
    rows = zip(sums(F2, q) / F2.shape[1], F2.mean(axis=1), strict=True)
    return np.array([filled(layout, moments=moments, mean=[1.0, second]) for moments, second in rows])


def model(F2: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """m, h and M2 of one pixel's samples, rounded as the solver reads them."""
    count = q.shape[1]
    known = vectors(F2[None], q[None])[0].astype(np.float32).astype(np.float64)
    h = np.zeros((count, count))
    h[np.triu_indices(count)] = known[count : count + count * (count + 1) // 2]
    return known[:count], h + np.triu(h, 1).T, known[-1]


def taylor(m: np.ndarray, h: np.ndarray, second: float, a: np.ndarray) -> float:
    """Second-order model of E[F^2 p_b / p_a] from samples of p_b: 1 / x about 1 at x = p_a / p_b."""
    return float(3.0 * second - 3.0 * m @ a + a @ h @ a)


def brute_force(F2: np.ndarray, q: np.ndarray, least: float, price: np.ndarray | float = 0.0) -> np.ndarray:
    """argmin of the model + price . a where a >= least and sum a = 1: the best feasible one of all choices of which
    shares are on the bound, each by the equations of Lagrange."""
    count = q.shape[1]
    m, h, _ = model(F2, q)
    linear = 3.0 * m - price
    best, chosen = np.inf, np.full(count, np.nan)
    for free in map(list, chain.from_iterable(combinations(range(count), n) for n in range(1, count + 1))):
        fixed = [s for s in range(count) if s not in free]
        n = len(free)
        system = np.zeros((n + 1, n + 1))
        system[:n, :n] = 2.0 * h[np.ix_(free, free)]
        system[:n, n] = system[n, :n] = 1.0
        right = np.append(linear[free] - 2.0 * h[np.ix_(free, fixed)].sum(axis=1) * least, 1.0 - least * len(fixed))
        a = np.full(count, least)
        a[free] = np.linalg.solve(system, right)[:n]
        value = a @ h @ a - linear @ a
        if a.min() >= least - 1e-12 and value < best:
            best, chosen = value, a
    return chosen


@pytest.mark.parametrize("count", [2, 3, 5, 8])
def test_finds_what_brute_force_over_active_sets_finds(count: int) -> None:
    """The model's least value to 1e-6 of it, wherever the step begins."""
    F2, q, a = random_moments(count, pixels=60, seed=count)
    least = 0.2 / count
    stepped = step(vectors(F2, q), a, least)
    assert np.abs(stepped.sum(axis=1) - 1.0).max() < 1e-6
    assert stepped.min() >= least - 1e-7
    expected = np.array([brute_force(*sample, least) for sample in zip(F2, q, strict=True)])
    models = [model(*sample) for sample in zip(F2, q, strict=True)]
    gaps = [taylor(*models[i], stepped[i]) / taylor(*models[i], expected[i]) - 1.0 for i in range(len(F2))]
    assert np.max(gaps) < 1e-6
    assert np.abs(stepped - expected).max() < 1e-4
    # Both kinds of solution are among them.
    on_bound = np.isclose(expected, least, atol=1e-6).any(axis=1)
    assert on_bound.sum() > 5
    assert count > 5 or (~on_bound).sum() > 5


def test_inside_it_is_the_published_newton_step() -> None:
    F2, q, a = random_moments(3, pixels=200, seed=4)
    newton = solve(make_newton_seed(Layout(3)), Layout(3).vec, sums(F2, q), a, 0.0, 1.0)
    inside = (newton > 0.06).all(axis=1)
    assert inside.sum() > 20
    assert np.abs(step(vectors(F2, q), a, 0.05) - newton)[inside].max() < 1e-4


def test_perfect_strategy_is_approached_by_half_steps_until_the_bound() -> None:
    """M2 = c / a, whose Newton step is 1.5 a."""
    share, shares = 0.5, []
    for _ in range(3):
        toy = perfect()
        a = (share, 1.0 - share)
        known = filled(Layout(2, PLAIN), moments=toy.moments(a), mean=[1.0, toy.second_moment(a)])
        share = step(known[None], [a], 0.1)[0, 0]
        shares.append(share)
    assert shares == pytest.approx([0.75, 0.9, 0.9], abs=1e-6)


@pytest.mark.parametrize("count", [2, 3, 5])
def test_steps_converge_to_the_least_variance(count: int) -> None:
    """Where the conditions of optimality hold: m_s = M2 for shares off the bound, and not more for those on it."""
    toy = smooth() if count == 2 else bumps(count, seed=1)
    a = np.full((1, count), 1.0 / count)
    least = 0.02
    for _ in range(10):
        moments = filled(Layout(count, PLAIN), moments=toy.moments(a[0]), mean=[1.0, toy.second_moment(a[0])])
        a = step(moments[None], a, least)
    m = toy.moments(a[0])[:count]
    off = a[0] > least + 1e-4
    level = m[off].mean()
    assert m[off] == pytest.approx(level, rel=1e-4)
    assert (m[~off] <= level * (1.0 + 1e-4)).all()
    assert count != 5 or not off.all()


def test_moments_of_rounds_with_different_allocations_add_up() -> None:
    """The sums of two rounds are those of the sum of both models, from which both allocations have dropped out."""
    rng = np.random.default_rng(7)
    toy = bumps(3, seed=2)
    start = [(0.2, 0.3, 0.5), (0.5, 0.4, 0.1)]
    samples = []
    for a, n in zip(start, (300, 100), strict=True):
        p_a = toy.p @ a
        cells = rng.choice(len(toy.f), size=n, p=p_a / p_a.sum())
        samples.append(((toy.f[cells] / p_a[cells]) ** 2, toy.quotients(a)[cells]))
    F2, q = (np.concatenate(part) for part in zip(*samples, strict=True))
    both = sum(len(one) * vectors(one[None], two[None])[0] for one, two in samples) / len(F2)
    expected = brute_force(F2, q, 0.05)
    for a in start:
        assert step(both[None], [a], 0.05)[0] == pytest.approx(expected, abs=1e-5)
    alone = [brute_force(one, two, 0.05) for one, two in samples]
    assert min(np.abs(expected - one).max() for one in alone) > 0.005


def known_with_cost(toy: Toy, a: np.ndarray, cost: np.ndarray) -> np.ndarray:
    """Exact moments relative to the toy's integral."""
    unit = toy.integral
    return filled(
        Layout(len(a), COSTLY),
        moments=toy.moments(a) / unit**2,
        mean=[1.0, toy.second_moment(a) / unit**2],
        cost=cost,
    )


def test_cost_adds_its_price_to_the_model() -> None:
    """To first order, V c.a / (c.a now) is added: brute force with the price V / (c.a now) on every c_s."""
    toy, cost = bumps(3, seed=3), np.array([4.0, 2.0, 3.0])
    a = np.array([0.25, 0.25, 0.5])
    q, F2 = toy.quotients(a), (toy.f / (toy.p @ a) / toy.integral) ** 2
    weight = toy.p @ a  # the cells as samples: F^2 weighted by how often each is drawn
    price = toy.variance(a) / toy.integral**2 / (cost @ a) * cost
    expected = brute_force(F2 * weight, q, 0.05, price)
    stepped = step(known_with_cost(toy, a, cost)[None], a[None], 0.05, COSTLY)[0]
    assert stepped == pytest.approx(expected, abs=1e-5)
    assert np.abs(expected - brute_force(F2 * weight, q, 0.05)).max() > 0.02


@pytest.mark.parametrize("cost", [(1.0, 2.0), (2.0, 1.0)])
def test_steps_with_cost_converge_to_the_least_variance_times_cost(cost: tuple[float, float]) -> None:
    plain = smooth()
    toy = Toy(plain.f * (1.0 + 0.3 * np.sin(np.arange(len(plain.f)))), plain.p)  # a variance that no shares can lower
    grid = np.linspace(0.1, 0.9, 8001)
    product = [toy.variance((g, 1.0 - g)) * (cost[0] * g + cost[1] * (1.0 - g)) for g in grid]
    best = grid[np.argmin(product)]
    assert 0.11 < best < 0.89 and abs(best - toy.best()) > 0.02
    a = np.array([[0.5, 0.5]])
    for _ in range(20):
        a = step(known_with_cost(toy, a[0], np.array(cost))[None], a, 0.1, COSTLY)
    assert a[0, 0] == pytest.approx(best, abs=5e-4)


def test_equal_densities_leave_the_choice_to_cost() -> None:
    """No curvature: without cost the allocation stays, with it all goes to the cheapest."""
    moments = np.concatenate([np.full(9, 4.0), [1.0, 4.0]])
    start = [[0.2, 0.3, 0.5]]
    assert step(moments[None], start, 0.05)[0] == pytest.approx(start[0], abs=1e-6)
    costly = np.append(moments, [3.0, 2.0, 5.0])
    assert step(costly[None], start, 0.05, COSTLY)[0] == pytest.approx([0.05, 0.9, 0.05], abs=1e-6)


def test_allocation_is_kept_where_nothing_can_be_learned() -> None:
    start = np.array([0.2, 0.3, 0.5])
    toy = bumps(3, seed=1)
    for good, statistics in (
        (known_with_cost(toy, start, np.array([2.0, 3.0, 2.0]))[:-3], PLAIN),
        (known_with_cost(toy, start, np.array([2.0, 3.0, 2.0])), COSTLY),
    ):
        for case, moments in bad_moments(good).items():
            stepped = step(moments[None], start[None], 0.05, statistics)[0]
            assert stepped == pytest.approx(start, abs=1e-6), case
