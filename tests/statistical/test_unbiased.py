"""Every method estimates the same picture: paired t-tests over independent seeds, Sidak-corrected.

The power that a test must have is asserted too: a bias of the given size of the mean would be caught in 99 of 100 runs.
"""

from __future__ import annotations

from itertools import combinations
from typing import Any

import pytest
from statistical.estimates import REGIONS, SCENES, SEEDS, caught_bias, estimates, paired_p_values
from stats import sidak

SIGNIFICANCE = 0.01
LEARN: dict[str, Any] = {"learn_rounds": 2, "learn_spp": 64}
METHODS: dict[str, dict[str, Any]] = {
    "bsdf": {"method": "bsdf"},
    "balance": {"method": "balance"},
    "nee": {"method": "nee"},
    "fixed 0.2": {"method": "fixed", "allocation": (0.2, 0.8)},
    "fixed 0.8": {"method": "fixed", "allocation": (0.8, 0.2)},
    "lpg13": {"method": "lpg13", "learn_spp": 64},
    "sbert19": {"method": "sbert19", **LEARN},
    "murray20": {"method": "murray20", **LEARN},
    "kl-em": {"method": "kl-em", **LEARN},
    "pooled": {"method": "pooled"},
    "cost-aware": {"method": "cost-aware"},
    "counts": {"method": "counts"},
    "variance_aware": {"method": "variance_aware"},
    "optimal": {"method": "optimal"},
    "guided": {"method": "guided"},
    "cells": {"method": "cells"},
}
# Bias of the picture's mean that is caught with a probability of 99 %: between any two methods of which none is BSDF
# sampling alone, and between that and the others. BSDF sampling finds a small lamp by chance alone, hence the second.
POWER = {
    "cornell_box": (0.02, 0.02),
    "ajar_door": (0.15, 0.15),
    "veach_plates": (0.06, 0.1),
    "open_terrace": (0.15, 0.15),
    "hidden_light": (0.05, 0.05),
}
SPP = {"cornell_box": 512, "ajar_door": 1024, "veach_plates": 512, "open_terrace": 512}


def check(name: str, methods: dict[str, dict[str, Any]], seeds: int, spp: int) -> None:
    """All pairs of the methods agree on a scene, and the test would have found the bias that POWER states."""
    found = {label: estimates(name, seeds, spp=spp, **settings) for label, settings in methods.items()}
    pairs = list(combinations(methods, 2))
    level = sidak(SIGNIFICANCE, len(SCENES) * len(pairs) * REGIONS)
    disagreements = []
    caught: dict[bool, list[float]] = {False: [0.0], True: [0.0]}
    for a, b in pairs:
        p = paired_p_values(found[a], found[b])
        disagreements += [f"{a} and {b}, region {i}: p = {p[i]:.2g}" for i in range(REGIONS) if p[i] < level]
        caught["bsdf" in (a, b)].append(caught_bias(found[a], found[b], level))
    assert not disagreements, f"{name}: {disagreements}"
    smallest = max(caught[False]), max(caught[True])
    print(f"{name}: a bias of {smallest[0]:.2%} would be caught, of BSDF sampling alone {smallest[1]:.2%}")
    assert smallest[0] < POWER[name][0] and smallest[1] < POWER[name][1], f"{name}: too weak a test"


# Those whose weights or whose learning no other one of them has.
FEWER = (
    "bsdf", "balance", "nee", "fixed 0.2", "murray20", "pooled", "counts", "guided", "variance_aware", "optimal",
)  # fmt: skip
# With twice the pictures half of the samples, all told, have the same power: t-distributions of few pictures have long
# tails, and the levels lie far out in them.
QUICK = {label: METHODS[label] for label in FEWER} | {
    "murray20": {"method": "murray20", "learn_rounds": 2, "learn_spp": 8}
}
OF_DEFAULT = {label: METHODS[label] for label in ("nee", "balance", "guided")}
# Seeds, and samples per pixel. Where light comes through a gap, estimates scatter most.
SIZES_OF_DEFAULT = {"cornell_box": (24, 26), "ajar_door": (20, 26), "veach_plates": (24, 96), "open_terrace": (20, 32)}


def test_methods_agree_where_a_light_is_hidden() -> None:
    check("hidden_light", QUICK, seeds=24, spp=44)


@pytest.mark.slow
def test_all_methods_agree_where_a_light_is_hidden() -> None:
    check("hidden_light", METHODS, seeds=20, spp=136)


@pytest.mark.parametrize("name", SCENES[:-1])
def test_methods_of_the_default_agree(name: str) -> None:
    """The small version of the test of all methods: what `auto` chooses from, and the mixture."""
    check(name, OF_DEFAULT, *SIZES_OF_DEFAULT[name])


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES[:-1])
def test_methods_agree(name: str) -> None:
    """BSDF sampling not in open_terrace: it meets the sun once in some hundred thousand samples, and pictures that have
    all missed it agree so well with each other, by the lattice, that a t-test takes what is missing for a bias."""
    methods = {label: how for label, how in METHODS.items() if (name, label) != ("open_terrace", "bsdf")}
    check(name, methods, SEEDS[name], SPP[name])


# Rounds of two samples: what is learned depends on each single choice of a strategy, and so would a bias from that.
FEW: dict[str, dict[str, Any]] = {
    "murray20": {"method": "murray20", "learn_rounds": 7, "learn_spp": 2},
    "sbert19": {"method": "sbert19", "learn_rounds": 7, "learn_spp": 2},
    "kl-em": {"method": "kl-em", "learn_rounds": 7, "learn_spp": 2},
    "pooled": {"method": "pooled", "learn_rounds": 4, "learn_spp": 2},
    "variance_aware": {"method": "variance_aware", "learn_spp": 1},
    "optimal": {"method": "optimal", "learn_spp": 2},
}
FEW_SEEDS = {"murray20": 80, "sbert19": 150, "kl-em": 56, "pooled": 52, "variance_aware": 30, "optimal": 30}


def test_learning_from_few_samples_is_unbiased() -> None:
    references = estimates("room", max(FEW_SEEDS.values()), spp=36, method="balance")
    level = sidak(SIGNIFICANCE, len(FEW) * REGIONS)
    for label, settings in FEW.items():
        reference = references[: FEW_SEEDS[label]]
        found = estimates("room", len(reference), spp=16, **settings)
        assert paired_p_values(found, reference).min() > level, label
        assert caught_bias(found, reference, level) < 0.02, label
