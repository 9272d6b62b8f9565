"""Next-event estimation with weights or a control of its two samples: what is learned, and what stays the same."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scenes

import warpmis
from warpmis import ConfigError, LearnConfig, RenderConfig
from warpmis.learn.schedule import Round
from warpmis.rendering import launches
from warpmis.rendering.paired import PairIntegrator

METHODS = ("variance_aware", "optimal")


def render(method: str, scene: warpmis.Scene | None = None, **settings: Any) -> warpmis.RenderResult:
    return warpmis.render(scene or scenes.room(), method=method, **{"spp": 64, "max_depth": 3, **settings})


def give(monkeypatch: pytest.MonkeyPatch, *row: float) -> None:
    """These numbers in place of what the pilot tells."""

    def solve(self: PairIntegrator, part: Round) -> None:
        self.shares.assign(np.tile(np.array(row, np.float32), (self.pixels, 1)))

    monkeypatch.setattr(PairIntegrator, "solve", solve)


@pytest.mark.parametrize(("method", "row"), [("variance_aware", (0.5, 0.5)), ("optimal", (0.0, 0.0, 0.0))])
@pytest.mark.parametrize("sampler", ["lattice", pytest.param("independent", marks=pytest.mark.slow)])
def test_equal_weights_and_no_control_are_next_event_estimation(
    method: str, row: tuple[float, ...], sampler: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Bit for bit, so none of the pilot's samples are in the picture."""
    give(monkeypatch, *row)
    ours, plain = (render(name, sampler=sampler) for name in (method, "nee"))
    np.testing.assert_array_equal(ours.image, plain.image)
    np.testing.assert_array_equal(ours.samples, plain.samples)
    pilot = 1 + 1 / 16
    assert ours.stats["rays"] == pytest.approx(pilot * plain.stats["rays"], rel=0.01)


def test_weights_are_those_of_the_two_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of direct light at depth 1: nearly all from light samples, or from those of the BSDF; between them, both."""
    settings = {"max_depth": 1, "spp": 256, "sampler": "independent"}
    found = {}
    for of_bsdf in (0.001, 0.5, 0.999):
        give(monkeypatch, of_bsdf, 1.0 - of_bsdf)
        found[of_bsdf] = render("variance_aware", **settings)
    plain, bsdf = render("nee", **settings), render("bsdf", **settings)
    assert found[0.5].variance == pytest.approx(plain.variance, rel=1e-5)
    lit = plain.image.min(axis=2) > 0.01
    # The walls see a small lamp, which BSDF samples seldom meet.
    variance = {of_bsdf: float(np.median(result.variance[lit])) for of_bsdf, result in found.items()}
    assert variance[0.999] > 3.0 * variance[0.5]
    assert variance[0.999] == pytest.approx(float(np.median(bsdf.variance[lit])), rel=0.2)
    assert found[0.001].image[lit].mean() == pytest.approx(plain.image[lit].mean(), rel=0.02)


def test_a_control_without_lights_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    """1 of the light sample and -1 of the BSDF sample, whatever the coefficient."""
    give(monkeypatch, 7.0, 8.0, 9.0)
    dark = replace(scenes.room(), lights=())
    assert not render("optimal", dark, spp=16).image.any()


def test_a_control_is_taken_off_per_colour(monkeypatch: pytest.MonkeyPatch) -> None:
    plain = render("nee").image.astype(np.float64)
    apart = {}
    for row in ((1.0, 0.0, 0.0), (0.0, 0.0, 2.0)):
        give(monkeypatch, *row)
        apart[row] = render("optimal").image - plain
    red, blue = apart.values()
    assert np.abs(red[..., 0]).max() > 1e-3 and not red[..., 1:].any()
    assert not blue[..., :2].any()
    np.testing.assert_allclose(blue[..., 2], 2.0 * red[..., 0], atol=2e-6)


@pytest.mark.parametrize("method", METHODS)
def test_maps_are_parts_of_the_two_samples(method: str) -> None:
    result = render(method, scenes.open_room(), spp=256, keep_maps=True)
    assert result.allocation.shape == (16, 16, 2)
    assert result.allocation.sum(axis=2) == pytest.approx(1.0, abs=1e-6)
    assert result.allocation.min() >= 0.0 and np.ptp(result.allocation) > 0.1
    assert len(result.round_allocations) == {"variance_aware": 4, "optimal": 1}[method]
    np.testing.assert_allclose(result.round_allocations[-1].sum(axis=2), 1.0, atol=1e-6)
    assert "excess_variance_bound" not in result.stats
    assert result.stats["seconds"]["learn"] > 0.0


@pytest.mark.parametrize("method", METHODS)
def test_same_bits_whatever_the_threads(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    reference = render(method, threads=1)
    for threads, launch in ((2, 500), (5, 7)):
        monkeypatch.setattr(launches, "CPU_LAUNCH", launch)
        monkeypatch.setattr(launches, "CPU_ROWS", launch)
        again = render(method, threads=threads)
        np.testing.assert_array_equal(again.allocation, reference.allocation)
        np.testing.assert_array_equal(again.image, reference.image)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("spp", [1, 3])
def test_few_samples_have_a_pilot_of_few(method: str, spp: int) -> None:
    result = render(method, spp=spp)
    assert (result.samples == spp).all() and np.isfinite(result.image).all()


@pytest.mark.parametrize("method", METHODS)
def test_what_the_two_samples_cannot_take_is_refused(method: str) -> None:
    with pytest.raises(ConfigError, match=f"'{method}' is for the strategies bsdf,light"):
        RenderConfig(method=method, strategies=("bsdf", "uniform"))
    with pytest.raises(ConfigError, match="drop the initial allocation"):
        RenderConfig(method=method, learn=LearnConfig(initial_allocation=(0.5, 0.5)))
    with pytest.raises(ConfigError, match="drop the number of rounds"):
        RenderConfig(method=method, learn=LearnConfig(rounds=3))
