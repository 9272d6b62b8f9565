"""What methods do in whole renders: what they learn from, what they keep, and what they say about it."""

from __future__ import annotations

import numpy as np
import pytest
import scenes
from scipy import stats as distributions

import warpmis
from warpmis.config import STRATEGIES
from warpmis.rendering import launches

DEPTH = 4


def rendered(method: str, **settings: object) -> warpmis.RenderResult:
    return warpmis.render(scenes.lit_ceiling(12), method=method, max_depth=DEPTH, **settings)


def bad_fit(share: float, seed: int = 1) -> warpmis.RenderResult:
    return rendered("fixed", allocation=(share, 1.0 - share), spp=1024, seed=seed)


# ---- what is learned from -------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def learned() -> dict[str, warpmis.RenderResult]:
    rounds = {"lpg13": 1, "sbert19": 4, "murray20": 4}
    return {
        method: rendered(method, learn_rounds=n, learn_spp=256, spp=256 * n + 1024, seed=1)
        for method, n in rounds.items()
    }


def test_direct_light_alone_is_learned_from_before_murray(learned: dict[str, warpmis.RenderResult]) -> None:
    """The lamps' light calls for light sampling, as far as each method goes, and the ceiling's for BSDF sampling."""
    share = {method: result.allocation[..., 0] for method, result in learned.items()}
    assert share["lpg13"] == pytest.approx(0.25, abs=1e-6)
    assert share["sbert19"] == pytest.approx(0.1, abs=1e-3)  # to a sample of the last round
    assert share["murray20"].min() > 0.8
    variance = {method: result.variance.sum() for method, result in learned.items()}
    assert variance["sbert19"] > 2.0 * variance["lpg13"] > 4.0 * variance["murray20"]


def test_direct_light_alone_is_what_they_would_learn_anyway() -> None:
    """At depth 1 there is no other light: murray20's moments are sbert19's, and so is its map but for the ridge."""
    settings = {"spp": 512, "learn_rounds": 2, "learn_spp": 64, "max_depth": 1}
    scene = scenes.lit_ceiling(12)
    ours, theirs = (warpmis.render(scene, method=method, **settings).allocation for method in ("murray20", "sbert19"))
    assert ours == pytest.approx(theirs, abs=1e-5)


# ---- the bound on what could be saved -------------------------------------------------------------------------------


def test_bound_is_small_for_a_good_fit_and_large_for_a_bad_one(learned: dict[str, warpmis.RenderResult]) -> None:
    """From 0 to 1, and in the order of the variances, each of which it bounds from above."""
    results = {"learned": learned["murray20"], **{share: bad_fit(share) for share in (0.1, 0.5, 0.7)}}
    bound = {name: result.stats["excess_variance_bound"] for name, result in results.items()}
    assert 0.0 <= bound["learned"] < 0.2 < 0.4 < bound[0.7] < bound[0.5] <= bound[0.1] <= 1.0
    best = results["learned"].variance.sum()
    for name, result in results.items():
        assert bound[name] > 1.0 - best / result.variance.sum() - 0.05


def test_bound_is_told_only_of_what_is_shared() -> None:
    for method in ("bsdf", "nee"):
        assert "excess_variance_bound" not in rendered(method, spp=4).stats
    assert "excess_variance_bound" not in rendered("murray20", spp=16, learn_spp=8, learn_rounds=2).stats


# ---- the choice of strategy -----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def truth() -> np.ndarray:
    return rendered("fixed", allocation=(0.9, 0.1), spp=1 << 14, seed=999).image.mean(axis=-1)


@pytest.mark.parametrize("share", [0.2, 0.5, 0.9])
def test_stratified_choice_is_never_worse(share: float, truth: np.ndarray) -> None:
    """Squared errors over 48 seeds, paired: not above those of random choices with 99 % confidence, but for 5 %."""
    settings = {"allocation": (share, 1.0 - share), "spp": 16}
    errors = {
        choice: np.array(
            [
                np.square(
                    rendered("fixed", strategy_choice=choice, seed=seed, **settings).image.mean(axis=-1) - truth
                ).mean()
                for seed in range(48)
            ]
        )
        for choice in ("stratified", "random")
    }
    saved = errors["random"] - errors["stratified"]
    scale = errors["random"].mean()
    error = saved.std(ddof=1) / np.sqrt(len(saved)) / scale
    print(f"share {share}: {saved.mean() / scale:.3f} +- {error:.3f} of the squared error saved")
    assert saved.mean() / scale + distributions.norm.ppf(0.01) * error > -0.05
    # Where the shares are bad, the strategies' means differ much, and much is saved.
    assert share != 0.2 or saved.mean() / scale > 3.0 * error


# ---- rounds ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["pooled", "kl-em"])
def test_map_is_the_same_whatever_the_threads(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    settings = {"spp": 64, "learn_rounds": 2, "learn_spp": 8}
    reference = rendered(method, threads=1, **settings)
    assert np.ptp(reference.allocation) > 0.1
    for threads, launch in ((2, 500), (5, 7)):
        monkeypatch.setattr(launches, "CPU_LAUNCH", launch)
        monkeypatch.setattr(launches, "CPU_ROWS", launch)
        again = rendered(method, threads=threads, **settings)
        assert np.array_equal(again.allocation, reference.allocation)
        assert np.array_equal(again.image, reference.image)


@pytest.mark.parametrize("method", ["murray20", "kl-em"])
def test_round_allocations_are_those_of_shorter_learning(method: str) -> None:
    settings = {"method": method, "learn_spp": 16, "spp": 64, "max_depth": 2}
    scene = scenes.lit_ceiling(12, lamp=300.0)
    result = warpmis.render(scene, learn_rounds=3, keep_maps=True, **settings)
    maps = result.round_allocations
    assert len(maps) == 3
    assert np.array_equal(maps[-1], result.allocation)
    for rounds in (1, 2):
        shorter = warpmis.render(scene, learn_rounds=rounds, **settings)
        # To half a sample of the next round, which is not of the same length.
        assert maps[rounds - 1] == pytest.approx(shorter.allocation, abs=0.5 / 16 + 0.5 / (64 - 16 * rounds) + 1e-6)
        assert not np.array_equal(maps[rounds - 1], maps[rounds])
        assert shorter.round_allocations == ()


# ---- eight strategies -----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def eight_equal() -> warpmis.RenderResult:
    return warpmis.render(scenes.open_room(12), method="balance", strategies=STRATEGIES, spp=1024, max_depth=DEPTH)


@pytest.mark.parametrize(("method", "least"), [("murray20", 1e-4), ("pooled", 0.2 / 8)])
def test_eight_strategies_learn(method: str, least: float, eight_equal: warpmis.RenderResult) -> None:
    """The same picture as with equal shares, to 3 %, and every strategy goes on being drawn.

    Pooled, the shares leave less variance, too. The published step is made for three strategies at most: of eight,
    some of nearly the same density, its clamp leaves shares that are no better than equal ones.
    """
    settings = {"strategies": STRATEGIES, "max_depth": DEPTH, "seed": 3}
    result = warpmis.render(scenes.open_room(12), method=method, spp=2048, learn_rounds=2, learn_spp=512, **settings)
    assert result.allocation.shape == (12, 12, 8)
    assert result.allocation.sum(axis=-1) == pytest.approx(1.0, abs=1e-5)
    assert result.allocation.min() >= least - 1e-6
    assert result.allocation.max() > 0.3
    assert result.image.mean() == pytest.approx(eight_equal.image.mean(), rel=0.03)
    if method == "murray20":
        assert result.allocation[..., :-1].sum(axis=-1).max() <= 0.9 + 7 / 1024  # each to a sample of the last round
        return
    saved = 1.0 - np.median(result.variance) / np.median(eight_equal.variance)
    print(f"{method}: {saved:.1%} less variance in the median pixel, bound {result.stats['excess_variance_bound']:.2f}")
    assert saved > 0.2
    assert result.stats["excess_variance_bound"] < eight_equal.stats["excess_variance_bound"]
