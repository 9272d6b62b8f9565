"""Learning that looks at one pixel in four: who takes which samples, and that none decides on its own."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import scenes

import warpmis
from warpmis.learn.schedule import Round, schedule

STRIDE = warpmis.RenderConfig().learn_stride


def room(width: int, height: int) -> warpmis.Scene:
    return dataclasses.replace(scenes.room(), resolution=(width, height))


def plates(width: int) -> warpmis.Scene:
    """Metal in which lamps are seen: a mixture is better than next-event estimation in a third of the pixels."""
    return warpmis.load_stage(scenes.USD_SCENES / "veach_plates" / "scene.usda", width=width)


def test_the_pixels_of_the_pilot_are_those_of_next_event_estimation() -> None:
    """Its samples and those after them are one sequence: no sample is taken twice, and what is learned from it decides
    for other pixels alone. These are next-event estimation's as well where nothing else was found better."""
    assert STRIDE == 2
    scene = plates(24)
    ours, nee = (warpmis.render(scene, method=method, spp=64, seed=4) for method in ("auto", "nee"))
    np.testing.assert_allclose(ours.image[::STRIDE, ::STRIDE], nee.image[::STRIDE, ::STRIDE], rtol=1e-5, atol=1e-7)
    alike = np.isclose(ours.image, nee.image, rtol=1e-5).all(axis=-1)
    assert 0.25 < alike.mean() < 0.95  # a mixture has been found better somewhere
    assert ours.stats["next_event_pixels"] == pytest.approx(alike.mean(), abs=0.01)
    # The map tells what was learned: a pilot's pixel has what its neighbours in the cell do.
    assert ours.next_event is not None
    pilot = np.zeros(alike.shape, bool)
    pilot[::STRIDE, ::STRIDE] = True
    np.testing.assert_array_equal(ours.next_event[~pilot], alike[~pilot])
    np.testing.assert_array_equal(ours.next_event[pilot], ours.next_event[1::STRIDE, 1::STRIDE].ravel())
    assert nee.next_event is not None and (nee.next_event == 1.0).all()
    assert warpmis.render(scene, method="balance", spp=1).next_event is None


@pytest.mark.parametrize("size", [(1, 1), (7, 5), (2, 3), (16, 9)])
@pytest.mark.parametrize("spp", [1, 3, 48])
def test_every_pixel_takes_all_its_samples(size: tuple[int, int], spp: int) -> None:
    reports: list[warpmis.Progress] = []
    result = warpmis.render(room(*size), spp=spp, progress=reports.append)
    assert (result.samples == spp).all()
    assert result.stats["samples"] == spp * size[0] * size[1]
    assert np.isfinite(result.image).all()
    assert result.image.min() >= 0.0 and result.image.any()
    assert max(report.done for report in reports) <= reports[-1].total == spp * size[0] * size[1]


def test_a_cell_shares_what_its_pilot_learns() -> None:
    scene = plates(24)
    result = warpmis.render(scene, spp=64)
    height, width = result.allocation.shape[:2]
    for row in range(0, height, STRIDE):
        for column in range(0, width, STRIDE):
            cell = result.allocation[row : row + STRIDE, column : column + STRIDE].reshape(-1, 2)
            assert (cell == cell[0]).all()
    assert len(np.unique(result.allocation[..., 0])) > 1


def test_the_schedule_of_a_pilot() -> None:
    pilot, rest = schedule(warpmis.RenderConfig(spp=64))
    assert pilot == Round(0, 8, learn=True, after=56, following=64, label="round 1/1")
    assert rest == Round(0, 64, learn=False, pilot=8)
    assert pilot.sequence == rest.sequence == range(64)


def test_a_watched_render_learns_from_all_pixels() -> None:
    """Its parts need as many samples of each."""
    config = warpmis.RenderConfig(target_error=0.1)
    assert config.learn_stride == 1
    pilot, rest = schedule(config)
    assert (pilot.first_sample, pilot.samples, rest.first_sample, rest.pilot) == (0, 32, 32, 0)
