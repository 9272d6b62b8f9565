"""What a sample adds to the moments: averaged over a toy by quadrature, each is the integral that its name promises."""

from __future__ import annotations

import numpy as np
import pytest
from adders import added_by_mixture, grey
from toys import Toy, bumps, smooth

from warpmis.config import STRATEGIES
from warpmis.kernels.moments import Layout
from warpmis.learn.learner import Learner
from warpmis.methods import METHODS

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def part(layout: Layout, vector: np.ndarray, name: str, size: int) -> np.ndarray:
    start = layout.offset(name)
    return vector[start : start + size]


# ---- samples of the mixture -----------------------------------------------------------------------------------------

ALL = ("mean", "posterior", "cost")


def averaged(toy: Toy, a: np.ndarray, statistics: tuple[str, ...], early: np.ndarray, late: np.ndarray) -> np.ndarray:
    """Expectations over p_a of what one sample adds, without noise: every cell once, weighted by its probability."""
    layout = Layout(len(a), statistics)
    F = toy.f / (toy.p @ a)
    added = added_by_mixture(layout, grey(F), toy.quotients(a), a, early, late)
    return toy.expectation(added, a)


@pytest.mark.parametrize("count", [2, 3])
def test_moments_and_statistics_are_their_integrals(count: int) -> None:
    toy = smooth() if count == 2 else bumps(3, seed=5)
    a = np.array([0.3, 0.7] if count == 2 else [0.2, 0.3, 0.5])
    x = (np.arange(len(toy.f)) + 0.5) / len(toy.f)
    early, late = 2.0 + x, 3.0 - x**2
    layout = Layout(count, ALL)
    known = averaged(toy, a, ALL, early, late)
    first = layout.second + count * (count + 1) // 2
    assert known[:first] == pytest.approx(toy.moments(a), rel=1e-6)
    assert part(layout, known, "mean", 2) == pytest.approx([toy.integral, toy.second_moment(a)], rel=1e-6)
    # posterior: the part of the integral that falls to s, int f a_s p_s / p_a
    expected = [(toy.f * a[s] * toy.p[:, s] / (toy.p @ a)).mean() for s in range(count)]
    assert part(layout, known, "posterior", count) == pytest.approx(expected, rel=1e-6)
    # cost: of a path that s alone drew, int p_s A, and the rest as it is, int p_a B
    expected = [(toy.p[:, s] * early).mean() + ((toy.p @ a) * late).mean() for s in range(count)]
    assert part(layout, known, "cost", count) == pytest.approx(expected, rel=1e-6)


def test_moments_of_colours_are_squared_first_then_weighted() -> None:
    F = np.array([[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [1.0, 2.0, 3.0]])
    q = np.array([[2.0, 0.0], [0.5, 1.5], [1.0, 1.0]])
    layout = Layout(2, ("mean",))
    added = added_by_mixture(layout, F, q, np.array([0.5, 0.5]), np.zeros(3), np.zeros(3))
    squares = F**2 @ LUMINANCE
    assert squares[2] == pytest.approx(0.2126 + 4 * 0.7152 + 9 * 0.0722)
    expected = np.stack([squares * q[:, 0], squares * q[:, 1]], axis=1)
    assert added[:, :2] == pytest.approx(expected, rel=1e-6)
    expected = np.stack([squares * q[:, 0] ** 2, squares * q[:, 0] * q[:, 1], squares * q[:, 1] ** 2], axis=1)
    assert added[:, 2:5] == pytest.approx(expected, rel=1e-6)
    assert added[:, 5:] == pytest.approx(np.stack([F @ LUMINANCE, squares], axis=1), rel=1e-6)


def test_radiance_of_the_largest_float32_does_not_overflow() -> None:
    layout = Layout(2, ("mean", "posterior"))
    arguments = np.array([[2.0, 0.0]]), np.array([0.5, 0.5]), np.zeros(1), np.zeros(1)
    assert np.isfinite(added_by_mixture(layout, np.full((1, 3), 3e38), *arguments)).all()


# ---- where everything stands ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("count", [2, 3, 8])
@pytest.mark.parametrize("method", [name for name, method in METHODS.items() if method.learns])
def test_layout_has_every_number_once(method: str, count: int) -> None:
    layout = Layout(count, METHODS[method].statistics)
    sizes = {"mean": 2, "posterior": count, "cost": count, "between_rounds": 7, "control": 4}
    at = count + count * (count + 1) // 2
    for name in METHODS[method].statistics:
        assert layout.offset(name) == at
        at += sizes[name]
    assert layout.size == at
    absent = set(sizes) - set(METHODS[method].statistics)
    assert all(layout.offset(name) == -1 for name in absent)


def test_powers_of_radiance() -> None:
    """Radiance doubled doubles or quadruples every entry as `power` says."""
    rng = np.random.default_rng(2)
    q = np.array([[1.6, 0.4]])
    layout = Layout(2, ("mean", "posterior", "cost"))
    F = rng.random((1, 3))
    rest = (q, np.array([0.5, 0.5]), np.ones(1), np.ones(1))
    once, twice = (added_by_mixture(layout, scale * F, *rest)[0] for scale in (1.0, 2.0))
    assert [layout.power(k) for k in range(layout.size)] == np.log2(twice / once).round(3).tolist()
    assert layout.power(layout.size - 1) == 0


@pytest.mark.parametrize(("method", "bytes_a_pixel"), [("murray20", 352), ("pooled", 368), ("cost-aware", 432)])
def test_memory_of_eight_strategies(method: str, bytes_a_pixel: int) -> None:
    """8 bytes for each of the 8 + 36 moments, and for the method's 0, 2 or 2 + 8 statistics."""
    layout = Layout(8, METHODS[method].statistics)
    assert 8 * layout.size == bytes_a_pixel
    learner = Learner(METHODS[method], STRATEGIES, (6, 4), True, "cpu")
    assert learner.moments.numpy().nbytes == 6 * 4 * bytes_a_pixel
