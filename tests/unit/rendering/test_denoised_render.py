"""A render with a denoised picture: two halves, the mean of which is the noisy picture."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scenes
from numpy.typing import NDArray

import warpmis
from warpmis import ConfigError, Interrupted, Progress
from warpmis.film.metrics import relative_mse
from warpmis.output.exr import read_exr
from warpmis.rendering import halves
from warpmis.rendering.shutter import divided

pytest.importorskip("pyoidn")

SETTINGS: dict[str, Any] = {"method": "nee", "width": 32, "threads": 1}


def scene() -> warpmis.Scene:
    return scenes.room()


@pytest.fixture(scope="module")
def truth() -> NDArray[np.float32]:
    return warpmis.render(scene(), spp=4096, seed=9, **SETTINGS).image


def test_noisy_picture_is_the_mean_of_two_renders_with_seeds_of_their_own() -> None:
    config = warpmis.RenderConfig(spp=9, seed=3, **SETTINGS)
    result = warpmis.render(scene(), spp=9, seed=3, denoise=True, **SETTINGS)
    first, second = (warpmis.render(scene(), config=half) for half in divided(config, 2, halves.SEED_STEP))
    assert first.settings["seed"] != second.settings["seed"]
    weights = np.array([4.0, 5.0]) / 9.0
    np.testing.assert_allclose(result.image, weights[0] * first.image + weights[1] * second.image, rtol=1e-5, atol=1e-7)
    assert (result.samples == 9).all()
    assert result.settings["spp"] == 9 and result.settings["seed"] == 3 and result.settings["denoise"] is True
    assert "shutter_samples" not in result.settings


def test_denoised_picture_is_nearer_to_the_truth_and_says_how_near(truth: NDArray[np.float32]) -> None:
    result = warpmis.render(scene(), spp=16, denoise=True, **SETTINGS)
    assert result.denoised is not None and result.shown is result.denoised
    assert relative_mse(result.denoised, truth) < 0.5 * relative_mse(result.image, truth)
    stats = result.stats["denoise"]
    assert relative_mse(result.denoised, truth) ** 0.5 < stats["relative_error_bound"]
    assert stats["seconds"] > 0.0


def test_same_seed_same_bits() -> None:
    one, other = (warpmis.render(scene(), spp=8, denoise=True, **SETTINGS) for _ in range(2))
    np.testing.assert_array_equal(one.image, other.image)
    np.testing.assert_array_equal(one.denoised, other.denoised)


def test_plain_render_has_no_denoised_picture() -> None:
    result = warpmis.render(scene(), spp=4, **SETTINGS)
    assert result.denoised is None and result.shown is result.image
    assert not any(name.startswith("denoised") for name in result.channels())
    assert "denoise" not in result.stats


def test_layer_in_the_file(tmp_path: Path) -> None:
    result = warpmis.render(scene(), spp=4, denoise=True, **SETTINGS)
    result.write(tmp_path / "a.exr")
    channels, header = read_exr(tmp_path / "a.exr")
    assert result.denoised is not None
    np.testing.assert_array_equal(channels["denoised.G"], result.denoised[..., 1])
    np.testing.assert_array_equal(channels["G"], result.image[..., 1])
    assert header["denoise"] == 1


def test_progress_goes_on_over_both_halves() -> None:
    reports: list[Progress] = []
    result = warpmis.render(scene(), spp=8, denoise=True, progress=reports.append, **SETTINGS)
    done = [report.done for report in reports]
    assert done == sorted(done)
    assert reports[-1].done == reports[-1].total == result.stats["samples"]
    assert {report.detail[:8] for report in reports if report.phase != "compile"} == {"half 1/2", "half 2/2"}
    assert {report.total for report in reports if report.total} == {result.stats["samples"]}


def test_target_error_is_that_of_the_noisy_picture(truth: NDArray[np.float32]) -> None:
    result = warpmis.render(scene(), target_error=0.1, spp=4096, denoise=True, **SETTINGS)
    assert result.settings["target_error"] == 0.1
    assert 0.02 < relative_mse(result.image, truth) ** 0.5 < 0.1


def test_interrupted_render_keeps_the_noisy_picture() -> None:
    def stop(report: Progress) -> None:
        if report.detail.startswith("half 2/2") and report.done > 32 * 24 * 8 // 2:
            raise KeyboardInterrupt

    with pytest.raises(Interrupted) as caught:
        warpmis.render(scene(), spp=4096, denoise=True, progress=stop, **SETTINGS)
    result = caught.value.result
    assert result.denoised is None
    assert result.samples.min() >= 2048
    assert any("not denoised" in note for note in result.notes)


def test_one_sample_is_too_few() -> None:
    with pytest.raises(ConfigError, match="two samples per pixel"):
        warpmis.render(scene(), spp=1, denoise=True, **SETTINGS)


def test_missing_package_is_said_before_the_render(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    with pytest.raises(ConfigError, match=r"pip install 'warpmis\[denoise\]'"):
        warpmis.render(scene(), spp=4096, denoise=True, **SETTINGS)
