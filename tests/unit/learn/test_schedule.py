"""The schedule: every sample of the budget is taken once, learning first."""

from __future__ import annotations

import pytest

from warpmis.config import LearnConfig, RenderConfig
from warpmis.learn.schedule import schedule


@pytest.mark.parametrize("spp", [16, 100, 4096])
def test_rounds_cover_the_budget_without_gap_or_overlap(spp: int) -> None:
    rounds = schedule(RenderConfig(spp=spp, method="murray20", learn=LearnConfig(rounds=4)))
    assert [part.learn for part in rounds] == [True] * 4 + [False]
    ends = [part.first_sample + part.samples for part in rounds]
    assert [part.first_sample for part in rounds] == [0, *ends[:-1]]
    assert ends[-1] == spp


def test_learning_may_take_the_whole_budget() -> None:
    rounds = schedule(RenderConfig(spp=32, method="murray20", learn=LearnConfig(rounds=4, spp=8)))
    assert [part.learn for part in rounds] == [True] * 4


@pytest.mark.parametrize(("method", "rounds"), [("lpg13", [512]), ("pooled", [32] * 4)])
def test_learn_rounds_of_a_method(method: str, rounds: list[int]) -> None:
    *learned, last = schedule(RenderConfig(spp=1024, method=method))
    assert [part.samples for part in learned] == rounds
    assert (last.first_sample, last.samples) == (sum(rounds), 1024 - sum(rounds))


@pytest.mark.parametrize("method", ["bsdf", "balance", "nee", "fixed"])
def test_methods_that_do_not_learn_take_one_round(method: str) -> None:
    allocation = (0.5, 0.5) if method == "fixed" else None
    (only,) = schedule(RenderConfig(spp=64, method=method, allocation=allocation))
    assert (only.first_sample, only.samples, only.learn) == (0, 64, False)
