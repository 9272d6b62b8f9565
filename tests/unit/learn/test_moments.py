"""What a sample adds to the moments: averaged over a toy by quadrature, each is the integral that its name promises."""

from __future__ import annotations

import numpy as np
import pytest
from adders import added_by_mixture, added_by_pair, grey
from toys import Toy, bumps, smooth

from warpmis.config import STRATEGIES
from warpmis.kernels.moments import CANDIDATES, Layout
from warpmis.kernels.roulette import SAFETY
from warpmis.learn.learner import Learner
from warpmis.methods import METHODS

SHARES = np.array(CANDIDATES)
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
    layout = Layout(2, ("mean", "candidates"))
    arguments = np.array([[2.0, 0.0]]), np.array([0.5, 0.5]), np.zeros(1), np.zeros(1)
    assert np.isfinite(added_by_mixture(layout, np.full((1, 3), 3e38), *arguments)).all()


@pytest.mark.parametrize("share", [0.1, 0.35, 0.9])
def test_candidates_of_mixture_samples(share: float) -> None:
    """The second moment that each candidate would have had, and the mean of its first strategy: int p_1 f / p_c."""
    toy = smooth()
    a = np.array([share, 1.0 - share])
    layout = Layout(2, ("candidates",))
    none = np.zeros(len(toy.f))
    known = part(layout, averaged(toy, a, ("candidates",), none, none), "candidates", 18).reshape(9, 2)
    assert known[:, 0] == pytest.approx([toy.second_moment((c, 1.0 - c)) for c in SHARES], rel=1e-6)
    first = [(toy.p[:, 0] * toy.f / (toy.p @ (c, 1.0 - c))).mean() for c in SHARES]
    assert known[:, 1] == pytest.approx(first, rel=1e-6)


# ---- pairs of next-event estimation ---------------------------------------------------------------------------------


def pair_toy() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Direct light, met by the lights' density alone, and indirect light everywhere; p of (BSDF, lights)."""
    x = (np.arange(60) + 0.5) / 60
    bsdf = 0.4 + 1.2 * x
    light = np.where(x < 0.3, 1.0, 0.0) * (1.0 + x)
    p = np.stack([bsdf / bsdf.mean(), light / light.mean()], axis=1)
    direct = np.where(x < 0.3, 2.0 + np.sin(9.0 * x), 0.0)
    return direct, 0.5 + 0.4 * np.cos(5.0 * x), p


AUTO = Layout(2, METHODS["auto"].statistics)


@pytest.fixture(scope="module")
def paired() -> np.ndarray:
    """Expectations of what a pair adds: every pair of cells, weighted by its probability."""
    return added_by_pairs(late=0.0, throughput=1.0)


def added_by_pairs(late: float, throughput: float) -> np.ndarray:
    """late: the part of the indirect light that is found after Russian roulette."""
    direct, indirect, p = pair_toy()
    n = len(direct)
    total = p.sum(axis=1)
    # A light sample that p_light cannot draw has weight 0; both directions in every combination.
    light, bsdf = (cells.ravel() for cells in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    weight = p[light, 1] * p[bsdf, 0] / n**2
    s = p[:, 0] / total
    beyond = (indirect / p[:, 0])[bsdf]
    added = added_by_pair(
        AUTO, grey((direct / total)[light]), s[light], grey((direct / total)[bsdf]), grey(beyond), grey(late * beyond),
        np.full(n * n, throughput), s[bsdf], 1.0 + 0.01 * bsdf, 0.02 * bsdf, light < 30,
    )  # fmt: skip
    return weight @ added


def test_pairs_tell_their_own_moments(paired: np.ndarray) -> None:
    direct, indirect, p = pair_toy()
    total = p.sum(axis=1)
    of_bsdf = direct / total + indirect / p[:, 0]
    cost = 0.01 * (p[:, 0] * np.arange(60)).mean()
    expected = [1.0, 1.0 + cost, 2.0 * cost, p[:30, 1].sum() / 60]
    assert part(AUTO, paired, "pair", 4) == pytest.approx(expected, rel=1e-5)
    mean = (direct + indirect).mean()
    light, light2 = (p[:, 1] * direct / total).mean(), (p[:, 1] * (direct / total) ** 2).mean()
    bsdf, bsdf2 = (p[:, 0] * of_bsdf).mean(), (p[:, 0] * of_bsdf**2).mean()
    second = light2 + bsdf2 + 2.0 * light * bsdf
    assert part(AUTO, paired, "mean", 2) == pytest.approx([mean, second], rel=1e-5)


def test_pairs_of_paths_that_end_before_the_vertex_do_not_count() -> None:
    none = np.zeros(1)
    added = added_by_pair(AUTO, grey(none), none, *[grey(none)] * 3, none, none, none, none, none)
    assert part(AUTO, added[0], "pair", 4) == pytest.approx([0.0] * 4)


def test_candidates_of_pairs(paired: np.ndarray) -> None:
    """The same as of samples of any mixture, though no sample was drawn from one."""
    direct, indirect, p = pair_toy()
    toy = Toy(direct + indirect, p)
    known = part(AUTO, paired, "candidates", 18).reshape(9, 2)
    assert known[:, 0] == pytest.approx([toy.second_moment((c, 1.0 - c)) for c in SHARES], rel=1e-5)
    first = [(p[:, 0] * toy.f / (p @ (c, 1.0 - c))).mean() for c in SHARES]
    assert known[:, 1] == pytest.approx(first, rel=1e-5)


# ---- light found after Russian roulette -----------------------------------------------------------------------------


def survival(throughput: np.ndarray | float) -> np.ndarray:
    return np.minimum(float(SAFETY) * np.asarray(throughput), 1.0)


@pytest.mark.parametrize("throughput", [0.2, 0.7, 1.3])
def test_late_light_of_mixture_samples(throughput: float) -> None:
    """Every cell sends on the same light, which survives roulette or not: its second moment under each candidate, with
    the throughput and the odds that it would have had there."""
    toy = smooth()
    a = np.array([0.4, 0.6])
    density = toy.p @ a
    at_roulette = throughput / density  # of a path drawn with the density of 1
    late = toy.f / density / survival(at_roulette)  # of a path that lives
    odds = survival(at_roulette)
    layout = Layout(2, ("candidates",))
    none = np.zeros(len(toy.f))
    rows = [
        added_by_mixture(layout, grey(late)[i : i + 1], toy.quotients(a)[i : i + 1], a, none[:1], none[:1],
                         grey(late)[i : i + 1], at_roulette[i])[0]
        for i in range(0, len(toy.f), 25)
    ]  # fmt: skip
    known = (density * odds)[::25] @ np.array(rows) / len(rows)
    for k, c in enumerate(SHARES):
        other = toy.p @ (c, 1.0 - c)
        second = (toy.f / other) ** 2 / survival(throughput / other) * other
        assert part(layout, known, "candidates", 18)[2 * k] == pytest.approx(second[::25].mean(), rel=1e-4)


@pytest.mark.parametrize("throughput", [0.01, 0.4, 5.0])
def test_late_light_of_pairs(throughput: float) -> None:
    """Of all indirect light half is found late, as an amplitude: that part of its second moment answers otherwise."""
    _, indirect, p = pair_toy()
    none, half = (added_by_pairs(late, throughput) for late in (0.0, 0.5))
    change = (part(AUTO, half, "candidates", 18) - part(AUTO, none, "candidates", 18)).reshape(9, 2)
    of_bsdf = 0.5 * indirect / p[:, 0]
    for k, c in enumerate(SHARES):
        ratio = p @ (c, 1.0 - c) / p[:, 0]
        response = survival(throughput) / survival(throughput / ratio) / ratio
        expected = (p[:, 0] * of_bsdf**2 * (response - 1.0 / ratio)).mean()
        assert change[k] == pytest.approx([expected, 0.0], rel=1e-3, abs=1e-6)


# ---- where everything stands ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("count", [2, 3, 8])
@pytest.mark.parametrize("method", [name for name, method in METHODS.items() if method.learns])
def test_layout_has_every_number_once(method: str, count: int) -> None:
    layout = Layout(count, METHODS[method].statistics)
    sizes = {"mean": 2, "posterior": count, "candidates": 18, "cost": count, "pair": 4}
    at = count + count * (count + 1) // 2
    for name in METHODS[method].statistics:
        assert layout.offset(name) == at
        at += sizes[name]
    assert layout.size == at
    absent = set(sizes) - set(METHODS[method].statistics)
    assert all(layout.offset(name) == -1 for name in absent)


def test_powers_of_radiance() -> None:
    """Radiance doubled doubles or quadruples every entry as `power` says, of mixtures and of pairs."""
    rng = np.random.default_rng(2)
    q = np.array([[1.6, 0.4]])
    layout = Layout(2, ("mean", "posterior", "candidates", "cost"))
    F = rng.random((1, 3))
    rest = (q, np.array([0.5, 0.5]), np.ones(1), np.ones(1))
    once, twice = (added_by_mixture(layout, scale * F, *rest, 0.5 * scale * F)[0] for scale in (1.0, 2.0))
    assert [layout.power(k) for k in range(layout.size)] == np.log2(twice / once).round(3).tolist()
    assert layout.power(layout.size - 1) == 0

    light, direct, indirect = rng.random((3, 1, 3))
    s, one = np.full(1, 0.4), np.ones(1)
    once, twice = (
        added_by_pair(AUTO, k * light, s, k * direct, k * indirect, 0.5 * k * indirect, one, s, one, one, one)[0]
        for k in (1.0, 2.0)
    )
    assert [AUTO.power(k) for k in range(5, AUTO.size)] == np.log2(twice[5:] / once[5:]).round(3).tolist()


@pytest.mark.parametrize(("method", "bytes_a_pixel"), [("murray20", 352), ("pooled", 368), ("cost-aware", 432)])
def test_memory_of_eight_strategies(method: str, bytes_a_pixel: int) -> None:
    """8 bytes for each of the 8 + 36 moments, and for the method's 0, 2 or 2 + 8 statistics."""
    layout = Layout(8, METHODS[method].statistics)
    assert 8 * layout.size == bytes_a_pixel
    learner = Learner(METHODS[method], STRATEGIES, (6, 4), True, "cpu")
    assert learner.moments.numpy().nbytes == 6 * 4 * bytes_a_pixel
