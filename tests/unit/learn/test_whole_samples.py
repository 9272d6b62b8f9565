"""Shares in whole samples: a round gives each strategy exactly as many, and no share is far from what was learned."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp

from warpmis.learn.whole_samples import FEWEST, make_whole_samples


def rounded(shares: np.ndarray, samples: int, least: float) -> np.ndarray:
    vec_s = wp.types.vector(length=shares.shape[1], dtype=wp.float32)
    allocation = wp.array(shares.astype(np.float32), dtype=vec_s, device="cpu")
    wp.launch(make_whole_samples(shares.shape[1]), len(shares), inputs=[0, allocation, samples, least], device="cpu")
    return allocation.numpy().astype(float)


@pytest.mark.parametrize("count", [2, 3, 8])
@pytest.mark.parametrize("samples", [None, 100, 225, 1000, 65536])
def test_every_share_is_a_whole_number_of_samples(count: int, samples: int | None) -> None:
    """Within a sample of what was wished; the bound holds; the sum is the round's."""
    samples = samples or FEWEST * count
    least = 0.2 / count
    shares = np.random.default_rng(count).dirichlet(np.full(count, 0.5), size=2000) * (1.0 - 0.2) + least
    shares[0] = np.append(np.full(count - 1, least), 1.0 - (count - 1) * least)
    whole = rounded(shares, samples, least) * samples
    assert whole == pytest.approx(np.round(whole), abs=1e-2)
    assert (np.round(whole).sum(axis=1) == samples).all()
    assert whole.min() >= np.ceil(least * samples - 1e-3) - 1e-2
    # A share on the bound is rounded up, at the cost of the others.
    assert np.abs(whole - shares * samples).max() < 1.0 + count / 2.0


def test_shares_below_the_bound_stay_below_it() -> None:
    """What a method of its own bounds has learned is not lifted to another's: only rounded up."""
    assert rounded(np.array([[0.01, 0.99]]), 64, 0.1)[0] == pytest.approx([1.0 / 64.0, 63.0 / 64.0])
