"""The methods by name: how each shares the samples of a pixel among the strategies, and what it learns from.

References: Veach (1997), balance heuristic; Kajiya (1986), next-event estimation; Lu, Pacanowski, Granier (2013);
Sbert, Havran, Szirmay-Kalos (2019); Murray, Benzait, Pacanowski, Granier (2020); Grittmann, Georgiev, Slusallek,
Krivanek (2019); Kondapaneni, Vevoda, Grittmann, Skrivan, Slusallek, Krivanek (2019).
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Method:
    """One way to find an allocation.

    Attributes:
        summary: what it does, for --help.
        solver: what turns moments into an allocation, a row of learn/solvers.py; "" where nothing is learned.
        statistics: what the trace kernel adds up beside the moments (kernels/moments.py), for the solver.
        direct_only: the moments are of the light that comes straight from the lights, as before Murray et al.
        two_strategies: published for two strategies alone.
        min_share, max_share: bounds of a share for two strategies; learn/ says what becomes of them for more.
        rounds: number of learn rounds where the method fixes it; fewer where there are not so many samples.
        keeps: the moments of all rounds are used, not those of the last one alone.
        pool_radius: the solver gets moments relative to a pixel's brightness, pooled over the pixels so far to each
            side; 0 is the pixel's own; None: it gets the pixel's sums.
        cost_aware: variance x cost is minimised, not variance alone.
        learn_share: share of the budget that is spent on learning unless the caller says otherwise; of a pilot for
            next-event estimation's two samples, beside the picture's samples.
        max_rounds: most learn rounds that the budget may be divided into.
        allocation: what a pixel's numbers are (Features.allocation).
        cache: a spatial cache guides the paths at every vertex.
        by_cells: the cache's cells share directions among the strategies, and there are no light samples.
        tries: only where it pays, by a trial.
    """

    summary: str
    solver: str = ""
    statistics: tuple[str, ...] = ()
    direct_only: bool = False
    two_strategies: bool = False
    min_share: float = 0.1
    max_share: float = 0.9
    rounds: int | None = None
    keeps: bool = False
    pool_radius: int | None = None
    cost_aware: bool = False
    learn_share: float = 0.5
    max_rounds: int = 8
    allocation: str = "shares"
    cache: bool = False
    by_cells: bool = False
    tries: bool = False

    @property
    def learns(self) -> bool:
        return bool(self.solver)

    @property
    def is_of_pair(self) -> bool:
        """Whether it is next-event estimation with its light sample and its BSDF sample otherwise joined."""
        return self.allocation != "shares"

    @property
    def has_strategies(self) -> bool:
        """Whether directions are shared among the strategies that a user names."""
        return self.by_cells or not self.cache


METHODS: dict[str, Method] = {
    "bsdf": Method(summary="BSDF sampling only at the first vertex"),
    "balance": Method(summary="a mixture with equal shares"),
    "nee": Method(summary="next-event estimation: one light sample and one BSDF sample at every vertex"),
    "fixed": Method(summary="a mixture with the shares of --allocation"),
    "lpg13": Method(
        summary="learns from direct light only: one Newton step (Lu et al. 2013)",
        solver="newton_share",
        direct_only=True,
        two_strategies=True,
        min_share=0.25,
        max_share=0.75,
        rounds=1,
    ),
    "sbert19": Method(
        summary="learns from direct light only: Newton steps (Sbert et al. 2019)",
        solver="newton_share",
        direct_only=True,
        two_strategies=True,
    ),
    "murray20": Method(summary="learns from all light: Newton steps (Murray et al. 2020)", solver="newton_seed"),
    "kl-em": Method(
        summary="learns by expectation maximization from the samples of all rounds",
        solver="expectation",
        statistics=("posterior",),
        keeps=True,
    ),
    "pooled": Method(
        summary="learns from the samples of neighbouring pixels: Newton on the simplex",
        solver="newton_simplex",
        statistics=("mean",),
        keeps=True,
        pool_radius=4,
        learn_share=0.125,
        max_rounds=4,
    ),
    "cost-aware": Method(
        summary="like pooled, but minimizes variance x cost",
        solver="newton_simplex",
        statistics=("mean", "cost"),
        keeps=True,
        pool_radius=4,
        cost_aware=True,
        learn_share=0.125,
        max_rounds=4,
    ),
    "counts": Method(
        summary="nee with as many light samples and paths at the first vertex as a pilot finds best",
        two_strategies=True,
        allocation="counts",
    ),
    "variance_aware": Method(
        summary="nee with weights by the variances of its two samples (Grittmann et al. 2019)",
        solver="variance_aware",
        statistics=("mean", "between_rounds"),
        two_strategies=True,
        min_share=0.01,
        max_share=0.99,
        rounds=4,
        keeps=True,
        pool_radius=4,
        learn_share=0.0625,
        allocation="weights",
    ),
    "optimal": Method(
        summary="nee with a control variate of its two samples (Kondapaneni et al. 2019)",
        solver="control_variate",
        statistics=("mean", "control"),
        two_strategies=True,
        rounds=1,
        keeps=True,
        pool_radius=4,
        learn_share=0.0625,
        allocation="control",
    ),
    "guided": Method(
        summary="a spatial cache learns directions, shares, roulette and shadow rays at every vertex", cache=True
    ),
    "cells": Method(
        summary="a mixture of strategies at every vertex: shares by cells of a spatial cache, Newton on the simplex",
        cache=True,
        by_cells=True,
    ),
    "auto": Method(summary="guided where a trial finds that it pays, else nee (the default)", cache=True, tries=True),
}
