"""Stopping rules with a renderer whose noise and speed are known: when they stop, and that they are honest."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from scipy import stats

from warpmis.config import CEILING, DEFAULT_SPP, RenderConfig
from warpmis.errors import ConfigError
from warpmis.film.metrics import relative_mse
from warpmis.learn.schedule import schedule
from warpmis.rendering.stopping import CONFIDENCE, LEAST, Watch

SIDE = 24
TRUTH = np.linspace(1.0, 2.0, SIDE * SIDE * 3).reshape(SIDE, SIDE, 3)


class FakeRun:
    """Samples with relative noise of standard deviation `noise`, `cost` seconds a sample per pixel."""

    def __init__(self, noise: float = 1.0, cost: float = 1.0, seed: int = 0, **settings: Any) -> None:
        self.config = RenderConfig(**settings)
        self.noise, self.cost = noise, cost
        self.rng = np.random.default_rng(seed)
        self.now = 0.0
        self.color = np.zeros((SIDE, SIDE, 3))
        self.watch = Watch(self.config, (SIDE, SIDE), lambda: self.now)
        self.pieces: list[range] = []

    def run(self) -> FakeRun:
        for part in schedule(self.config):
            for index, piece in self.watch.pieces(part):
                self.take(index, piece)
            if self.watch.stopped:
                break
        return self

    def take(self, index: int, piece: range) -> None:
        self.pieces.append(piece)
        self.now += self.cost * len(piece)
        noise = self.noise * np.sqrt(len(piece)) * self.rng.standard_normal((SIDE, SIDE, 1))
        self.color = self.color + TRUTH * (len(piece) + noise)
        self.watch.add(index, piece, self.color)

    def error(self) -> float:
        return relative_mse(self.color / self.watch.spp, TRUTH) ** 0.5


def ends(pieces: list[range]) -> Iterator[int]:
    yield from (piece.stop for piece in pieces)


# ---- when it stops --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["nee", "auto", "murray20"])
def test_pieces_cover_the_samples_without_gap_or_overlap(method: str) -> None:
    run = FakeRun(method=method, target_error=0.03).run()
    assert [piece.start for piece in run.pieces] == [0, *ends(run.pieces)][:-1]
    assert run.pieces[-1].stop == run.watch.spp == run.watch.counts.sum()
    assert np.ptp(run.watch.counts) <= 1, "four parts of one size"


def test_it_stops_at_the_target_and_not_long_after() -> None:
    """Noise 1: 2 % after (1 / 0.02)^2 = 2500 samples, a fifth more to be sure, so few are the pixels."""
    run = FakeRun(target_error=0.02).run()
    assert run.watch.reason == "target error"
    assert 2500 < run.watch.spp < 2500 * 1.4
    assert run.error() < 0.02
    assert run.watch.stats()["relative_error"] == pytest.approx(run.error(), rel=0.1)
    assert not any("stopped by" in note for note in run.watch.notes())


def test_easy_pictures_take_the_least() -> None:
    assert FakeRun(noise=0.01, target_error=0.05).run().watch.spp == LEAST


def test_the_ceiling_is_told() -> None:
    run = FakeRun(target_error=0.02, spp=500).run()
    assert (run.watch.reason, run.watch.spp) == ("samples", 500)
    (note,) = (note for note in run.watch.notes() if "stopped by" in note)
    assert note.startswith("stopped by the limit of 500 samples per pixel before the target error: it is 4.")
    assert 2500 < run.watch.stats()["target_spp"] < 3500
    assert f"would take about {run.watch.target_spp:.0f} samples" in note


@pytest.mark.parametrize("cost", [0.001, 0.3, 7.0])
def test_the_time_limit_is_kept(cost: float) -> None:
    """At least one sample, then no longer than there is time for a sample more."""
    run = FakeRun(cost=cost, time_limit=60.0, method="nee", spp=10**6).run()
    assert run.watch.reason == "time limit"
    assert 0.98 * 60.0 - cost <= run.now <= 60.0
    assert FakeRun(cost=500.0, time_limit=60.0).run().watch.spp == 1


def test_time_cuts_the_last_step_alone() -> None:
    """What is traced before is the same, so a faster machine's picture goes on from a slower one's."""
    slow, fast = (FakeRun(cost=cost, time_limit=60.0, method="nee").run().pieces for cost in (0.3, 0.2))
    common = [one for one, other in zip(slow, fast, strict=False) if one == other]
    assert common[-1].stop >= 64
    assert [piece.stop for piece in common] == list(ends(slow[: len(common)]))


def test_the_target_ignores_the_clock() -> None:
    """The same samples whatever the machine's speed, with a time limit that is not reached too."""
    spp = {FakeRun(cost=cost, target_error=0.03).run().watch.spp for cost in (1e-6, 1.0)}
    spp |= {FakeRun(cost=1.0, target_error=0.03, time_limit=1e9).run().watch.spp}
    assert len(spp) == 1


def test_prediction_on_the_way() -> None:
    """From the first looks on, 2 % is told to take some 2500 samples, and the seconds left are those of the rest."""
    run = FakeRun(target_error=0.02, cost=0.5)
    needed = {}
    for index, piece in run.watch.pieces(schedule(run.config)[-1]):
        run.take(index, piece)
        if run.watch.estimate is not None:
            needed[run.watch.spp] = run.watch.needed_spp()
            left = (run.watch.needed_spp() - run.watch.spp) * 0.5
            assert run.watch.progress()["seconds_left"] == pytest.approx(left)
    assert all(2300 < spp < 3800 for spp in needed.values()), needed
    assert min(needed) < 200


def test_what_the_error_does_not_know_is_said() -> None:
    notes = FakeRun(target_error=1e-6, spp=64, max_depth=3).run().watch.notes()
    assert any("more than 3 bounces" in note for note in notes)
    assert any("below 0.001 % is below" in note for note in notes)
    assert FakeRun(time_limit=5.0).run().watch.notes() == ()
    assert "no number of samples reaches the target" in FakeRun(target_error=1e-200, spp=64).run().watch.notes()[-1]


# ---- honesty --------------------------------------------------------------------------------------------------------


def test_the_bound_holds_as_often_as_it_says() -> None:
    """400 runs: were the bound broken in 10 % of them, not 5 %, this would fail with a probability of 98 %.

    Stopping at the estimate instead of its bound breaks it in a tenth of them.
    """
    runs = [FakeRun(target_error=0.08, noise=1.5, seed=seed).run() for seed in range(400)]
    assert all(run.watch.reason == "target error" for run in runs)
    broken = sum(run.error() > 0.08 for run in runs)
    assert stats.binomtest(broken, len(runs), 1.0 - CONFIDENCE, alternative="greater").pvalue > 0.05
    assert np.mean([run.error() for run in runs]) > 0.85 * 0.08, "and not by far too much work"


# ---- settings -------------------------------------------------------------------------------------------------------


def test_the_ceiling_is_sane_and_learning_is_a_plain_render_s() -> None:
    assert RenderConfig().spp == DEFAULT_SPP
    for stop in ({"target_error": 0.01}, {"time_limit": 60.0}):
        config = RenderConfig(**stop)
        assert config.spp == CEILING
        assert config.learn_spp() == RenderConfig().learn_spp()
        assert RenderConfig(**stop, spp=100).spp == 100
    config = RenderConfig(target_error=np.float32(0.5), time_limit=np.int64(60))
    assert [type(config.to_dict()[name]) for name in ("target_error", "time_limit")] == [float, float]


@pytest.mark.parametrize("value", [0.0, -0.1, 1.5, float("nan"), "1%", True])
def test_impossible_targets(value: Any) -> None:
    with pytest.raises(ConfigError, match="target error must be above 0 and at most 1"):
        RenderConfig(target_error=value)


@pytest.mark.parametrize("value", [0.0, -1.0, float("inf"), float("nan"), "60"])
def test_impossible_time_limits(value: Any) -> None:
    with pytest.raises(ConfigError, match="time limit must be above 0"):
        RenderConfig(time_limit=value)
