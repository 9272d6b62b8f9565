"""The guide on the device: what it draws, its density, and which cell a vertex lies in."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from stats import chi_square

from warpmis.cache.cells import CellTree
from warpmis.cache.directions import normalised, pyramid
from warpmis.cache.spatial_cache import SpatialCache
from warpmis.device.cache_views import GUIDE_BINS, VertexRecord
from warpmis.kernels.cache.guide import from_square, guide_frame, pdf_guide, sample_guide, to_square
from warpmis.kernels.cache.lookup import make_locate

BINS = GUIDE_BINS * GUIDE_BINS
SAMPLES = 1 << 18


@wp.kernel(module="unique", enable_backward=False)
def draw(
    densities: wp.array(dtype=wp.float32),
    cell: int,
    n: wp.vec3,
    numbers: wp.array(dtype=wp.vec2),
    directions: wp.array(dtype=wp.vec3),
    drawn: wp.array(dtype=wp.vec2),
    found: wp.array(dtype=wp.vec2),
    pdfs: wp.array(dtype=wp.float32),
):
    """What is drawn by each pair of numbers, where in the square it is found again, and with which density."""
    i = wp.tid()
    frame = guide_frame(n)
    drawn[i] = sample_guide(densities, cell, numbers[i][0], numbers[i][1])
    directions[i] = from_square(frame, drawn[i][0], drawn[i][1])
    found[i] = to_square(frame, directions[i])
    pdfs[i] = pdf_guide(densities, cell, found[i], wp.dot(directions[i], n))


def random_densities(seed: int, cells: int = 2) -> np.ndarray:
    """Peaked ones: a few bins hold most, many next to nothing."""
    return normalised(np.random.default_rng(seed).pareto(1.0, (cells, BINS)) + 1e-3)


def run(densities: np.ndarray, cell: int, n: np.ndarray, seed: int) -> tuple[np.ndarray, ...]:
    numbers = np.random.default_rng(seed).uniform(0.0, 1.0, (SAMPLES, 2)).astype(np.float32)
    numbers = np.minimum(numbers, np.float32(1.0 - 2.0**-24))
    outputs = [wp.zeros(SAMPLES, dtype=kind, device="cpu") for kind in (wp.vec3, wp.vec2, wp.vec2, wp.float32)]
    nodes = wp.array(pyramid(densities).ravel(), dtype=wp.float32, device="cpu")
    inputs = [nodes, cell, wp.vec3(*n), wp.array(numbers, dtype=wp.vec2, device="cpu"), *outputs]
    wp.launch(draw, dim=SAMPLES, inputs=inputs, device="cpu")
    return tuple(output.numpy() for output in outputs)


def bins_of(square: np.ndarray) -> np.ndarray:
    """Morton indices, bit by bit, in another way than the kernel's."""
    column, row = np.minimum((square * GUIDE_BINS).astype(int), GUIDE_BINS - 1).T
    bits = [((column >> bit) & 1) + 2 * ((row >> bit) & 1) for bit in range(4)]
    return sum(digit << (2 * bit) for bit, digit in enumerate(bits))


NORMALS = [(0.0, 0.0, 1.0), (0.0, -1.0, 0.0), (0.48, 0.6, 0.64), (-0.6, 0.0, -0.8)]


@pytest.mark.parametrize("n", NORMALS)
@pytest.mark.parametrize("seed", range(3))
def test_directions_are_drawn_by_the_density(n: tuple[float, float, float], seed: int) -> None:
    """Chi-square over the 256 bins; twelve tests at 1e-4 each. Swapped halves of one level are found (broken once)."""
    densities = random_densities(seed)
    directions, drawn, _, _ = run(densities, 1, np.array(n), seed)
    observed = np.bincount(bins_of(drawn), minlength=BINS).astype(float)
    assert chi_square(observed, densities[1] * SAMPLES / BINS).p_value > 1e-4
    assert np.abs(np.linalg.norm(directions, axis=1) - 1.0).max() < 1e-5
    assert (directions @ np.array(n)).min() > -1e-6


@pytest.mark.parametrize("n", NORMALS)
def test_a_direction_is_found_where_it_was_drawn(n: tuple[float, float, float]) -> None:
    directions, drawn, found, pdfs = run(random_densities(3), 0, np.array(n), 3)
    inside = directions @ np.array(n) > 0.05  # at the rim the disk's radius has lost its digits
    assert np.abs(drawn - found)[inside].max() < 2e-5
    assert (bins_of(drawn) == bins_of(found))[inside].mean() > 0.999
    assert (pdfs[inside] > 0.0).all()


@pytest.mark.parametrize("seed", range(3))
def test_density_in_solid_angle_integrates_to_one(seed: int) -> None:
    """Over drawn directions the mean of 1 / density is the solid angle that they come from, by a z-test.

    That of the cap of cos > 0.2: 2 pi 0.8. The density is the host's, which the device's agrees with.
    """
    densities = random_densities(seed)
    n = np.array(NORMALS[2])
    directions, drawn, _, pdfs = run(densities, 0, n, seed)
    cosine = directions @ n
    expected = densities[0][bins_of(drawn)] * cosine / np.pi
    same = np.abs(pdfs / np.maximum(expected, 1e-20) - 1.0) < 1e-3
    assert same[cosine > 0.05].mean() > 0.999
    weights = 1.0 / np.maximum(expected, 1e-20) * np.where(cosine > 0.2, 1.0, 0.0)
    z = (weights.mean() - 2.0 * np.pi * 0.8) / (weights.std(ddof=1) / np.sqrt(SAMPLES))
    assert abs(z) < 4.0


def test_device_finds_the_cell_that_the_host_finds() -> None:
    rng = np.random.default_rng(5)
    places = np.concatenate([rng.uniform(-1.0, 1.0, (20_000, 3)), rng.standard_normal((20_000, 3))], axis=1)
    places[:, 3:] /= np.linalg.norm(places[:, 3:], axis=1, keepdims=True)
    places = places.astype(np.float32).astype(np.float64)
    tree = CellTree(extent=2.0)
    tree.refine(places, tree.find(places), stands_for=10.0)
    cache = SpatialCache(2.0, ("bsdf", "guide"), "cpu")
    cache.tree = tree
    records = np.zeros(len(places), VertexRecord.numpy_dtype())
    records["x"], records["n"] = places[:, :3], places[:, 3:]
    square = rng.uniform(0.0, 1.0, (len(places), 2)).astype(np.float32)
    records["u"], records["v"] = square.T
    records["used"] = np.arange(len(places)) % 10 != 0
    cells, bins = (wp.zeros(len(places), dtype=int, device="cpu") for _ in range(2))
    on_device = wp.array(records, dtype=VertexRecord, device="cpu")
    inputs = [0, on_device, cache.tree_view(), cells, bins]
    wp.launch(make_locate(), dim=len(places), inputs=inputs, device="cpu")
    expected = np.where(records["used"] != 0, tree.find(places), -1)
    assert tree.cells > 64
    np.testing.assert_array_equal(cells.numpy(), expected)
    used = records["used"] != 0
    np.testing.assert_array_equal(bins.numpy()[used], expected[used] * BINS + bins_of(square)[used])
