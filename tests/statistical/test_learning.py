"""What is learned: the allocation that leaves the least variance, wherever the learning starts."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
import scenes

import warpmis

SCENES = ("cornell_box", "ajar_door", "veach_plates", "open_terrace")
FIXED = tuple(round(0.1 * tenth, 1) for tenth in range(1, 10))
ROUNDS = 8
LEARN_SPP = 1024
SPP = 2048
WIDTH = 32


def load(name: str) -> warpmis.Scene:
    return warpmis.load_stage(scenes.USD_SCENES / name / "scene.usda", width=WIDTH)


def relative_variance(result: warpmis.RenderResult, mean: np.ndarray) -> float:
    """Variance of one sample over the squared mean, averaged over the pixels that light reaches.

    Summed up as relMSE does it, so that no one bright pixel decides.
    """
    return float((result.variance / np.square(mean))[mean > 0.0].mean())


def learned(scene: warpmis.Scene, start: float, seed: int = 1) -> warpmis.RenderResult:
    return warpmis.render(
        scene,
        method="murray20",
        spp=ROUNDS * LEARN_SPP + SPP,
        learn_spp=LEARN_SPP,
        learn_rounds=ROUNDS,
        initial_allocation=(start, 1.0 - start),
        seed=seed,
    )


@pytest.mark.parametrize("name", SCENES)
def test_learned_map(name: str) -> None:
    """Variance at most 1.05 times that of the best fixed allocation, and the same map from 0.1, 0.5 and 0.9."""
    scene = load(name)
    by_start = {start: learned(scene, start) for start in (0.1, 0.5, 0.9)}
    fixed = [warpmis.render(scene, method="fixed", allocation=(a, 1.0 - a), spp=SPP, seed=1) for a in FIXED]
    mean = np.mean([result.image for result in fixed], axis=0) @ np.array([0.2126, 0.7152, 0.0722])
    best = min(relative_variance(result, mean) for result in fixed)
    ratios = {start: relative_variance(result, mean) / best for start, result in by_start.items()}

    # Where no light was found, nothing was learned: such a pixel keeps the share that it began with.
    reached = np.all([result.allocation[..., 0] != np.float32(start) for start, result in by_start.items()], axis=0)
    maps = [block_means(result.allocation[..., 0], reached) for result in by_start.values()]
    apart = max(np.abs(a - b).max() for a, b in combinations(maps, 2))
    print(f"{name}: variance / best fixed {ratios}, blocks apart by {apart:.3f}, {reached.mean():.0%} of pixels reached")
    assert max(ratios.values()) <= 1.05
    assert apart <= 0.05
    assert reached.mean() > 0.8


def block_means(share: np.ndarray, reached: np.ndarray, size: int = 8) -> np.ndarray:
    """Mean over the reached pixels of each block of size x size; blocks with fewer than a quarter of them are left."""
    rows, columns = (length // size for length in share.shape)
    of_block = reached[: rows * size, : columns * size].reshape(rows, size, columns, size)
    sums = np.where(reached, share, 0.0)[: rows * size, : columns * size].reshape(of_block.shape).sum(axis=(1, 3))
    count = of_block.sum(axis=(1, 3))
    return sums[count >= size * size / 4] / count[count >= size * size / 4]
