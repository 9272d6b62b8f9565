"""Four million samples a pixel: mean and variance are those of float64, however they are divided into rounds."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from hard.learning_cases import lit_floor, radiance_below_lamp
from numpy.typing import NDArray
from usd.stages import stage_of

import warpmis
from warpmis.kernels.accumulation import add_value

SAMPLES = 4_000_000
ROUNDS = (1, 2, 999, 98_998, 1_300_000, 2_600_000)
TOLERANCE = 1e-5


@wp.kernel(module="unique", enable_backward=False)
def accumulate(
    samples: wp.array2d(dtype=float),
    first: int,
    count: int,
    naive: int,
    film: wp.array(dtype=wp.vec2d),
    accepted: wp.array(dtype=int),
):
    """One round of a pixel as the trace kernel adds it up; `naive`: sum and sum of squares in place of the spread."""
    pixel = wp.tid()
    spread = film[pixel]
    taken = accepted[pixel]
    for k in range(count):
        y = wp.float64(samples[pixel, first + k])
        if naive != 0:
            spread += wp.vec2d(y, y * y)
        else:
            spread = add_value(spread, taken + k, y)
    film[pixel] = spread
    accepted[pixel] = taken + count


def accumulated(samples: NDArray[np.float32], naive: bool = False) -> NDArray[np.float64]:
    """Mean and variance of each pixel's samples, shape (pixels, 2)."""
    pixels = len(samples)
    values = wp.array(samples, dtype=float, device="cpu")
    film = wp.zeros(pixels, dtype=wp.vec2d, device="cpu")
    accepted = wp.zeros(pixels, dtype=int, device="cpu")
    first = 0
    for count in ROUNDS:
        wp.launch(accumulate, dim=pixels, inputs=[values, first, count, int(naive), film, accepted], device="cpu")
        first += count
    assert (accepted.numpy() == SAMPLES).all()
    found: NDArray[np.float64] = film.numpy().copy()
    if naive:
        found[:, 0] /= SAMPLES
        found[:, 1] -= SAMPLES * found[:, 0] ** 2
    return found / np.array([1.0, SAMPLES - 1.0])


def hard_samples() -> dict[str, NDArray[np.float32]]:
    """A pixel each: what a render may have to add up."""
    rng = np.random.default_rng(0)
    rare = np.where(rng.random(SAMPLES) < 1e-4, 1e4 * rng.exponential(size=SAMPLES), 1e-3)
    steps = 2.0**-13 * rng.integers(-8, 9, size=SAMPLES)  # of 16 float32 numbers about 1000
    pixels = {
        "heavy tails": rng.lognormal(0.0, 3.0, size=SAMPLES),
        "one in ten thousand": rare,
        "hardly any spread": 1000.0 + steps,
        "the brightest first": np.sort(rng.exponential(size=SAMPLES))[::-1],
        "1e30": 1e30 * rng.random(SAMPLES),
        "1e-30": 1e-30 * rng.random(SAMPLES),
    }
    return {name: values.astype(np.float32) for name, values in pixels.items()}


@pytest.fixture(scope="module")
def pixels() -> dict[str, NDArray[np.float32]]:
    return hard_samples()


def reference(samples: NDArray[np.float32]) -> NDArray[np.float64]:
    """Two passes in float64, NumPy's pairwise sums."""
    values = samples.astype(np.float64)
    return np.stack([values.mean(axis=1), values.var(axis=1, ddof=1)], axis=1)


def test_mean_and_variance_of_four_million_samples(pixels: dict[str, NDArray[np.float32]]) -> None:
    samples = np.stack(list(pixels.values()))
    relative = np.abs(accumulated(samples) / reference(samples) - 1.0)
    print(dict(zip(pixels, relative.max(axis=1), strict=True)))
    assert relative.max() < TOLERANCE


def test_naive_spread_loses_its_digits(pixels: dict[str, NDArray[np.float32]]) -> None:
    """E[x^2] - E[x]^2, in float64 even, is wrong where there is hardly any spread: that is what the case is for."""
    samples = pixels["hardly any spread"][None]
    assert np.abs(accumulated(samples, naive=True) / reference(samples) - 1.0)[0, 1] > 100.0 * TOLERANCE


@pytest.mark.slow
def test_a_render_of_four_million_samples() -> None:
    """2 x 2 pixels: the closed form within five standard errors, which are 1e-4 of it; nothing is lost on the way."""
    parts = [
        warpmis.render(stage_of(lit_floor()), width=2, spp=SAMPLES // 2, method="nee", max_depth=1, seed=seed)
        for seed in (0, 1)
    ]
    whole = warpmis.render(stage_of(lit_floor()), width=2, spp=SAMPLES, method="nee", max_depth=1, seed=0)
    assert (whole.samples == SAMPLES).all() and whole.stats["rejected_samples"] == 0
    expected = radiance_below_lamp()
    error = np.sqrt(whole.variance / SAMPLES)
    assert (error < 2e-4 * expected).all()
    assert (np.abs(whole.image[..., 0] - expected) < 5.0 * error).all()
    assert parts[0].variance == pytest.approx(whole.variance, rel=0.01)
    assert parts[1].variance == pytest.approx(whole.variance, rel=0.01)
