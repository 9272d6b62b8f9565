"""The denoised picture and its error without a reference, with filters whose truth is known."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from warpmis.film import denoise as module
from warpmis.film.denoise import Half, Halves, blur_of_others, denoise, tile_means
from warpmis.film.metrics import relative_mse, squared_error, squared_scale

Array = NDArray[Any]
SIZE = 64


def truth() -> Array:
    """A bright and a dark half with a soft ramp over both, shape (64, 64, 3)."""
    row = np.linspace(0.5, 1.0, SIZE)
    picture = np.where(np.arange(SIZE) < SIZE // 2, 0.2, 1.0)[np.newaxis, :] * row[:, np.newaxis]
    return picture[..., np.newaxis] * np.array([1.0, 0.8, 0.5])


def halves(seed: int, looks: float) -> tuple[Half, Half]:
    """Two pictures whose noise is that of a mean of `looks` exponential numbers: relative variance 1 / looks."""
    rng = np.random.default_rng(seed)
    flat = np.zeros((SIZE, SIZE, 3), np.float32)
    images = [truth() * rng.gamma(looks, 1.0 / looks, (SIZE, SIZE, 1)) for _ in range(2)]
    first, second = (Half(image.astype(np.float32), flat, flat) for image in images)
    return first, second


def blurred(image: Array, albedo: Array, normal: Array) -> Array:
    """A filter: the mean with the neighbours, which smears the edge in the middle."""
    padded = np.pad(image, ((1, 1), (1, 1), (0, 0)), mode="edge")
    return sum(padded[r : r + SIZE, c : c + SIZE] for r in range(3) for c in range(3)) / 9.0


def grey(image: Array, albedo: Array, normal: Array) -> Array:
    """A filter that throws the picture away."""
    return np.full_like(image, image.mean())


def true_error(image: Array) -> float:
    return float((squared_error(image, truth()) / squared_scale(image)).mean())


def estimates(apply: Callable[..., Array], looks: float, seeds: int, leak: float = 0.0) -> dict[str, Array]:
    """What 100 renders tell: estimated less true relMSE, the standard error told, and the noisy picture's relMSE.

    leak: so much of the other half gets into each half before it is filtered, which must not be.
    """
    found = []
    for seed in range(seeds):
        first, second = halves(seed, looks)

        def filtered(image: Array, albedo: Array, normal: Array, pair: tuple[Half, Half] = (first, second)) -> Array:
            other = pair[1] if image is pair[0].image else pair[0]
            return apply((1.0 - leak) * image + leak * other.image, albedo, normal)

        result = denoise(first, second, filtered)
        error = result.error
        found.append((error.denoised - true_error(result.image), error.standard_error, error.noisy))
    return dict(zip(("apart", "standard_error", "noisy"), np.array(found).T, strict=True))


def mean_of(apart: Array) -> tuple[float, float]:
    """The mean and its standard error."""
    return float(apart.mean()), float(apart.std(ddof=1) / np.sqrt(len(apart)))


@pytest.mark.parametrize("looks", [10.0, 100.0])
def test_error_without_blending_is_estimated_without_bias(looks: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """A z-test over 100 pictures, which would find a bias of 3 % of the noisy picture's error."""
    monkeypatch.setattr(module, "blend_weight", lambda halves: np.zeros(halves.noisy.shape[:2]))
    found = estimates(blurred, looks, 100)
    mean, standard_error = mean_of(found["apart"])
    assert abs(mean) < 3.3 * standard_error
    assert 5.0 * standard_error < 0.03 * found["noisy"].mean()


@pytest.mark.parametrize("looks", [10.0, 100.0])
def test_error_with_blending_reads_low_by_little(looks: float) -> None:
    """The weights come from the same halves. That costs 1.2 % of the noisy error, 0.3 % with less noise."""
    found = estimates(blurred, looks, 100)
    mean, standard_error = mean_of(found["apart"])
    assert abs(mean) + 2.0 * standard_error < 0.025 * found["noisy"].mean()


def test_error_is_biased_where_a_half_looks_at_the_other() -> None:
    found = estimates(blurred, 10.0, 100, leak=0.3)
    mean, standard_error = mean_of(found["apart"])
    assert mean < -10.0 * standard_error and mean < -0.05 * found["noisy"].mean()


def test_standard_error_covers_the_truth() -> None:
    """Within two standard errors in 95 of 100 pictures by theory; 88 is 3.2 standard deviations below."""
    found = estimates(blurred, 10.0, 100)
    assert (np.abs(found["apart"]) < 2.0 * found["standard_error"]).sum() >= 88


@pytest.mark.parametrize("looks", [1.0, 10.0, 100.0, 10000.0])
@pytest.mark.parametrize("apply", [blurred, grey], ids=["blur", "grey"])
def test_never_worse_than_the_noisy_picture(apply: Callable[..., Array], looks: float) -> None:
    ratios = []
    for seed in range(5):
        first, second = halves(seed, looks)
        noisy = (first.image + second.image) / 2.0
        ratios.append(relative_mse(denoise(first, second, apply).image, truth()) / relative_mse(noisy, truth()))
    assert max(ratios) < 1.02


def test_denoises() -> None:
    first, second = halves(0, 10.0)
    noisy = (first.image + second.image) / 2.0
    result = denoise(first, second, blurred)
    assert relative_mse(result.image, truth()) < 0.4 * relative_mse(noisy, truth())
    assert result.error.denoised < 0.5 * result.error.noisy
    assert result.error.bound == pytest.approx(np.sqrt(result.error.denoised + 2.0 * result.error.standard_error))


def test_noisy_picture_where_filtering_lost_beyond_doubt(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "blend_weight", lambda halves: np.zeros(halves.noisy.shape[:2]))
    first, second = halves(0, 1e4)
    result = denoise(first, second, grey)
    np.testing.assert_allclose(result.image, (first.image + second.image) / 2.0, rtol=1e-6)
    assert result.error.denoised == result.error.noisy


def test_blend_weight_sees_the_others_and_not_its_own_pixel(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(1)
    noisy, mean, apart = (rng.uniform(0.5, 1.5, (16, 16, 3)) for _ in range(3))
    # With equal weights in the blurs and nothing taken off, what is left is the quotient of two blurs.
    monkeypatch.setattr(module, "squared_scale", lambda image: np.full(image.shape[:2], 1e30))
    monkeypatch.setattr(module, "CAUTION", 0.0)
    before = module.blend_weight(Halves(noisy, 0.3 * apart, mean, 0.0 * apart))
    changed = noisy.copy()
    changed[8, 8] += 0.5
    moved = np.abs(module.blend_weight(Halves(changed, 0.3 * apart, mean, 0.0 * apart)) - before)
    assert moved[8, 7] > 1e-3
    assert moved[8, 8] < 1e-12


def test_blur_leaves_out_the_pixel_and_keeps_constants() -> None:
    point = np.zeros((31, 31))
    point[15, 15] = 1.0
    spread = blur_of_others(point, 1.5)
    assert spread[15, 15] == pytest.approx(0.0, abs=1e-15)
    assert spread.sum() == pytest.approx(1.0, rel=1e-3)
    assert spread[15, 16] / spread[15, 17] == pytest.approx(np.exp((4.0 - 1.0) / (2.0 * 1.5**2)))
    np.testing.assert_allclose(blur_of_others(np.full((3, 40), 2.5), 2.0), 2.5)


def test_tiles_at_the_edge_are_smaller() -> None:
    values = np.arange(9.0 * 10.0).reshape(9, 10)
    expected = [values[:8, :8].mean(), values[:8, 8:].mean(), values[8:, :8].mean(), values[8:, 8:].mean()]
    np.testing.assert_allclose(tile_means(values), expected)


@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (20, 20)])
@pytest.mark.parametrize("level", [0.0, 1e-12, 1e12])
def test_any_picture_gives_numbers(shape: tuple[int, int], level: float) -> None:
    rng = np.random.default_rng(2)
    first, second = (
        Half(*(level * rng.uniform(0.0, 1.0, (*shape, 3)).astype(np.float32) for _ in range(3))) for _ in range(2)
    )
    result = denoise(first, second, grey)
    assert np.isfinite(result.image).all()
    assert np.isfinite([result.error.denoised, result.error.noisy, result.error.standard_error]).all()
    assert result.image.min() >= 0.0


def test_oidn_takes_noise_away_and_keeps_an_edge() -> None:
    pytest.importorskip("pyoidn")
    from warpmis.film.oidn import filter_with_oidn

    first, second = halves(3, 2.0)
    albedo = truth().astype(np.float32)
    first, second = (Half(half.image, albedo, half.normal) for half in (first, second))
    result = denoise(first, second, filter_with_oidn)
    noisy = (first.image + second.image) / 2.0
    assert relative_mse(result.image, truth()) < 0.05 * relative_mse(noisy, truth())
    left, right = result.image[:, SIZE // 2 - 2].mean(), result.image[:, SIZE // 2 + 1].mean()
    assert right / left == pytest.approx(5.0, rel=0.15)
