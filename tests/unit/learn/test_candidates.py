"""The best of nine shares and next-event estimation: predicted variances against quadrature, and what is chosen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray
from toys import Toy, bad_moments, filled, perfect, smooth

from warpmis.kernels.moments import CANDIDATES, SHADOW_RAY_COST, Layout
from warpmis.learn.allocation import Allocation
from warpmis.learn.candidates import LIGHT_COST, make_candidates
from warpmis.methods import METHODS

SHARES = np.array(CANDIDATES)
MIXTURE = Layout(2, METHODS["accumulated"].statistics)
PAIRS = Layout(2, METHODS["auto"].statistics)

# So much more variance that a candidate is not chosen.
HOPELESS = 1e6


@dataclass
class Chosen:
    """The share of the first strategy and of the second, whether next-event estimation was better, and the variance and
    cost that were predicted."""

    shares: np.ndarray
    is_next_event: bool
    variance: float
    cost: float


def choose(layout: Layout, moments: np.ndarray, *, stratified: bool = True, weight: float = 0.0) -> Chosen:
    allocation = Allocation.of(np.float32([[0.35, 0.65]]), "pair" in layout.statistics, "cpu")
    known = wp.array(moments[None], dtype=layout.relative_vec, device="cpu")
    efficiency = wp.zeros(1, dtype=wp.vec2, device="cpu")
    inputs = [0, known, weight, allocation.shares, allocation.estimators, efficiency]
    wp.launch(make_candidates(layout, stratified), dim=1, inputs=inputs, device="cpu")
    shares = allocation.shares.numpy()[0].astype(np.float64)
    return Chosen(shares, bool(allocation.is_next_event()[0]), *efficiency.numpy()[0])


def known_of(toy: Toy, layout: Layout = MIXTURE, **more: np.ndarray) -> np.ndarray:
    """Exact moments: of every candidate E[F'^2], and the mean of its samples from the first strategy."""
    second = np.array([toy.second_moment((c, 1.0 - c)) for c in SHARES])
    first = np.array([(toy.p[:, 0] * toy.f / (toy.p @ (c, 1.0 - c))).mean() for c in SHARES])
    candidates = np.stack([second, first], axis=1).ravel()
    mean = [toy.integral, toy.second_moment((0.5, 0.5))]
    return filled(layout, **{"mean": mean, "candidates": candidates, **more})


def only(known: np.ndarray, layout: Layout, kept: int | None) -> np.ndarray:
    """All candidates but one (None: all) made hopeless."""
    known = known.copy()
    for k in range(len(CANDIDATES)):
        if k != kept:
            known[layout.offset("candidates") + 2 * k] += HOPELESS
    return known


def two_part_toy() -> tuple[Toy, np.ndarray, np.ndarray]:
    """A toy for pairs, and its direct light (met by the second strategy) and indirect light."""
    x = (np.arange(500) + 0.5) / 500
    p = np.stack([0.4 + 1.2 * x, np.where(x < 0.3, 1.0 + x, 0.0)], axis=1)
    p /= p.mean(axis=0)
    direct = np.where(x < 0.3, 2.0 + np.sin(9.0 * x), 0.0)
    indirect = 0.5 + 0.4 * np.cos(5.0 * x)
    return Toy(direct + indirect, p), direct, indirect


# Of pairs: paths that came to the vertex, their cost before and after Russian roulette, light samples that count.
REACHED, EARLY, LATE, ALIVE = 0.9, 3.5, 1.5, 0.6
COST_OF_PAIR = EARLY + LATE + SHADOW_RAY_COST * ALIVE


def cost_of_mixture(share: NDArray[np.float64] | float) -> NDArray[np.float64] | float:
    """A path to the vertex, one on from it for each direction that counts, and the late part that no share changes."""
    by_lights = ALIVE / REACHED * LIGHT_COST
    return REACHED + (EARLY - REACHED) * (share + (1.0 - share) * by_lights) + LATE


def known_of_pairs() -> np.ndarray:
    toy = two_part_toy()[0]
    mean = [toy.integral, next_event_variance() + toy.integral**2]
    return known_of(toy, PAIRS, mean=mean, pair=[REACHED, EARLY, LATE, ALIVE])


def next_event_variance() -> float:
    """Of the sum of both samples, over all pairs of cells, with no use of their being independent."""
    toy, direct, indirect = two_part_toy()
    both = toy.p.sum(axis=1)
    total = (direct / both)[:, None] + (direct / both + indirect / toy.p[:, 0])[None, :]
    weight = toy.p[:, 1][:, None] * toy.p[:, 0][None, :] / len(both) ** 2
    return float((weight * total**2).sum() - (weight * total).sum() ** 2)


@pytest.mark.parametrize("stratified", [True, False])
@pytest.mark.parametrize("kept", range(len(CANDIDATES)))
def test_predicted_variance_of_each_candidate(kept: int, stratified: bool) -> None:
    toy = smooth()
    chosen = choose(MIXTURE, only(known_of(toy), MIXTURE, kept), stratified=stratified)
    shares = (SHARES[kept], 1.0 - SHARES[kept])
    assert chosen.shares == pytest.approx(shares, abs=1e-6)
    expected = toy.stratified_variance(shares) if stratified else toy.variance(shares)
    assert chosen.variance == pytest.approx(expected, rel=1e-5)  # float32
    # Near the optimum the strategies' means agree, and there is nothing to gain from fixed numbers of each.
    assert abs(shares[0] - toy.best()) < 0.05 or toy.stratified_variance(shares) < 0.99 * toy.variance(shares)
    assert chosen.cost == 1.0


@pytest.mark.parametrize("stratified", [True, False])
def test_least_variance_is_chosen(stratified: bool) -> None:
    plain = smooth()
    for toy in (plain, Toy(plain.f, plain.p[:, ::-1])):
        variances = [(toy.stratified_variance if stratified else toy.variance)((c, 1.0 - c)) for c in SHARES]
        best = SHARES[np.argmin(variances)]
        assert choose(MIXTURE, known_of(toy), stratified=stratified).shares == pytest.approx([best, 1.0 - best])


@pytest.mark.parametrize("swapped", [False, True])
def test_where_one_strategy_has_no_variance_it_gets_the_most(swapped: bool) -> None:
    """Stratified, the shares of a perfect strategy all promise 0; but a small one rests on few samples."""
    toy = Toy(perfect().f, perfect().p[:, ::-1] if swapped else perfect().p)
    assert max(toy.stratified_variance((c, 1.0 - c)) for c in SHARES) < 1e-12
    expected = (0.1, 0.9) if swapped else (0.9, 0.1)
    assert choose(MIXTURE, known_of(toy)).shares == pytest.approx(expected, abs=1e-6)


# ---- pairs of next-event estimation ---------------------------------------------------------------------------------


@pytest.mark.parametrize("stratified", [True, False])
def test_predicted_variance_and_cost_from_pairs(stratified: bool) -> None:
    """A mixture has no shadow ray, and goes on from fewer directions."""
    toy = two_part_toy()[0]
    for kept, share in enumerate(SHARES):
        moments = only(known_of_pairs(), PAIRS, kept)
        moments[PAIRS.offset("mean") + 1] += HOPELESS
        chosen = choose(PAIRS, moments, stratified=stratified)
        expected = toy.stratified_variance if stratified else toy.variance
        assert chosen.shares == pytest.approx([share, 1.0 - share], abs=1e-6)
        assert not chosen.is_next_event
        assert chosen.variance == pytest.approx(expected((share, 1.0 - share)), rel=1e-5)
        assert chosen.cost == pytest.approx(cost_of_mixture(share))


def test_predicted_variance_and_cost_of_next_event_estimation() -> None:
    chosen = choose(PAIRS, only(known_of_pairs(), PAIRS, None))
    assert chosen.is_next_event
    assert chosen.variance == pytest.approx(next_event_variance(), rel=1e-5)
    assert chosen.cost == pytest.approx(COST_OF_PAIR)


@pytest.mark.parametrize("weight", [0.0, 0.01, 0.1, 1.0, 10.0])
@pytest.mark.parametrize("stratified", [True, False])
def test_least_variance_and_weighted_cost_is_chosen(stratified: bool, weight: float) -> None:
    toy = two_part_toy()[0]
    chosen = choose(PAIRS, known_of_pairs(), stratified=stratified, weight=weight)
    variance = toy.stratified_variance if stratified else toy.variance
    loss = np.array([variance((c, 1.0 - c)) for c in SHARES]) + weight * cost_of_mixture(SHARES)
    share = SHARES[loss.argmin()]
    assert chosen.shares == pytest.approx((share, 1.0 - share), abs=1e-6)
    assert chosen.is_next_event == (next_event_variance() + weight * COST_OF_PAIR < loss.min())


@pytest.mark.parametrize(("ahead", "goes_on"), [(0.99, True), (1.01, False)])
def test_next_event_estimation_goes_on_where_it_is_ahead(ahead: float, goes_on: bool) -> None:
    toy = two_part_toy()[0]
    best = min(toy.stratified_variance((c, 1.0 - c)) for c in SHARES)
    known = known_of_pairs()
    known[PAIRS.offset("mean") + 1] += ahead * best - next_event_variance()
    assert choose(PAIRS, known).is_next_event == goes_on


@pytest.mark.parametrize("layout", [MIXTURE, PAIRS], ids=["mixture", "pairs"])
def test_allocation_is_kept_where_nothing_can_be_learned(layout: Layout) -> None:
    known = known_of_pairs() if layout is PAIRS else known_of(smooth())
    for case, moments in bad_moments(known).items():
        chosen = choose(layout, moments)
        assert chosen.shares == pytest.approx([0.35, 0.65], abs=1e-7), case
        assert chosen.is_next_event == (layout is PAIRS), case  # as it began
