"""Settings are checked where they are built, and each message is one line that names the remedy."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from warpmis.config import STRATEGIES, LearnConfig, RenderConfig
from warpmis.errors import ConfigError
from warpmis.methods import METHODS


def fixed(allocation: Any, **settings: Any) -> RenderConfig:
    return RenderConfig(method="fixed", allocation=allocation, **settings)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"spp": 0}, "samples per pixel (spp) must be from 1 to 16777216, got 0"),
        ({"spp": 2.5}, "must be a whole number"),
        ({"spp": True}, "must be a whole number"),
        ({"width": 0}, "image width must be from 1 to"),
        ({"threads": 0}, "threads must be from 1 to"),
        ({"max_depth": -1}, "max depth must be from 0 to 1000000, got -1"),
        ({"seed": -1}, "seed must be from 0 to 4294967295"),
        ({"seed": 2**32}, "seed must be from 0 to 4294967295"),
        ({"device": "gpu"}, "choose cpu, cuda or cuda:0"),
        ({"method": "magic"}, f"unknown method 'magic'; choose one of {', '.join(METHODS)}"),
        ({"strategy_choice": "magic"}, "unknown strategy choice 'magic'; choose one of stratified, random"),
        ({"strategies": ("bsdf", "magic")}, "unknown strategy 'magic'; choose from bsdf, light"),
        ({"strategies": ("bsdf", "bsdf")}, "name each once"),
        ({"strategies": ()}, "name at least one strategy"),
        ({"strategies": "bsdf"}, "must be a tuple of names"),
        ({"method": "murray20", "strategies": ("bsdf",)}, "name two, such as bsdf,light"),
        ({"method": "bsdf", "strategies": ("light",)}, "add bsdf, which reaches every path"),
        ({"method": "balance", "strategies": ("light", "area", "dome")}, "add bsdf, which reaches every path"),
        ({"allocation": (0.5, 0.5)}, "drop the allocation, or take method 'fixed'"),
        ({"method": 3}, "method must be a name as text, got 3"),
        ({"device": None}, "device must be a name as text, got None"),
        ({"sampler": ["lattice"]}, "sampler must be a name as text, got ['lattice']"),
        ({"strategy_choice": True}, "strategy choice must be a name as text, got True"),
        ({"strategies": 3}, "must be a tuple of names"),
        ({"strategies": (3,)}, "must be a tuple of names"),
        ({"ids": 1}, "ids must be True or False, got 1"),
        ({"mis_compensation": "no"}, "mis compensation must be True or False, got 'no'"),
        ({"learn": {"rounds": 2}}, "learn must be a LearnConfig, got {'rounds': 2}"),
        ({"method": "fixed"}, "method 'fixed' needs an allocation: one share for each of bsdf, light"),
    ],
)
def test_rejects_with_a_remedy(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError) as error:
        RenderConfig(**settings)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("allocation", "message"),
    [
        ((0.5, 0.6), "must sum to 1, got 1.1"),
        ((0.0, 0.0), "must sum to 1, got 0"),
        ((-0.5, 1.5), "not negative"),
        ((np.nan, 1.0), "finite"),
        ((1.0,), "shape (2,) or (H, W, 2)"),
        (np.full((4, 2), 0.5), "got shape (4, 2)"),
        (np.full((4, 4, 3), 1 / 3), "got shape (4, 4, 3)"),
        ((), "one share per strategy"),
        (1.0, "one share per strategy"),
        ("half", "must be numbers"),
        (((0.5, 0.5), (1.0,)), "must be numbers"),
    ],
)
def test_rejects_an_allocation_off_the_simplex(allocation: Any, message: str) -> None:
    with pytest.raises(ConfigError) as error:
        fixed(allocation)
    assert message in str(error.value)


@pytest.mark.parametrize("shares", [(0.0, 0.5, 0.5), np.tile((0.0, 0.5, 0.5), (2, 3, 1))])
def test_rejects_shares_of_lights_alone(shares: Any) -> None:
    """They would lose the light of every direction that no light's line meets; any complete strategy is enough."""
    with pytest.raises(ConfigError, match="find no indirect light: give bsdf a part of every pixel"):
        fixed(shares, strategies=("bsdf", "light", "dome"))
    fixed(shares, strategies=("bsdf", "light", "cosine"))


def test_worst_pixel_decides() -> None:
    shares = np.full((3, 3, 2), 0.5)
    shares[1, 2] = (0.5, 0.4)
    with pytest.raises(ConfigError, match=r"must sum to 1, got 0\.9;"):
        fixed(shares)


@pytest.mark.parametrize("allocation", [(0.25, 0.75), [0.25, 0.75], np.tile(np.float16([0.25, 0.75]), (2, 3, 1))])
def test_allocation_becomes_a_float32_copy(allocation: Any) -> None:
    kept = fixed(allocation).allocation
    assert isinstance(kept, np.ndarray) and kept.dtype == np.float32
    assert kept.shape == np.shape(allocation)
    assert not np.shares_memory(kept, allocation) if isinstance(allocation, np.ndarray) else True


def test_allocation_within_tolerance_is_normalised() -> None:
    kept = fixed((0.33333, 0.66661)).allocation
    assert np.sum(kept) == pytest.approx(1.0, abs=1e-7)


def test_bsdf_method_has_one_strategy() -> None:
    assert RenderConfig(method="bsdf").strategies == ("bsdf",)


def test_strategies_become_a_tuple() -> None:
    assert RenderConfig(method="balance", strategies=["light", "bsdf"]).strategies == ("light", "bsdf")


def test_numpy_numbers_become_plain() -> None:
    config = RenderConfig(spp=np.int64(64), seed=np.uint32(7), method="pooled", learn=LearnConfig(rounds=np.int32(2)))
    assert [type(value) for value in (config.spp, config.seed, config.learn.rounds)] == [int, int, int]


# ---- learning -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("spp", "learn", "expected"),
    [
        (256, LearnConfig(), 64),
        (256, LearnConfig(rounds=8), 16),
        (100, LearnConfig(rounds=1), 50),
        (64, LearnConfig(spp=3), 3),
    ],
)
def test_learning_takes_half_of_the_budget_unless_told(spp: int, learn: LearnConfig, expected: int) -> None:
    assert RenderConfig(spp=spp, method="murray20", learn=learn).learn_spp() == expected


@pytest.mark.parametrize(("method", "expected"), [("pooled", 32), ("cost-aware", 32), ("lpg13", 512)])
def test_each_method_spends_its_own_share_on_learning(method: str, expected: int) -> None:
    """An eighth for what pools its neighbours' samples; lpg13's only round is half of all."""
    assert RenderConfig(spp=1024, method=method).learn_spp() == expected


def test_learning_within_the_budget() -> None:
    RenderConfig(spp=64, method="murray20", learn=LearnConfig(rounds=8, spp=8))
    with pytest.raises(
        ConfigError, match=r"8 learn rounds of 9 samples per pixel exceed .* 64; raise spp to 72 or more"
    ):
        RenderConfig(spp=64, method="murray20", learn=LearnConfig(rounds=8, spp=9))


def test_budget_concerns_the_learning_method_alone() -> None:
    RenderConfig(spp=1, method="balance")
    with pytest.raises(ConfigError, match="or take fewer learn rounds"):
        RenderConfig(spp=1, method="murray20", learn=LearnConfig(rounds=2))


@pytest.mark.parametrize(("spp", "rounds"), [(1, 1), (4, 1), (255, 1), (256, 2), (1024, 4), (16384, 8), (1 << 20, 8)])
def test_rounds_grow_with_the_budget_and_always_fit(spp: int, rounds: int) -> None:
    config = RenderConfig(spp=spp, method="murray20")
    assert config.learn_rounds() == rounds
    assert rounds * config.learn_spp() <= spp


@pytest.mark.parametrize("spp", [1, 2, 7, 64, 1000])
@pytest.mark.parametrize("method", [name for name, method in METHODS.items() if method.learns])
def test_learning_fits_any_budget(method: str, spp: int) -> None:
    config = RenderConfig(spp=spp, method=method)
    assert 1 <= config.learn_rounds() <= (METHODS[method].rounds or METHODS[method].max_rounds)
    assert config.learn_rounds() * config.learn_spp() <= spp


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"keep_maps": 1}, "keep maps must be True or False, got 1"),
        ({"rounds": 0}, "learn rounds must be from 1"),
        ({"spp": 0}, "learn samples per pixel a round must be from 1"),
        ({"initial_allocation": (0.0, 1.0)}, "one positive share per strategy"),
        ({"initial_allocation": ((0.5, 0.5),)}, "one positive share per strategy"),
        ({"initial_allocation": (0.5, 0.6)}, "must sum to 1"),
    ],
)
def test_rejects_impossible_learning(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        LearnConfig(**settings)


def test_initial_allocation_has_a_share_for_each_strategy() -> None:
    with pytest.raises(ConfigError, match="initial allocation must have 2 shares, one for each of bsdf, light, got 3"):
        RenderConfig(method="murray20", learn=LearnConfig(initial_allocation=(0.2, 0.3, 0.5)))


@pytest.mark.parametrize("learn", [{"rounds": 2}, {"spp": 4}, {"initial_allocation": (0.5, 0.5)}, {"keep_maps": True}])
@pytest.mark.parametrize("method", ["bsdf", "balance", "nee", "fixed"])
def test_rejects_learning_where_nothing_is_learned(method: str, learn: dict[str, Any]) -> None:
    allocation = (0.5, 0.5) if method == "fixed" else None
    with pytest.raises(ConfigError, match=f"'{method}' takes no learn settings: drop them, or take murray20"):
        RenderConfig(method=method, allocation=allocation, learn=LearnConfig(**learn))


def test_a_cache_plans_its_own_rounds() -> None:
    """What can be asked for is the map after each of them."""
    assert RenderConfig(method="auto", learn=LearnConfig(keep_maps=True)).learn.keep_maps
    for learn in ({"rounds": 2}, {"spp": 4}, {"initial_allocation": (0.5, 0.5)}):
        with pytest.raises(ConfigError, match="'guided' takes no learn settings"):
            RenderConfig(method="guided", learn=LearnConfig(**learn))


@pytest.mark.parametrize("strategies", [("guide",), ("light", "guide")])
def test_a_guide_alone_does_not_reach_every_path(strategies: tuple[str, ...]) -> None:
    """Its density is tiny where nothing was seen: means of a few pictures would be wrong more often than right."""
    with pytest.raises(ConfigError, match="find no indirect light: add bsdf"):
        RenderConfig(method="cells", strategies=strategies)
    RenderConfig(method="cells", strategies=("bsdf", *strategies))


@pytest.mark.parametrize(
    ("method", "settings", "message"),
    [
        ("lpg13", {"learn": LearnConfig(rounds=2)}, "method 'lpg13' has 1 learn round; drop the number of rounds"),
        ("lpg13", {"strategies": STRATEGIES}, "for two strategies; take pooled for 8"),
        ("sbert19", {"strategies": ("bsdf", "light", "uniform")}, "for two strategies; take pooled for 3"),
        ("auto", {"strategies": ("bsdf", "dome")}, "for the strategies bsdf,light; take cells for others"),
        ("auto", {"strategies": ("light", "bsdf")}, "for the strategies bsdf,light; take cells for others"),
        ("murray20", {"strategies": ("bsdf", "guide")}, "has no strategy 'guide': take method cells, or drop it"),
    ],
)
def test_rejects_what_a_method_is_not_made_for(method: str, settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError) as error:
        RenderConfig(spp=1024, method=method, **settings)
    assert message in str(error.value)
    RenderConfig(spp=1024, method="cells" if "cells" in message else "murray20", **settings)


# ---- as plain values ------------------------------------------------------------------------------------------------


def test_plain_values_are_json() -> None:
    settings = fixed((0.25, 0.75), width=64, mis_compensation=True).to_dict()
    assert json.loads(json.dumps(settings)) == settings
    assert settings["allocation"] == [0.25, 0.75]
    assert settings["strategy_choice"] == "stratified"
    assert settings["mis_compensation"] is True and settings["ids"] is False
    learning = RenderConfig(method="murray20", learn=LearnConfig(initial_allocation=(0.5, 0.5))).to_dict()
    assert json.loads(json.dumps(learning)) == learning
    assert learning["learn"] == {"rounds": 2, "spp": 64, "initial_allocation": [0.5, 0.5]}


def test_plain_values_name_a_picture_by_its_shape() -> None:
    assert fixed(np.full((4, 6, 2), 0.5)).to_dict()["allocation"] == "per pixel (4, 6, 2)"
    assert RenderConfig().to_dict()["allocation"] is None
