"""What one number of the lattice decides at the first vertex: the strategy, and within it the light and the lobe.

Each light and each lobe gets its part of a pixel's samples to within one, so that nothing is left of the noise that
choosing at random makes. A light of one colour beside one of another shows it: who was chosen colours the sample.
"""

from __future__ import annotations

import numpy as np
import pytest
import scenes
import warp as wp

import warpmis
from warpmis.kernels.bsdf.surface import Surface, make_surface
from warpmis.kernels.lattice import choice
from warpmis.kernels.light.table import make_lights
from warpmis.kernels.rng import RngKey, vec_lattice
from warpmis.kernels.strategies import make_strategies
from warpmis.rendering.generating_vector import lattice_steps
from warpmis.scene import DistantLight, DomeLight, Light, Material, Scene
from warpmis.scene.features import Features

features = Features.all().with_strategies(("bsdf", "light", "cosine"))
surface = make_surface(features)
strategies = make_strategies(features, surface, make_lights(features))
vec_s = strategies.vec_s

SPP = 64
SEEDS = 24
# Luminances of 3 to 1: the red light gets 48 of 64 samples, the blue one 16.
RED_LIGHT = np.array([3.0 / 0.2126, 0.0, 0.0])
BLUE_LIGHT = np.array([0.0, 0.0, 1.0 / 0.0722])


@wp.kernel(enable_backward=False)
def choose_all(allocation: vec_s, steps: vec_lattice, chosen: wp.array(dtype=int), remapped: wp.array(dtype=float)):
    key = RngKey()
    key.sample = wp.uint32(wp.tid())
    key.lattice = steps
    u = choice(key)
    strategy = strategies.choose(allocation, u)
    chosen[wp.tid()] = strategy
    remapped[wp.tid()] = strategies.remapped(allocation, strategy, u)


@pytest.mark.parametrize("shares", [(0.25, 0.5, 0.25), (0.0, 0.375, 0.625), (0.0, 1.0, 0.0), (0.0, 0.0, 0.0)])
def test_the_remapped_number_is_equidistant_for_each_strategy(shares: tuple[float, ...]) -> None:
    chosen, remapped = wp.zeros(SPP, dtype=int), wp.zeros(SPP, dtype=float)
    wp.launch(choose_all, SPP, [vec_s(*shares), vec_lattice(*lattice_steps(SPP)), chosen, remapped])
    by, numbers = chosen.numpy(), remapped.numpy().astype(float)
    assert numbers.min() >= 0.0 and numbers.max() < 1.0
    whole = sum(shares) > 0.0
    for strategy, share in enumerate(shares) if whole else [(-1, 1.0)]:
        own = np.sort(numbers[by == strategy])
        assert len(own) == round(share * SPP)
        if len(own):
            np.testing.assert_allclose(np.diff(own, append=own[0] + 1.0), 1.0 / len(own), atol=1e-5)


@wp.kernel(enable_backward=False)
def choose_lobes(parts: wp.vec3, steps: vec_lattice, lobes: wp.array(dtype=int), remapped: wp.array(dtype=float)):
    s = Surface()
    s.p_diffuse = parts[0]
    s.p_specular = parts[1]
    s.p_coat = parts[2]
    key = RngKey()
    key.sample = wp.uint32(wp.tid())
    key.lattice = steps
    u = choice(key)
    lobes[wp.tid()] = wp.where(u < parts[0], 0, wp.where(u < parts[0] + parts[1], 1, 2))
    remapped[wp.tid()] = surface.remapped(s, u)


@pytest.mark.parametrize("parts", [(0.25, 0.5, 0.25), (0.0, 0.375, 0.625), (1.0, 0.0, 0.0), (0.75, 0.25, 0.0)])
def test_the_remapped_number_is_equidistant_for_each_lobe(parts: tuple[float, ...]) -> None:
    lobes, remapped = wp.zeros(SPP, dtype=int), wp.zeros(SPP, dtype=float)
    wp.launch(choose_lobes, SPP, [wp.vec3(*parts), vec_lattice(*lattice_steps(SPP)), lobes, remapped])
    by, numbers = lobes.numpy(), remapped.numpy().astype(float)
    assert numbers.min() >= 0.0 and numbers.max() < 1.0
    for lobe, part in enumerate(parts):
        own = np.sort(numbers[by == lobe])
        assert len(own) == round(part * SPP)
        if len(own):
            np.testing.assert_allclose(np.diff(own, append=own[0] + 1.0), 1.0 / len(own), atol=1e-5)


def floor_under(lights: list[Light], material: Material = scenes.WHITE) -> Scene:
    """One pixel of an endless floor, seen from above."""
    corners = np.array([(-9, 0, 9), (9, 0, 9), (9, 0, -9), (-9, 0, -9)], dtype=np.float32)
    view = scenes.camera((0, 1, 0), (0, 0, 0), half_width=0.01)
    return scenes.scene(scenes.quads([(corners, 0)]), [material], lights, view, pixels=1)


def distant(radiance: np.ndarray, half_angle: float, side: float) -> DistantLight:
    """To one side of the vertical: a ray that meets one of two such lights does not meet the other."""
    return DistantLight("/distant", np.array([0.6 * side, 0.8, 0.0]), half_angle, radiance)


def spread(scene: Scene, channel: int, **settings: object) -> float:
    """Relative standard deviation of one colour over the seeds."""
    values = [
        warpmis.render(scene, spp=SPP, seed=seed, max_depth=1, **settings).image[0, 0, channel] for seed in range(SEEDS)
    ]
    assert np.mean(values) > 0.0
    return float(np.std(values, ddof=1) / np.mean(values))


@pytest.mark.parametrize("half_angle", [0.0, 0.01])
@pytest.mark.parametrize("settings", [{"method": "nee"}, {"method": "fixed", "allocation": (0.5, 0.5)}])
def test_each_light_gets_its_part_of_the_samples(half_angle: float, settings: dict[str, object]) -> None:
    """Exactly, since it is a whole number; at random it is one of 16 more or less than that, by a fifth."""
    scene = floor_under([distant(RED_LIGHT, half_angle, 1.0), distant(BLUE_LIGHT, half_angle, -1.0)])
    at_random = spread(scene, 2, strategy_choice="random", **settings)
    assert 0.1 < at_random < 0.5  # sqrt(3 / 64) = 0.22 by next-event estimation, more where half are drawn by the BSDF
    assert spread(scene, 2, **settings) < 0.02 * at_random


def test_each_lobe_gets_its_part_of_the_samples() -> None:
    """To within one: what the specular lobe sends on is blue, and none of the diffuse lobe's is."""
    material = Material("/lacquer", diffuse_color=(0.5, 0.0, 0.0), roughness=0.1, ior=2.0)
    scene = floor_under([DomeLight("/dome", np.eye(3), np.ones(3))], material)
    at_random = spread(scene, 2, method="bsdf", strategy_choice="random")
    assert spread(scene, 2, method="bsdf") < 0.35 * at_random
