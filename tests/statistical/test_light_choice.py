"""Which light is asked, and what a ray's light counts: choice in proportion to importance, hidden lights included.

Significance is Sidak-corrected over the file.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray
from statistical.lights import (
    LOOK,
    PILOT,
    RECEIVER,
    SAMPLE,
    TURN,
    WHITE,
    distant,
    dome,
    lights,
    make_scene,
    rect,
    run,
    some_response,
    sphere,
)
from stats import chi_square, detectable_imbalance, sidak, uniformity

from warpmis.device.upload import DeviceScene, upload
from warpmis.device.views import SceneView
from warpmis.kernels import rng
from warpmis.kernels.light.distant import INFINITE_DISTANCE
from warpmis.kernels.light.records import Receiver
from warpmis.scene import Light

SIGNIFICANCE = sidak(0.01, 5 + 9)
COUNT = 1 << 19


def test_lights_that_are_hidden_count_in_the_density_but_do_not_shine() -> None:
    """The density of the light strategy is of a line, not of what can be seen along it."""
    rays = np.array([[0.0, 0.0, 1.0], [0.2, 0.1, 3.0]]) @ TURN.T
    wi = (rays / np.linalg.norm(rays, axis=1)[:, None]).astype(np.float32)
    found = (rect((0.0, 0.0, 2.0), (1.0, 0, 0), (0, 1.0, 0)), sphere((0.0, 0.0, 5.0), 1.0), dome())
    alone = upload(make_scene(*found[:1]), "cpu")
    scene = upload(make_scene(*found), "cpu")
    n = TURN[:, 2]

    def look(near: float, far: float, where: DeviceScene = scene) -> NDArray[Any]:
        return run(where, LOOK, RECEIVER, n, wi, near=near, far=far)[1]

    everything = look(0.0, INFINITE_DISTANCE)
    assert (everything["hits"] == 2).all()
    np.testing.assert_allclose(everything["radiance"], 3.0)
    for near, far, radiance in [(0.0, 1.0, 0.0), (0.0, 3.5, 1.0), (3.5, 6.0, 1.0), (1.0, 7.0, 2.0), (7.0, 9.0, 0.0)]:
        part = look(near, far)
        np.testing.assert_array_equal(part["pdf"], everything["pdf"])
        np.testing.assert_allclose(part["radiance"], radiance)
        assert (part["hits"] == radiance).all()
    # A light flush with the surface that ends the ray shines, and once only if the surface lets the ray through.
    straight = look(0.0, 2.0), look(2.0, 3.0)
    assert straight[0]["radiance"][0] == 1.0
    assert straight[1]["radiance"][0] == 0.0
    # Alone, the rect's density is 1 / its solid angle; in company it is that times the choice.
    solid_angle = 4.0 * np.arctan(1.0 / (2.0 * np.sqrt(6.0)))
    single = look(0.0, INFINITE_DISTANCE, alone)
    np.testing.assert_allclose(single["pdf"], 1.0 / solid_angle, rtol=1e-5)
    assert (everything["pdf"] > everything["choice"] / solid_angle).all()


def test_choice_among_lights_is_a_distribution() -> None:
    """Lights that differ only in brightness are chosen in proportion to it; a light that shows its back is not."""
    left = sphere((-1.0, 0.0, 2.0), 0.1)
    right = replace(sphere((1.0, 0.0, 2.0), 0.1), radiance=3.0 * WHITE)
    away = rect((0.0, 1.0, 2.0), (0, 0.5, 0), (0.5, 0, 0))
    scene = upload(make_scene(left, right, away), "cpu")
    wi, out = run(scene, SAMPLE, RECEIVER, TURN[:, 2], PILOT)
    assert (out["sampled_pdf"] > 0.0).all()
    share = (wi @ TURN[:, 0] > 0.0).mean()
    assert share == pytest.approx(0.75, abs=4.0 * np.sqrt(0.1875 / PILOT))
    np.testing.assert_allclose(out["choice"], 0.25, rtol=1e-5)


@wp.kernel(module="unique", enable_backward=False)
def choose(
    scene: SceneView,
    x: wp.vec3,
    n: wp.vec3,
    which: int,
    seed: int,
    chosen: wp.array(dtype=Receiver),
    of: wp.array(dtype=float),
):
    """The receiver's choice, once a thread; and the importance of each light, by the first thread."""
    i = wp.tid()
    key = rng.RngKey()
    key.seed = wp.uint32(seed)
    key.sample = wp.uint32(i)
    u = rng.uniform4(key, 0)
    r = lights.receiver(scene, x, n, 0, u[0], u[1], some_response(n, which))
    chosen[i] = r
    if i == 0:
        for k in range(scene.light_count):
            of[k] = lights.importance_of(scene, r, k)


def crowd(count: int) -> list[Light]:
    """Spheres about the receiver, every fifth below its horizon, brighter and dimmer by a factor of 30; the last two
    of the lights are a distant one and a dome, where there is room."""
    random = np.random.default_rng(count)
    found: list[Light] = []
    for k in range(max(1, count - 2)):
        center = random.normal(size=3)
        center[2] = (-1.0 if k % 5 == 4 else 1.0) * abs(center[2])
        made = sphere(2.0 * center / np.linalg.norm(center), 0.1)
        found.append(replace(made, radiance=WHITE * 30.0 ** random.random()))
    found += [replace(distant(3.0), radiance=WHITE * 4.0)] if count > 1 else []
    return [*found, *([replace(dome(), radiance=WHITE * 0.01)] if count > 2 else [])]


@pytest.mark.parametrize("which", [0, 1], ids=["matte", "glossy"])
@pytest.mark.parametrize("count", [1, 2, 5, 40])
def test_each_light_is_chosen_in_proportion_to_its_importance(count: int, which: int) -> None:
    scene = upload(make_scene(*crowd(count)), "cpu")
    chosen, of = wp.zeros(COUNT, dtype=Receiver), wp.zeros(count, dtype=float)
    x, n = wp.vec3(*RECEIVER.tolist()), wp.vec3(*TURN[:, 2].tolist())
    wp.launch(choose, COUNT, [scene.view, x, n, which, 1, chosen, of])
    r, importance = chosen.numpy(), of.numpy().astype(float)
    # Every fifth sphere is below the horizon.
    assert (importance == 0.0).sum() == (7 if count == 40 else 0)
    choice = r["choice"]
    observed = np.bincount(choice["light"], minlength=count).astype(float)
    fit = chi_square(observed, importance / importance.sum() * COUNT)
    assert fit.p_value > SIGNIFICANCE, fit
    if count > 1:
        assert detectable_imbalance(fit.count, fit.dof, SIGNIFICANCE) < 0.02
    np.testing.assert_array_equal(choice["importance"], importance[choice["light"]].astype(np.float32))
    # What is left of the number is uniform for each light, and independent of the choice.
    for light in np.argsort(importance)[-3:]:
        left = choice["u_remapped"][choice["light"] == light].astype(float)
        assert left.min() >= 0.0 and left.max() < 1.0
        assert importance[light] == 0.0 or uniformity(left, 64).p_value > SIGNIFICANCE
    # What normalises the choice, in the two parts of the table.
    infinite = min(2, max(0, count - 1))
    finite = importance[: count - infinite].sum()
    np.testing.assert_allclose(r["total"], importance.sum(), rtol=1e-5)
    np.testing.assert_allclose(r["finite"], finite, rtol=1e-5)
    np.testing.assert_allclose(r["infinite"], importance.sum() - finite, rtol=1e-5)
