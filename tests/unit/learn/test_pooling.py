"""Pooling: against a twin in NumPy, and what it must not do over edges and between bright and dark."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import warp as wp

from warpmis.device.film_buffers import allocate_film
from warpmis.device.views import FilmView
from warpmis.kernels.moments import Layout
from warpmis.learn import neighbours
from warpmis.learn.learner import Learner
from warpmis.learn.pooling import ALBEDO_SPREAD, DEPTH_SPREAD, FLOOR, LEAST_SIMILARITY, NORMAL_SPREAD, PRIOR
from warpmis.methods import METHODS

WIDTH, HEIGHT = 24, 10
PIXELS = WIDTH * HEIGHT
LAYOUT = Layout(2, METHODS["pooled"].statistics)
MEAN = LAYOUT.offset("mean")
SAMPLES = 8


def film_of(
    normal: Any = (0.0, 0.0, 1.0), albedo: Any = 0.5, depth: Any = 2.0, hits: Any = SAMPLES, samples: Any = SAMPLES
) -> FilmView:
    """A film of mean guides, one for all pixels or one each; what is not hit has none."""
    film = allocate_film(PIXELS, "cpu")
    hits, samples = np.broadcast_to(hits, PIXELS), np.broadcast_to(samples, PIXELS)
    normals = np.broadcast_to(normal, (PIXELS, 3)) * hits[:, None]
    albedos = np.broadcast_to(np.reshape(albedo, (-1, 1)), (PIXELS, 3)) * samples[:, None]
    film.normal = wp.array(normals, dtype=wp.vec3d, device="cpu")
    film.albedo = wp.array(albedos, dtype=wp.vec3d, device="cpu")
    film.depth = wp.array(np.broadcast_to(depth, PIXELS) * hits, dtype=wp.float64, device="cpu")
    film.hits = wp.array(hits.astype(np.int32), dtype=wp.int32, device="cpu")
    film.accepted = wp.array(samples.astype(np.int32), dtype=wp.int32, device="cpu")
    return film


def pooled(moments: np.ndarray, film: FilmView, radius: int = 4) -> np.ndarray:
    """The relative moments, shape (PIXELS, K)."""
    method = replace(METHODS["pooled"], pool_radius=radius)
    learner = Learner(method, ("bsdf", "light"), (WIDTH, HEIGHT), True, "cpu")
    learner.moments.assign(moments)
    shares = wp.array(np.full((PIXELS, 2), 0.5, np.float32), dtype=wp.vec2, device="cpu")

    def launch(kernel: wp.Kernel, inputs: list[Any]) -> None:
        wp.launch(kernel, dim=PIXELS, inputs=[0, *inputs], device="cpu")

    learner.step(shares, film, launch)
    return learner.neighbours.pooled.numpy()


def random_moments(seed: int, samples: Any = SAMPLES) -> np.ndarray:
    """Sums of moments whose power is that of a radiance of 1."""
    return np.random.default_rng(seed).uniform(0.5, 1.5, (PIXELS, LAYOUT.size)) * np.reshape(samples, (-1, 1))


def brightened(moments: np.ndarray, radiance: np.ndarray) -> np.ndarray:
    """The moments, had each pixel's radiance been multiplied."""
    powers = np.array([LAYOUT.power(k) for k in range(LAYOUT.size)])
    return moments * radiance[:, None] ** powers


def relative(moments: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """Per sample, over the power of the mean of the 3 x 3 pixels about each."""
    powers = np.array([LAYOUT.power(k) for k in range(LAYOUT.size)])
    picture = np.arange(PIXELS).reshape(HEIGHT, WIDTH)
    floor = FLOOR * moments[:, MEAN].sum() / samples.sum()
    rows = np.zeros_like(moments)
    for y in range(HEIGHT):
        for x in range(WIDTH):
            near = picture[max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2].ravel()
            brightness = moments[near, MEAN].sum() / samples[near].sum() + floor
            here = picture[y, x]
            rows[here] = moments[here] / samples[here] / brightness**powers
    return rows


def twin(moments: np.ndarray, guides: dict[str, np.ndarray], samples: np.ndarray, radius: int) -> np.ndarray:
    """Rows first, then columns of what the rows gave; the mean of all joins in at the end."""
    own = relative(moments, samples)
    means, weights = own, np.ones(PIXELS)
    picture = np.arange(PIXELS).reshape(HEIGHT, WIDTH)
    for lines in (picture, picture.T):
        pooled_means, pooled_weights = np.zeros_like(means), np.zeros(PIXELS)
        for line in lines:
            for at, here in enumerate(line):
                for other in line[max(at - radius, 0) : at + radius + 1]:
                    apart = ((guides["normal"][here] - guides["normal"][other]) ** 2).sum() / NORMAL_SPREAD
                    apart += 3.0 * (guides["albedo"][here] - guides["albedo"][other]) ** 2 / ALBEDO_SPREAD
                    apart += ((1.0 - guides["depth"][other] / guides["depth"][here]) / DEPTH_SPREAD) ** 2
                    weight = np.exp(-apart) * weights[other]
                    if weight > LEAST_SIMILARITY:
                        pooled_means[here] += weight * means[other]
                        pooled_weights[here] += weight
        means, weights = pooled_means / pooled_weights[:, None], pooled_weights
    prior = PRIOR / samples.max()
    return (means * weights[:, None] + prior * own.mean(axis=0)) / (weights + prior)[:, None]


@pytest.mark.parametrize("radius", [2, 4])
def test_equals_numpy_twin(radius: int) -> None:
    rng = np.random.default_rng(radius)
    tilt = rng.normal(0.0, 0.1, (PIXELS, 2))
    normal = np.column_stack([tilt, np.sqrt(1.0 - (tilt**2).sum(axis=1))])
    guides = {"normal": normal, "albedo": rng.uniform(0.4, 0.6, PIXELS), "depth": rng.uniform(2.0, 2.4, PIXELS)}
    samples = rng.integers(1, 9, PIXELS)
    moments = brightened(random_moments(1, samples), rng.lognormal(size=PIXELS))
    result = pooled(moments, film_of(**guides, hits=samples, samples=samples), radius)
    assert result == pytest.approx(twin(moments, guides, samples, radius), rel=1e-4)


def test_constant_picture_keeps_its_own() -> None:
    """Relative to a mean of 3 + 3 FLOOR; pooling neighbours that are all alike changes nothing."""
    of_one = np.arange(2.0, 2.0 + LAYOUT.size)
    of_one[MEAN] = 3.0
    result = pooled(np.tile(SAMPLES * of_one, (PIXELS, 1)), film_of())
    expected = of_one / (3.0 * (1.0 + FLOOR)) ** np.array([LAYOUT.power(k) for k in range(LAYOUT.size)])
    assert result == pytest.approx(np.tile(expected, (PIXELS, 1)), rel=1e-6)


LEFT = np.arange(PIXELS) % WIDTH < WIDTH // 2
EDGES = {
    "normal": {"normal": np.where(LEFT[:, None], (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))},
    "albedo": {"albedo": np.where(LEFT, 0.2, 0.8)},
    "depth": {"depth": np.where(LEFT, 2.0, 3.0)},
    "silhouette": {"hits": np.where(LEFT, SAMPLES, 0)},
}


@pytest.fixture
def alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the whole picture's mean, which knows no edges."""
    monkeypatch.setattr(neighbours, "PRIOR", 0.0)


@pytest.mark.usefixtures("alone")
@pytest.mark.parametrize("edge", EDGES)
def test_nothing_bleeds_over_an_edge(edge: str) -> None:
    """Other moments right of the edge change nothing left of it, but for the brightness that both sides share."""
    moments, other = random_moments(1), random_moments(2)
    other[:, MEAN] = moments[:, MEAN]
    mixed = np.where(LEFT[:, None], moments, other)
    assert np.array_equal(pooled(mixed, film_of(**EDGES[edge]))[LEFT], pooled(moments, film_of(**EDGES[edge]))[LEFT])
    # Without the edge it does, as far as the square reaches.
    changed = (pooled(mixed, film_of()) != pooled(moments, film_of())).any(axis=1).reshape(HEIGHT, WIDTH).any(axis=0)
    assert np.flatnonzero(changed).min() == WIDTH // 2 - 4


@pytest.mark.usefixtures("alone")
@pytest.mark.parametrize("factor", [1e-3, 1e3])
def test_brightness_of_one_half_makes_no_difference(factor: float) -> None:
    """But where a pixel's 3 x 3 has both, and but for the floor: 1e-3 of the picture's mean, which is half as bright
    as its brighter half, so at least as bright as half of it."""
    moments = random_moments(1)
    uneven = brightened(moments, np.where(LEFT, 1.0, factor))
    column = np.arange(PIXELS) % WIDTH
    bright = LEFT if factor < 1.0 else ~LEFT
    far = bright & ((column < WIDTH // 2 - 5) | (column >= WIDTH // 2 + 5))
    assert far.sum() > 40
    assert pooled(uneven, film_of())[far] == pytest.approx(pooled(moments, film_of())[far], rel=3e-3)


@pytest.mark.usefixtures("alone")
def test_dark_half_counts_as_much_as_the_bright_one() -> None:
    """Two halves of different second moments, one 20 times as bright: between them each pixel counts once."""
    moments = np.full((PIXELS, LAYOUT.size), float(SAMPLES))
    moments[:, 0] *= np.where(LEFT, 1.0, 3.0)
    even, uneven = (pooled(brightened(moments, np.where(LEFT, 1.0, factor)), film_of()) for factor in (1.0, 1 / 20.0))
    column = np.arange(PIXELS) % WIDTH
    # Seen from here, 6 columns are to the left and 3 to the right, and those at the border share their 3 x 3.
    between = column == WIDTH // 2 - 2
    assert even[between, 0] == pytest.approx(np.full(HEIGHT, (6 * 1.0 + 3 * 3.0) / 9), rel=5e-3)
    dark, mean = 1.0 / 20.0, 0.5 * (1.0 + 1.0 / 20.0)
    before = (1.0 / ((2.0 + dark) / 3.0 + FLOOR * mean)) ** 2
    at_border = 3.0 * (dark / ((1.0 + 2.0 * dark) / 3.0 + FLOOR * mean)) ** 2
    beyond = 3.0 * (dark / (dark + FLOOR * mean)) ** 2
    expected = (5.0 / (1.0 + FLOOR * mean) ** 2 + before + at_border + 2.0 * beyond) / 9.0
    assert uneven[between, 0] == pytest.approx(np.full(HEIGHT, expected), rel=1e-6)


def test_nothing_seen_is_nothing_pooled() -> None:
    """No light and no samples: zeros, from which no solver learns."""
    assert (pooled(np.zeros((PIXELS, LAYOUT.size)), film_of()) == 0.0).all()
    assert (pooled(np.zeros((PIXELS, LAYOUT.size)), film_of(samples=0, hits=0)) == 0.0).all()
