"""Properties that hold for any input, tried by Hypothesis: solvers, samplers' inverses, merging of films.

Derandomised: the same examples at every run, so a test that passes keeps passing.
"""

from functools import cache
from typing import Any

import numpy as np
import pytest
import warp as wp
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from numpy.typing import NDArray
from toys import filled, solve, sums

from warpmis.device.environment import index_of
from warpmis.film.film import Film
from warpmis.kernels.light.dome import upper_bound, upper_bound_by_index
from warpmis.kernels.moments import Layout
from warpmis.kernels.strategies import make_strategies
from warpmis.learn.expectation import make_expectation
from warpmis.learn.newton_seed import make_newton_seed
from warpmis.learn.newton_share import make_newton_share
from warpmis.learn.newton_simplex import make_newton_simplex
from warpmis.scene.features import Features

FloatArray = NDArray[np.float64]

many = settings(derandomize=True, deadline=None, max_examples=100, database=None)

LOW, HIGH = 0.1, 0.9
LEAST = 0.05


# ---- solvers --------------------------------------------------------------------------------------------------------


@st.composite
def samples(draw: st.DrawFn, count: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """F^2, shape (n,), from 1e-60 to 1e+60 or 0; q, shape (n, S), of densities 0 to 1e6; shares, shape (S,)."""
    n = draw(st.integers(1, 6))
    exponents = draw(arrays.arrays(float, n, elements=st.floats(-60.0, 60.0)))
    found = draw(arrays.arrays(bool, n))
    a = draw(arrays.arrays(float, count, elements=st.floats(LOW, 1.0)))
    a = (a / a.sum()).astype(np.float32).astype(float)
    density = st.one_of(st.just(0.0), st.floats(1e-6, 1e6, allow_subnormal=False))
    p = draw(arrays.arrays(float, (n, count), elements=density))
    p[p.sum(axis=1) == 0.0] = 1.0
    return np.where(found, 10.0**exponents, 0.0), p / (p @ a)[:, None], a


def step(name: str, F2: FloatArray, q: FloatArray, a: FloatArray) -> FloatArray:
    """The shares after one step of the named solver from the samples' sums, relative where pooling makes them so."""
    if name == "newton_simplex" and F2.any():
        F2 = F2 / F2.mean()
    moments = sums(F2[None], q[None])[0]
    count = len(a)
    if name == "newton_simplex":
        layout = Layout(count, ("mean",))
        known = filled(layout, moments=moments, mean=[np.sqrt(F2).sum(), F2.sum()])
        return solve(make_newton_simplex(layout), layout.relative_vec, known[None], a[None], LEAST)[0]
    if name == "expectation":
        layout = Layout(count, ("posterior",))
        known = filled(layout, moments=moments, posterior=a * (np.sqrt(F2) @ q))
        return solve(make_expectation(layout), layout.vec, known[None], a[None], LEAST)[0]
    make = {"newton_seed": make_newton_seed, "newton_share": make_newton_share}[name]
    return solve(make(Layout(count)), Layout(count).vec, moments[None], a[None], LOW, HIGH)[0]


def model(F2: FloatArray, q: FloatArray, a: FloatArray) -> float:
    """Second-order model of the second moment at the shares a, about those that the samples were drawn with."""
    x = q @ a - 1.0
    return float((F2 * (1.0 - x + x * x)).sum())


# Two strategies are clamped. For three newton_seed keeps 0.01 of each before it scales the first two, which a step has
# moved by at most 2 each, to a sum of at most HIGH.
FLOORS = {("newton_share", 2): LOW, ("newton_seed", 2): LOW, ("newton_seed", 3): 0.01 * HIGH / 5.0}
STEPS = [("newton_share", 2), ("newton_seed", 2), ("newton_seed", 3), ("newton_simplex", 3), ("expectation", 3)]


@pytest.mark.parametrize(("name", "count"), STEPS)
def test_shares_stay_on_the_simplex(name: str, count: int) -> None:
    @many
    @given(samples(count))
    def check(sample: tuple[FloatArray, FloatArray, FloatArray]) -> None:
        F2, q, a = sample
        shares = step(name, F2, q, a)
        assert np.isfinite(shares).all()
        assert shares.min() >= min(FLOORS.get((name, count), LEAST), a.min()) - 1e-6
        assert abs(shares.sum() - 1.0) < 1e-6
        if not F2.any():
            assert (shares == a).all()

    check()


@pytest.mark.parametrize(("name", "count"), STEPS)
def test_the_unit_of_radiance_does_not_matter(name: str, count: int) -> None:
    @many
    @given(samples(count), st.integers(-150, 150))
    def check(sample: tuple[FloatArray, FloatArray, FloatArray], power: int) -> None:
        F2, q, a = sample
        assert (step(name, F2 * 4.0**power, q, a) == step(name, F2, q, a)).all()

    check()


@pytest.mark.parametrize(("name", "count"), [("newton_share", 2), ("newton_seed", 2), ("newton_simplex", 3)])
def test_a_step_never_raises_its_model(name: str, count: int) -> None:
    """Where the start is within the bounds; newton_seed for more strategies clamps as published, whatever it costs."""

    @many
    @given(samples(count))
    def check(sample: tuple[FloatArray, FloatArray, FloatArray]) -> None:
        F2, q, a = sample
        bounds = (LOW, HIGH) if count == 2 else (LEAST, 1.0)
        if a.min() >= bounds[0] and a.max() <= bounds[1] and F2.any():
            now = model(F2, q, a)
            assert model(F2, q, step(name, F2, q, a)) <= now * (1.0 + 1e-5)

    check()


# ---- samplers' inverses ---------------------------------------------------------------------------------------------


@cache
def chooser(count: int) -> wp.Kernel:
    strategies = make_strategies(
        Features(strategies=("bsdf", "light", "uniform", "cosine", "area")[:count]), None, None
    )
    choose = strategies.choose
    vec_s = strategies.vec_s

    @wp.kernel(module="unique", enable_backward=False)
    def chosen(allocation: vec_s, u: wp.array(dtype=float), out: wp.array(dtype=int)):
        i = wp.tid()
        out[i] = choose(allocation, u[i])

    return chosen


NUMBERS = st.one_of(st.just(0.0), st.just(1.0 - 2.0**-24), st.integers(0, 2**24 - 1).map(lambda k: k * 2.0**-24))


@many
@given(
    arrays.arrays(float, 4, elements=st.one_of(st.just(0.0), st.floats(1e-6, 1.0))),
    st.sampled_from([1.0, 1.0 - 3e-7]),
    st.lists(NUMBERS, min_size=1),
)
def test_choice_inverts_the_cumulated_shares(weights: FloatArray, total: float, numbers: list[float]) -> None:
    """What is chosen has a share, and the number lies in its part of the unit interval; rounded shares may sum to less
    than 1."""
    if weights.sum() == 0.0:
        weights = np.ones(4)
    shares = (total * weights / weights.sum()).astype(np.float32)
    u = wp.array(np.array(numbers, dtype=np.float32), dtype=float, device="cpu")
    out = wp.zeros(len(numbers), dtype=int, device="cpu")
    kernel = chooser(4)
    wp.launch(kernel, dim=len(numbers), inputs=[wp.types.vector(4, wp.float32)(*shares.tolist()), u, out], device="cpu")
    ends = np.concatenate([[0.0], np.cumsum(shares.astype(float))])
    for number, strategy in zip(numbers, out.numpy(), strict=True):
        assert shares[strategy] > 0.0
        assert ends[strategy] - 1e-6 <= number
        # Rounding may leave the last part short of 1: what is beyond is the last one's that has a share.
        assert number <= ends[strategy + 1] + 1e-6


@wp.kernel(module="unique", enable_backward=False)
def bounds(
    cdf: wp.array2d(dtype=float), index: wp.array2d(dtype=int), u: wp.array(dtype=float), out: wp.array2d(dtype=int)
):
    i = wp.tid()
    out[i, 0] = upper_bound(cdf[0], 0, cdf.shape[1], u[i])
    out[i, 1] = upper_bound_by_index(cdf, index, 0, u[i])


@many
@given(
    arrays.arrays(float, st.integers(1, 40), elements=st.one_of(st.just(0.0), st.floats(1e-12, 1e12))),
    st.lists(NUMBERS, min_size=1),
)
def test_bisection_inverts_a_cumulative_distribution(weights: FloatArray, numbers: list[float]) -> None:
    """cdf[i - 1] <= u < cdf[i]: never an entry of weight 0, as device/environment.py makes the tables; by index too."""
    if weights.sum() == 0.0:
        weights = np.ones_like(weights)
    cdf = np.cumsum(weights / weights.sum())
    cdf = (cdf / cdf[-1]).astype(np.float32)
    u = np.array(numbers, dtype=np.float32)
    out = wp.zeros((len(u), 2), dtype=int, device="cpu")
    inputs = [wp.array(cdf[None], dtype=float), wp.array(index_of(cdf[None]), dtype=int), wp.array(u, dtype=float), out]
    wp.launch(bounds, dim=len(u), inputs=inputs, device="cpu")
    begins = np.concatenate([np.zeros(1, dtype=np.float32), cdf])
    for found in out.numpy().T:
        assert ((begins[found] <= u) & (u < cdf[found])).all()


# ---- film -----------------------------------------------------------------------------------------------------------


def film_of(values: FloatArray, rejected: int = 0) -> Film:
    """A 1 x 1 film of grey samples that all hit a surface at depth 2."""
    n = len(values)
    one = np.ones((1, 1))
    mean = values.mean() if n else 0.0
    sums: dict[str, Any] = {"luminance_mean": one * mean, "luminance_m2": one * ((values - mean) ** 2).sum()}
    sums |= {name: np.full((1, 1, 3), values.sum() * part) for name, part in (("color", 1.0), ("albedo", 0.5))}
    return Film(
        count=np.array([[n]]),
        rejected=np.array([[rejected]]),
        hits=np.array([[n]]),
        normal=np.full((1, 1, 3), float(n)),
        depth=2.0 * n * one,
        alpha=n * one,
        **sums,
    )


@many
@given(st.lists(st.lists(st.floats(0.0, 2.0**100, width=32), max_size=8), min_size=1, max_size=6), st.randoms())
def test_films_merge_in_any_order_and_grouping(parts: list[list[float]], order: Any) -> None:
    """The film of all samples, whatever is merged first."""
    whole = film_of(np.array([value for part in parts for value in part]), rejected=len(parts))
    films = [film_of(np.array(part), rejected=1) for part in parts]
    order.shuffle(films)
    while len(films) > 1:
        first, second = films.pop(order.randrange(len(films))), films.pop(order.randrange(len(films)))
        films.append(first.merge(second))
    (merged,) = films
    for name in ("count", "rejected", "hits"):
        assert (getattr(merged, name) == getattr(whole, name)).all()
    for name in ("color", "luminance_mean", "albedo", "normal", "depth", "alpha"):
        assert getattr(merged, name) == pytest.approx(getattr(whole, name), rel=1e-12)
    largest = max([0.0, *(value for part in parts for value in part)])
    assert merged.luminance_m2 == pytest.approx(whole.luminance_m2, rel=1e-9, abs=1e-14 * largest**2)
    for picture in (merged.image(), merged.variance(), merged.mean_depth(), merged.coverage(), merged.mean_normal()):
        assert np.isfinite(picture).all()


@many
@given(arrays.arrays(float, 12, elements=st.floats(0.0, 2.0**100, width=32)))
def test_two_films_merge_alike_from_either_side(values: FloatArray) -> None:
    one, other = film_of(values[:5]), film_of(values[5:])
    for name, left in vars(one.merge(other)).items():
        assert left == pytest.approx(getattr(other.merge(one), name), rel=1e-12), name
