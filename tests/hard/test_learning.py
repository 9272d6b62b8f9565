"""Hard cases of learning: the right picture, shares on the simplex, nothing that is not finite.

Every pixel of a case sees the same point, so the pixels' means are samples of one number: a t-test holds them against
the closed form, at 1 % for the file after Sidak.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from hard import naive
from hard.case import HardCase
from hard.learning_cases import LEARNING_CASES, PIXELS, REFUSED_MAPS, lit_floor
from stats import detectable_bias, sidak, standard_error, z_test
from toys import Toy, perfect
from usd.stages import stage_of

import warpmis
from warpmis.config import DEFAULT_STRATEGIES
from warpmis.errors import ConfigError

CASES = {case.name: case for case in LEARNING_CASES}

# The bias that each case's test finds, relative to the mean.
POWER = {"one-sample-in-10000": 0.9, "light-density-0-where-light-is": 0.15, "a-rare-light-beside-a-common-one": 0.9}
POWER_OF_OTHERS = 0.03


def methods_of(case: HardCase) -> list[str]:
    """The methods that the case may be rendered by: its own, else what learns on its strategies."""
    if "method" in case.settings:
        return [case.settings["method"]]
    if "learn_rounds" in case.settings:
        return ["murray20"]
    if case.settings.get("strategies", DEFAULT_STRATEGIES) == DEFAULT_STRATEGIES:
        return ["murray20", "nee"]
    return ["murray20", "pooled"] if case.learns else ["murray20"]


RUNS = [(case.name, method) for case in LEARNING_CASES for method in methods_of(case)]
SIGNIFICANCE = sidak(0.01, len(RUNS))


@cache
def scene_of(name: str) -> warpmis.Scene:
    return warpmis.load_stage(CASES[name].build())


@cache
def rendered(name: str, method: str) -> warpmis.RenderResult:
    settings = {**CASES[name].settings, "method": method}
    return warpmis.render(scene_of(name), **settings)


def check(result: warpmis.RenderResult) -> None:
    """Nothing that is not finite, and shares on the simplex."""
    for channel, picture in result.channels().items():
        assert np.isfinite(picture).all(), channel
    assert result.stats["rejected_samples"] == 0
    assert result.allocation.min() >= 0.0
    assert np.abs(result.allocation.sum(axis=-1) - 1.0).max() < 1e-6


@pytest.mark.parametrize(("name", "method"), RUNS)
def test_right_answer(name: str, method: str) -> None:
    result = rendered(name, method)
    check(result)
    assert not result.warnings
    expected = np.array(CASES[name].mean)
    assert np.ptp(result.image, axis=-1).max() <= 1e-5 * result.image.max()
    means = result.image[..., 0].astype(np.float64).ravel()
    assert means.shape == (PIXELS**2,)
    if expected[0] == 0.0:
        assert (means == 0.0).all()
        return
    error = standard_error(means)
    assert detectable_bias(error, SIGNIFICANCE) < POWER.get(name, POWER_OF_OTHERS) * expected[0]
    p = z_test(means.mean(), error, expected[0])
    assert p > SIGNIFICANCE, f"{means.mean():.6g} +- {error:.2g}, not {expected[0]:.6g}"


# ---- what is learned ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["murray20", "guided"])
def test_without_light_nothing_is_learned(method: str) -> None:
    assert (rendered("no-light-reaches-a-pixel", method).allocation == 0.5).all()


def test_equal_densities_keep_their_shares() -> None:
    """To half a sample of the round, whose number is odd."""
    assert np.abs(rendered("equal-densities", "murray20").allocation - 0.5).max() < 0.002


def test_a_strategy_that_finds_no_light_gets_the_least_share() -> None:
    """M2 = c / a: every pixel ends on the bound, to a sample of the last round."""
    allocation = rendered("light-density-0-where-light-is", "murray20").allocation
    assert allocation == pytest.approx(np.broadcast_to((0.9, 0.1), allocation.shape), abs=0.003)


@pytest.mark.parametrize("method", ["murray20", "pooled"])
def test_six_useless_strategies_lose_their_shares(method: str) -> None:
    """The two that draw towards the lamp had a quarter of the samples: the variance is less than half of that."""
    name = "eight-strategies-six-useless"
    equal, learned = rendered(name, "balance"), rendered(name, method)
    lights = [learned.strategies.index(strategy) for strategy in ("light", "area")]
    assert learned.allocation[..., lights].sum(axis=-1).mean() > 0.45
    assert learned.variance.mean() < 0.5 * equal.variance.mean()


# ---- scale ----------------------------------------------------------------------------------------------------------


def shining(factor: float) -> warpmis.Scene:
    scene = scene_of("one-round")
    return replace(scene, lights=tuple(replace(light, radiance=light.radiance * factor) for light in scene.lights))


@pytest.mark.parametrize("method", ["murray20", "kl-em"])
@pytest.mark.parametrize("factor", [2.0**-100, 2.0**60, 2.0**100])
def test_the_unit_of_radiance_changes_no_bit(factor: float, method: str) -> None:
    """Powers of two: the same shares, and the image times the factor, exactly; 2^100 is 1.3e30."""
    settings: dict[str, Any] = {"method": method, "spp": 256, "max_depth": 1}
    one, other = (warpmis.render(shining(k), **settings) for k in (1.0, factor))
    check(other)
    assert (other.allocation == one.allocation).all()
    assert (one.allocation != 0.5).any()
    assert (other.image == one.image * np.float32(factor)).all()
    # Squares may be beyond float32: the variance ends at its largest number, or at 0.
    expected = one.variance.astype(np.float64) * factor**2
    fits = (expected < 3e38) & (expected > 1e-37)
    assert (other.variance == expected)[fits].all()
    assert fits.all() == (factor == 2.0**60)


# ---- the naive step -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", naive.SAMPLES)
def test_the_naive_step_breaks_where_ours_does_not(name: str) -> None:
    """The same samples: shares off the simplex, or no numbers, if written without guards in float32."""
    assert not naive.outcome(name, naive=True).startswith("shares from"), naive.outcome(name, naive=True)
    assert naive.outcome(name, naive=False).startswith("shares from")


def test_rounding_of_equal_densities_moves_no_share() -> None:
    assert (naive.step(naive.alike(2), naive=False) == 0.5).all()


def test_a_share_of_0_loses_light_for_ever() -> None:
    """What the bounds are for: without the first strategy half of the integral is never drawn, nor learned of."""
    toy = perfect()
    lamp = Toy(toy.f[::-1] + 0.5, toy.p)
    shares = np.array([0.0, 1.0])
    with np.errstate(all="ignore"):
        F = np.where(lamp.p @ shares > 0.0, lamp.f / (lamp.p @ shares), 0.0)
    assert lamp.expectation(F, shares) == pytest.approx(lamp.integral - 0.25)


# ---- refusals -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", REFUSED_MAPS)
def test_a_bad_map_is_refused_in_one_line(name: str) -> None:
    allocation, said = REFUSED_MAPS[name]
    with pytest.raises(ConfigError, match=said) as error:
        warpmis.render(stage_of(lit_floor()), method="fixed", allocation=allocation)
    assert len(str(error.value).splitlines()) == 1


def test_a_good_map_is_taken() -> None:
    assert rendered("shares-on-the-bounds", "fixed").allocation[..., 0].size == PIXELS**2
