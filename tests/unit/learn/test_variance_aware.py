"""Weights by variances: a toy by hand, the variance between rounds against NumPy, and what tells nothing."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from toys import filled, solve

from warpmis.kernels.moments import Layout
from warpmis.learn.variance_aware import make_end_round, make_variance_aware
from warpmis.methods import METHODS

METHOD = METHODS["variance_aware"]
LAYOUT = Layout(0, METHOD.statistics)
ROUNDS = LAYOUT.offset("between_rounds")
BOUNDS = METHOD.min_share, METHOD.max_share


def weights_of(light: tuple[float, float], bsdf: tuple[float, float]) -> np.ndarray:
    """Weights of bsdf and light, from (mean, variance) of each technique."""
    row = filled(LAYOUT, between_rounds=np.array([4.0, 0.0, 0.0, light[0], bsdf[0], light[1], bsdf[1]]))
    return solve(make_variance_aware(LAYOUT), LAYOUT.relative_vec, row[np.newaxis], [[0.5, 0.5]], *BOUNDS)[0]


def after_rounds(sums: np.ndarray) -> np.ndarray:
    """The row after rounds with these sums of both techniques, shape (rounds, 2)."""
    row = wp.zeros(1, dtype=LAYOUT.vec, device="cpu")
    for of_round in sums:
        known = row.numpy()
        known[0, ROUNDS + 1 : ROUNDS + 3] = of_round
        row.assign(known)
        wp.launch(make_end_round(LAYOUT), dim=1, inputs=[0, row], device="cpu")
    return row.numpy()[0]


def test_by_hand() -> None:
    """f = (2, 1) on two cells, drawn with p_light = (1/2, 1/2) and p_bsdf = (3/4, 1/4).

    By the balance heuristic a sample of either brings f / (p_light + p_bsdf) = (8/5, 4/3).
    Light: mean 1/2 8/5 + 1/2 4/3 = 22/15, variance (1/2 4/15)^2 = 4/225, v = 1 + 484/4 = 122.
    BSDF: mean 3/4 8/5 + 1/4 4/3 = 23/15, variance 3/16 (4/15)^2 = 3/225, v = 1 + 529/3 = 532/3.
    Together they are the integral, 3. The BSDF's weight is 532/3 / (532/3 + 122) = 532/898.
    """
    assert 22 / 15 + 23 / 15 == 3
    expected = np.array([532, 366]) / 898
    assert weights_of((22 / 15, 4 / 225), (23 / 15, 3 / 225)) == pytest.approx(expected, rel=1e-5)


def test_an_even_technique_has_the_greater_weight() -> None:
    """Alike but for the spread between rounds, a quarter: v = 1 + 1/4 and 1 + 1, weights of 5/13 and 8/13."""
    assert weights_of((1.0, 1.0), (1.0, 4.0)) == pytest.approx([5 / 13, 8 / 13], rel=1e-5)
    assert weights_of((1.0, 0.0), (1.0, 4.0)) == pytest.approx([0.01, 0.99]), "no spread at all: as far as the bounds"


def test_a_technique_that_brings_nothing_has_a_factor_of_1() -> None:
    assert weights_of((1.0, 0.5), (0.0, 0.0)) == pytest.approx([1 / 4, 3 / 4])
    assert weights_of((0.0, 0.0), (0.0, 0.0)) == pytest.approx([0.5, 0.5])


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_moments_out_of_range_leave_the_weights(bad: float) -> None:
    found = weights_of((bad, bad), (1.0, 1.0))
    assert np.isfinite(found).all() and found.sum() == pytest.approx(1.0)


@pytest.mark.parametrize("rounds", [1, 2, 3, 7])
def test_variance_between_rounds_equals_numpy(rounds: int) -> None:
    """Divided by the number of samples, the variance of a round's sum is that of a mean times a round's samples."""
    sums = np.random.default_rng(rounds).lognormal(size=(rounds, 2))
    row = after_rounds(sums)
    assert row[ROUNDS] == rounds
    assert row[ROUNDS + 1 : ROUNDS + 3].tolist() == [0.0, 0.0], "the next round begins anew"
    assert row[ROUNDS + 3 : ROUNDS + 5] == pytest.approx(sums.sum(axis=0))
    # n Var(mean) = Var(sum) / n is the entry over the k n samples, that is the entry k Var(sum).
    variance = rounds * sums.var(axis=0, ddof=1) if rounds > 1 else np.zeros(2)
    assert row[ROUNDS + 5 :] == pytest.approx(variance)
