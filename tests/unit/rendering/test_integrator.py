"""A render is a function of scene, settings and seed alone, and counts what it did."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import scenes
from superset import LIGHTS

import warpmis
from warpmis.device.film_buffers import download_film
from warpmis.device.upload import upload
from warpmis.learn.schedule import Round
from warpmis.methods import METHODS
from warpmis.rendering import integrator, launches
from warpmis.rendering.specialise import features_of, kernels_of
from warpmis.scene.features import Features

pytestmark = pytest.mark.own_kernels

SETTINGS = {"method": "murray20", "spp": 48, "learn_rounds": 3, "learn_spp": 8, "seed": 5}


def pictures(result: warpmis.RenderResult) -> list[np.ndarray]:
    names = ("image", "alpha", "albedo", "normal", "depth", "samples", "variance", "allocation")
    return [getattr(result, name) for name in names]


def test_image_is_equal_bit_for_bit_for_any_threads_and_tiles(monkeypatch: pytest.MonkeyPatch) -> None:
    reference = warpmis.render(scenes.room(), threads=1, **SETTINGS)
    for threads, launch in ((2, launches.CPU_LAUNCH), (3, 500), (7, 1)):
        monkeypatch.setattr(launches, "CPU_LAUNCH", launch)
        again = warpmis.render(scenes.room(), threads=threads, **SETTINGS)
        for mine, theirs in zip(pictures(again), pictures(reference), strict=True):
            assert np.array_equal(mine, theirs)


def test_rounds_go_on_where_the_last_one_stopped() -> None:
    """Two rounds hold the samples of one of the same length: none twice, for a repeated sample would bias learning.

    With independent samples: those that are spread evenly start anew each round.
    """
    config = warpmis.RenderConfig(method="balance", spp=16, strategy_choice="random", sampler="independent")

    def film_of(*parts: Round) -> np.ndarray:
        uploaded = upload(scenes.room(), "cpu")
        features = LIGHTS.with_strategies(config.strategies).with_sampler(config.sampler)
        run = integrator.Integrator(uploaded, features, config, integrator.allocation_of(config, 16, 16))
        for part in parts:
            run.trace(part, lambda samples: None)
        return download_film(run.film, 16, 16).color

    whole = film_of(Round(0, 16, learn=False))
    halves = film_of(Round(0, 8, learn=False), Round(8, 8, learn=False))
    assert halves == pytest.approx(whole, rel=1e-12)
    assert film_of(Round(0, 8, learn=False)) != pytest.approx(film_of(Round(8, 8, learn=False)), rel=1e-3)


@pytest.mark.parametrize("sampler", ["independent", "lattice"])
def test_pieces_of_a_sequence_are_rounds_of_their_own(sampler: str) -> None:
    """Else the parts of a watched render would not tell its error. Independent samples are the same either way."""
    watched = {"target_error": 0.5}
    config = warpmis.RenderConfig(method="nee", spp=16, sampler=sampler, strategy_choice="random", **watched)

    def film_of(part: Round, piece: range) -> np.ndarray:
        uploaded = upload(scenes.room(), "cpu")
        features = LIGHTS.with_strategies(()).with_sampler(sampler)
        run = integrator.Integrator(uploaded, features, config, integrator.allocation_of(config, 16, 16))
        run.trace(part, lambda samples: None, piece)
        return download_film(run.film, 16, 16).color

    piece = film_of(Round(0, 16, learn=False), range(4, 12))
    assert piece == pytest.approx(film_of(Round(4, 8, learn=False), range(4, 12)), rel=1e-12)


def test_seed_changes_the_noise() -> None:
    first, second = (warpmis.render(scenes.room(), **{**SETTINGS, "seed": seed}) for seed in (1, 2))
    assert not np.array_equal(first.image, second.image)
    assert np.mean(first.image) == pytest.approx(np.mean(second.image), rel=0.2)


def test_stats_count_samples_and_rays() -> None:
    result = warpmis.render(scenes.room(), method="balance", spp=16, max_depth=0)
    pixels = 16 * 16
    assert result.stats["samples"] == pixels * 16
    assert result.stats["rays"] == pixels * 16  # at depth 0 nothing but the camera ray is traced
    assert result.stats["rejected_samples"] == 0
    assert set(result.stats["seconds"]) == {"load", "compile", "learn", "render"}
    assert (result.samples == 16).all()


def test_universal_kernel_traces_the_same_paths() -> None:
    """Equal random numbers and equal paths: all but rounding is the same."""
    special = warpmis.render(scenes.room(), **SETTINGS)
    universal = warpmis.render(scenes.room(), features=Features.all(), **SETTINGS)
    close = np.isclose(special.image, universal.image, rtol=1e-4).all(axis=-1)
    assert close.mean() > 0.99
    assert special.image.mean() == pytest.approx(universal.image.mean(), rel=1e-3)


def test_first_hit_pictures() -> None:
    """Straight ahead, a camera in the room sees the metal back wall 1.95 away."""
    ahead = scenes.camera((0, 1, 0.95), (0, 1, -1), half_width=0.05)
    result = warpmis.render(dataclasses.replace(scenes.room(), camera=ahead), spp=16, method="nee", features=LIGHTS)
    assert result.depth == pytest.approx(1.95, abs=1e-4)
    assert result.normal == pytest.approx(np.broadcast_to((0.0, 0.0, 1.0), result.normal.shape), abs=1e-5)
    assert result.albedo == pytest.approx(np.broadcast_to((0.9, 0.8, 0.6), result.albedo.shape), abs=1e-5)
    assert (result.alpha == 1.0).all()


def test_kernels_that_differ_in_a_strategy_alone_are_two() -> None:
    """Warp's name of a module leaves out what depends on a loop's variable, the strategies' names among it."""
    uniform, cosine = (
        warpmis.render(scenes.room(), method="balance", strategies=("bsdf", "light", third), spp=16)
        for third in ("uniform", "cosine")
    )
    assert not np.array_equal(uniform.image, cosine.image)


@pytest.mark.parametrize("method", METHODS)
def test_kernels_of_a_run_have_the_same_compiler_options(method: str) -> None:
    """Warp keeps what the compiler has read of its headers for each set of options: 2 s of a first render each."""
    config = warpmis.RenderConfig(method=method, allocation=(0.5, 0.5) if method == "fixed" else None, ids=True)
    scene = scenes.room()
    modules = {kernel.module for kernel in kernels_of(features_of(scene, config), config).all}
    assert len(modules) > 2
    names = ("cpu_compiler_flags", "optimization_level", "mode", "fuse_fp")
    assert len({tuple(module.options.get(name) for name in names) for module in modules}) == 1


def test_allocation_map_must_fit_the_image() -> None:
    with pytest.raises(warpmis.ConfigError, match="8 x 4 pixels, the image 16 x 16"):
        warpmis.render(scenes.room(), method="fixed", allocation=np.full((4, 8, 2), 0.5))


def test_allocation_map_is_used_per_pixel() -> None:
    """Light sampling alone misses nothing of a room seen from its lamp's side but its noise differs per pixel."""
    shares = np.full((16, 16, 2), 0.5)
    shares[:8] = (0.1, 0.9)
    mapped = warpmis.render(scenes.room(), method="fixed", allocation=shares, spp=8)
    plain = warpmis.render(scenes.room(), method="fixed", allocation=(0.1, 0.9), spp=8)
    assert np.array_equal(mapped.image[:8], plain.image[:8])
    assert not np.array_equal(mapped.image[8:], plain.image[8:])
    assert mapped.allocation == pytest.approx(shares, abs=1e-6)


def test_device_that_is_not_there_is_named() -> None:
    with pytest.raises(warpmis.ConfigError, match="no device 'cuda:7'"):
        warpmis.render(scenes.room(), device="cuda:7")


def test_config_and_settings_exclude_each_other() -> None:
    with pytest.raises(TypeError, match="either a config or single settings"):
        warpmis.render(scenes.room(), config=warpmis.RenderConfig(), spp=4)
