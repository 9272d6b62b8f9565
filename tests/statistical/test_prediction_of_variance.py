"""The variance that moments promise is the variance that is then observed, choices of strategy drawn at random."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import scenes

import warpmis
from warpmis.device.film_buffers import download_film
from warpmis.device.upload import upload
from warpmis.kernels.moments import SHADOW_RAY_COST
from warpmis.learn.schedule import Round
from warpmis.rendering.integrator import Integrator, allocation_of
from warpmis.scene.features import detect

PIXELS = 12
SPP = 768
SEEDS = 14
# No path of this many bounces ends by Russian roulette, whose odds depend on the throughput f / p_a, so on the shares.
BEFORE_ROULETTE = 2
SHARES = (0.2, 0.5, 0.9)
SIGNIFICANCE = 0.01
INDEPENDENT = {"strategy_choice": "random", "sampler": "independent"}


def learned_from(
    method: str,
    seed: int,
    spp: int = SPP,
    scene: warpmis.Scene | None = None,
    max_depth: int = BEFORE_ROULETTE,
    **settings: object,
) -> Integrator:
    """One learn round, and no step after it. With a target error all pixels learn, by any method."""
    scene = scene or scenes.lit_ceiling(PIXELS)
    config = warpmis.RenderConfig(
        method=method, spp=spp, seed=seed, max_depth=max_depth, target_error=0.5, **INDEPENDENT, **settings
    )
    features = detect(scene).with_strategies(config.strategies, config.how.statistics).with_sampler(config.sampler)
    run = Integrator(upload(scene, "cpu"), features, config, allocation_of(config, PIXELS, PIXELS))
    run.trace(Round(0, spp, learn=True), lambda samples: None)
    return run


def test_second_moment_of_the_samples_own_allocation() -> None:
    """sum_s a_s m_s is the second moment of the very samples, since sum_s a_s q_s = 1 for each: no statistics."""
    shares = np.array([0.3, 0.7])
    run = learned_from("murray20", seed=1, spp=128, learn=warpmis.LearnConfig(initial_allocation=tuple(shares)))
    film = download_film(run.learn_film, PIXELS, PIXELS)
    second = (run.learner.moments.numpy()[:, :2] @ shares).reshape(PIXELS, PIXELS)
    assert second == pytest.approx(film.luminance_m2 + 128 * film.luminance_mean**2, rel=1e-4)


def without_walls() -> warpmis.Scene:
    """Floor and ceiling alone: a path towards a lamp ends sooner or later than one that the BSDF sends on."""
    floor, ceiling, *_ = scenes.box_faces((-1, 0, -1), (1, 2, 1), inward=True)
    return dataclasses.replace(scenes.lit_ceiling(PIXELS), geometry=scenes.quads([(floor, 0), (ceiling, 0)]))


def test_predicted_cost_is_observed() -> None:
    """Rays of a path at other shares, in units of a path's ray: from samples of equal ones, to 1 %."""
    scene = without_walls()
    run = learned_from("cost-aware", seed=1, scene=scene)
    start = run.learner.layout.offset("cost")
    cost = run.learner.moments.numpy()[:, start : start + 2].sum(axis=0) / (SPP * PIXELS**2)
    for share in (0.1, 0.9):
        learn = warpmis.LearnConfig(initial_allocation=(share, 1.0 - share))
        other = learned_from("cost-aware", seed=2, scene=scene, learn=learn)
        spent = other.learn_film.rays.numpy().sum() + SHADOW_RAY_COST * other.learn_film.shadow_rays.numpy().sum()
        assert cost @ (share, 1.0 - share) == pytest.approx(spent / (SPP * PIXELS**2), rel=0.01)
    assert abs(cost[0] / cost[1] - 1.0) > 0.05
