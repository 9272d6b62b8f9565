"""Any weights of next-event estimation's two samples, and any control of them, leave the picture unbiased.

Paired t-tests over seeds against next-event estimation, Sidak-corrected; the power is asserted too.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import scenes
from statistical.estimates import REGIONS, block_means, caught_bias, load, paired_p_values
from stats import sidak

import warpmis
from warpmis.learn.schedule import Round
from warpmis.rendering.paired import PairIntegrator
from warpmis.rendering.render import Uploads
from warpmis.scene import Material, Scene

SIGNIFICANCE = 0.01
SEEDS = 24
# Weights of bsdf and light; coefficients about as great as the pictures are bright, of which a few per cent would show.
WEIGHTS = ((0.05, 0.95), (0.9, 0.1))
CONTROL = (0.3, 0.3, 0.3)
SCENES = {"room": 0.02, "hidden_light": 0.03, "many kinds": 0.02}
CASES = [*((name, "variance_aware", row) for name in SCENES for row in WEIGHTS),
         *((name, "optimal", CONTROL) for name in SCENES)]  # fmt: skip
LEVEL = sidak(SIGNIFICANCE, len(CASES) * REGIONS)


def many_kinds() -> Scene:
    """Under a sky, with a lamp: panels that glow, one behind the other, a mirror, and panes that let paths through."""
    base = scenes.open_room(24)
    walls = scenes.box_faces((-1, 0, -1), (1, 2, 1), inward=True)
    faces = [(wall, m) for wall, m in zip(walls, [0, 0, 2, 0, 1, -1], strict=True) if m >= 0]
    faces += [(face, 3) for face in scenes.box_faces((-0.8, 0.2, -0.8), (-0.3, 0.9, -0.4), inward=False)]
    faces += [(face, 4) for face in scenes.box_faces((0.2, 0.3, -0.3), (0.6, 0.9, -0.29), inward=False)]
    # Of panels that face the camera alone so few that no tree chooses among their triangles and the lamp.
    for low, high in (((0.5, 1.2, -0.8), (0.7, 1.4, -0.6)), ((0.4, 1.2, -0.5), (0.8, 1.6, -0.4))):
        faces.append((scenes.box_faces(low, high, inward=False)[3], 5))
    mirror = Material(path="/mirror", diffuse_color=(0.8, 0.8, 0.8), metallic=1.0, roughness=0.0)
    pane = Material(path="/pane", diffuse_color=(0.3, 0.5, 0.4), opacity=0.4)
    glow = Material(path="/glow", emissive_color=(2.0, 1.0, 0.5))
    return scenes.scene(scenes.quads(faces), [*base.materials, mirror, pane, glow], list(base.lights), base.camera, 24)


def found_by(name: str, **settings: object) -> np.ndarray:
    scene, uploads = many_kinds() if name == "many kinds" else load(name), Uploads()
    pictures = (
        warpmis.render(scene, seed=seed, max_depth=3, uploads=uploads, **settings).image for seed in range(SEEDS)
    )
    return np.array([block_means(picture) for picture in pictures])


@cache
def reference_of(name: str) -> np.ndarray:
    return found_by(name, method="nee", spp=48)


@pytest.mark.parametrize(("name", "method", "row"), CASES)
def test_given_numbers(name: str, method: str, row: tuple[float, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    def solve(self: PairIntegrator, part: Round) -> None:
        self.shares.assign(np.tile(np.array(row, np.float32), (self.pixels, 1)))

    monkeypatch.setattr(PairIntegrator, "solve", solve)
    found, reference = found_by(name, method=method, spp=32), reference_of(name)
    p, caught = paired_p_values(found, reference), caught_bias(found, reference, LEVEL)
    print(f"{name}, {method} {row}: least p {p.min():.2g}, a bias of {caught:.2%} would be caught")
    assert p.min() > LEVEL
    assert caught < SCENES[name]
