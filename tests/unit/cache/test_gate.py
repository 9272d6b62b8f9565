"""When a render goes on with the cache."""

from __future__ import annotations

import pytest

from warpmis.cache.gate import GROWTH, LEAST_GAIN, Prospect, Trial, gain, pays
from warpmis.cache.training import Training, prospects, training_rounds


def test_prospects_of_rounds() -> None:
    """Of 100 pixels and 100 samples each: a trial after 200 paths, of 1,600 of its own."""
    trial = [Training(1, 8, False, half) for half in (0, 1)]
    rounds = [Training(1, 2, False), *trial, Training(1, 4, False), Training(1, 10, True)]
    (found,) = prospects(rounds, 100, 100)
    assert 2.0**found.doublings == pytest.approx((200 + 1600 + 400 + 1000) / 200)
    assert found.dropped == pytest.approx(400 / (10_000 - 200 - 1600))


def test_small_renders_give_up_sooner_than_large_ones() -> None:
    least = []
    for spp in (64, 256, 4096):
        first = prospects(training_rounds(4096, spp), 4096, spp)[0]
        least.append(LEAST_GAIN / (GROWTH**first.doublings * (1.0 - first.dropped)))
    assert least == sorted(least, reverse=True)
    assert 0.7 < least[0] < 0.9 and least[-1] < 0.65


def test_the_last_trial_decides_by_what_it_found() -> None:
    pilot, nothing_follows = Trial(2.0, 10.0), Prospect(0.0, 0.0)
    trial = Trial(1.0, 10.0)
    assert gain(pilot, trial) == pytest.approx(2.0 / 1.55)
    assert pays(pilot, [trial], [nothing_follows])
    assert not pays(pilot, [Trial(1.4, 10.0)], [nothing_follows])
    assert pays(pilot, [Trial(1.4, 10.0)], [Prospect(1.0, 0.0)])
    assert not pays(pilot, [trial], [Prospect(0.0, 0.3)])
    assert not pays(pilot, [], [])
