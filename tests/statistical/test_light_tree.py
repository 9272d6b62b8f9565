"""The tree by which many lights are chosen: probabilities that sum to 1 and that samples have, none of them 0 where a
light brings anything, and the same picture as by weighing all lights one by one.

Significance is Sidak-corrected over the file.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any
from unittest import mock

import numpy as np
import pytest
import warp as wp
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from statistical.lights import TURN, lights, make_scene, some_response
from stats import chi_square, detectable_imbalance, sidak

from warpmis.device.upload import DeviceScene, upload
from warpmis.device.views import SceneView
from warpmis.kernels import rng
from warpmis.kernels.light.choice import make_choice
from warpmis.kernels.light.tree import make_light_tree
from warpmis.scene import CylinderLight, DiskLight, Light, RectLight, Scene, SphereLight, features
from warpmis.scene.features import Features
from warpmis.scene.light_control import LightControl, Shaping

SIGNIFICANCE = sidak(0.01, 3)
SAMPLES = 1 << 18
EVERY = Features.all()
tree = make_light_tree(EVERY)
choice = make_choice(EVERY)


@wp.kernel(module="unique", enable_backward=False)
def probabilities(
    scene: SceneView,
    xs: wp.array(dtype=wp.vec3),
    ns: wp.array(dtype=wp.vec3),
    prims: wp.array(dtype=int),
    total: wp.array(dtype=float),
    pmf: wp.array2d(dtype=float),
    brings: wp.array2d(dtype=int),
):
    """For each receiver and leaf its probability, and whether any of some samples of it brings light."""
    i, leaf = wp.tid()
    r = lights.receiver(scene, xs[i], ns[i], prims[i], 0.5, 0.5, some_response(ns[i], i))
    total[i] = r.finite
    pmf[i, leaf] = tree.leaf_pmf(scene.light_tree, r, leaf)
    index = leaf
    emitter = -1
    if leaf >= scene.analytic_light_count:
        emitter = leaf - scene.analytic_light_count
        index = scene.emitter_lights[emitter]
    key = rng.RngKey()
    for k in range(32):
        key.sample = wp.uint32(k)
        u = rng.uniform4(key, i)
        s = lights.sample_light(scene, scene.lights[index], emitter, -1, r.x, r.n, u)
        arrives = s.pdf_solid_angle > 0.0 and wp.dot(s.wi, r.n) > 1.0e-4
        if arrives and wp.max(lights.control.factor(scene, index, r, s.wi)) > 1.0e-6:
            brings[i, leaf] = 1


@wp.kernel(module="unique", enable_backward=False)
def choices(
    scene: SceneView, x: wp.vec3, n: wp.vec3, which: int, leaves: wp.array(dtype=int), pmfs: wp.array(dtype=float)
):
    """By the receiver `which` of those that `probabilities` asks."""
    i = wp.tid()
    key = rng.RngKey()
    key.sample = wp.uint32(i)
    u = rng.uniform4(key, 0)
    r = lights.receiver(scene, x, n, 0, 0.5, 0.5, some_response(n, which))
    r.u_fine = u[1]
    c = tree.choose_leaf(scene.light_tree, r, tree.importances(scene.light_tree, 0, r), u[0])
    leaves[i] = c.leaf
    pmfs[i] = c.pmf


def by_tree(scene: Scene) -> DeviceScene:
    with mock.patch.object(features, "FEW_LIGHTS", 0):
        return upload(scene, "cpu")


def unit(random: np.random.Generator, count: int) -> NDArray[np.float64]:
    found = random.normal(size=(count, 3))
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))


def shaped(random: np.random.Generator, light: Light, prims: int) -> Light:
    """The light with a cone, or for some prims alone, or neither."""
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
    cone = Shaping(turn, cone_angle=random.uniform(0.05, 3.0), cone_softness=random.uniform(0.0, 1.0))
    reached = random.random(prims) < 0.5
    control = LightControl(
        shaping=cone if random.random() < 0.4 else None, illuminates=reached if random.random() < 0.4 else None
    )
    return replace(light, control=control)


def crowd(count: int, seed: int, size: float) -> Scene:
    """Lights of all kinds at a distance, and as many triangles that emit, about the origin; two prims."""
    random = np.random.default_rng(seed)
    found: list[Light] = []
    for k in range(count):
        center, radiance = random.normal(size=3), np.ones(3) * 10.0 ** random.uniform(-2.0, 2.0)
        u, v = size * random.normal(size=(2, 3))
        made: list[Light] = [
            RectLight("/r", center, u, v, radiance),
            DiskLight("/d", center, u, v, radiance),
            SphereLight("/s", center, size * random.uniform(0.1, 2.0), radiance),
            CylinderLight("/c", center, u, size * random.uniform(0.1, 2.0), radiance),
        ]
        found.append(shaped(random, made[k % 4], 2))
    points = np.repeat(random.normal(size=(count, 3)), 3, axis=0) + size * random.normal(size=(3 * count, 3))
    triangles = np.arange(3 * count).reshape(-1, 3)
    return make_scene(*found, points=points, triangles=triangles, prims=np.arange(count) % 2, double=(True, False))


def asked(scene: DeviceScene, leaves: int, xs: Any, ns: Any, prims: Any) -> tuple[NDArray[Any], ...]:
    count = len(xs)
    total, pmf = wp.zeros(count, dtype=float), wp.zeros((count, leaves), dtype=float)
    brings = wp.zeros((count, leaves), dtype=int)
    where = [wp.array(np.asarray(a, np.float32), dtype=wp.vec3) for a in (xs, ns)]
    inputs = [scene.view, *where, wp.array(np.asarray(prims, np.int32), dtype=int), total, pmf, brings]
    wp.launch(probabilities, (count, leaves), inputs)
    return total.numpy(), pmf.numpy().astype(float), brings.numpy() != 0


@settings(max_examples=60, deadline=None)
@given(
    st.integers(1, 24),
    st.integers(0, 2**16),
    st.sampled_from([1e-3, 0.05, 0.5, 3.0]),
    st.sampled_from([0.3, 2.0, 50.0]),
)
def test_what_brings_light_can_be_chosen(count: int, seed: int, size: float, spread: float) -> None:
    """Receivers among the lights and far away, facing anywhere, of both prims; probabilities sum to 1."""
    scene = by_tree(crowd(count, seed, size))
    random = np.random.default_rng(seed)
    xs, ns = spread * random.normal(size=(64, 3)), unit(random, 64)
    total, pmf, brings = asked(scene, 2 * count, xs, ns, np.arange(64) % 2)
    assert np.isfinite(total).all() and np.isfinite(pmf).all()
    assert (pmf[brings] > 0.0).all()
    assert (total[brings.any(axis=1)] > 0.0).all()
    np.testing.assert_allclose(pmf.sum(axis=1), np.where(total > 0.0, 1.0, 0.0), atol=1e-5)


@pytest.mark.parametrize("which", [0, 1], ids=["matte", "glossy"])
@pytest.mark.parametrize("count", [3, 40, 700])
def test_leaves_are_chosen_with_their_probability(count: int, which: int) -> None:
    scene = by_tree(crowd(count, count, 0.1))
    x, n = np.array([0.4, -0.3, 0.2]), TURN[:, 2]
    _, pmf, _ = asked(scene, 2 * count, [x, x], [n, n], [0, 0])
    leaves, pmfs = wp.zeros(SAMPLES, dtype=int), wp.zeros(SAMPLES, dtype=float)
    wp.launch(choices, SAMPLES, [scene.view, wp.vec3(*x.tolist()), wp.vec3(*n.tolist()), which, leaves, pmfs])
    chosen = leaves.numpy()
    fit = chi_square(np.bincount(chosen, minlength=2 * count).astype(float), pmf[which] * SAMPLES)
    assert fit.p_value > SIGNIFICANCE, fit
    assert detectable_imbalance(fit.count, fit.dof, SIGNIFICANCE) < 0.1
    np.testing.assert_allclose(pmfs.numpy(), pmf[which][chosen], rtol=1e-5)


def test_a_light_right_in_the_mirrors_direction() -> None:
    """Lights without extent in the direction in which the receiver is seen: of a lobe without width there is no 0 / 0,
    and the nearer ones are likelier."""
    points = [SphereLight(f"/p{k}", np.array([0.0, 0.0, 1.0 + k]), 1e-3, np.ones(3)) for k in range(9)]
    scene = by_tree(make_scene(*points))
    xs, ns = np.tile([0.0, 0.0, -2.0], (8, 1)), np.tile([0.0, 0.0, 1.0], (8, 1))
    total, pmf, _ = asked(scene, 9, xs, ns, np.zeros(8))
    assert np.isfinite(total).all() and (total < 1.0).all()
    np.testing.assert_allclose(pmf.sum(axis=1), 1.0, atol=1e-5)
    ratio = pmf[3, 0] / pmf[3]  # the fourth receiver has a lobe, and no coat
    assert (ratio > 0.0).all() and ratio[-1] == pytest.approx((11.0 / 3.0) ** 2, rel=0.5)


def test_probabilities_sum_to_one() -> None:
    random = np.random.default_rng(5)
    for seed in range(8):
        scene = by_tree(crowd(100, seed, 0.1))
        total, pmf, _ = asked(scene, 200, 2.0 * random.normal(size=(256, 3)), unit(random, 256), np.arange(256) % 2)
        assert (total > 0.0).mean() > 0.9
        np.testing.assert_allclose(pmf.sum(axis=1), np.where(total > 0.0, 1.0, 0.0), atol=1e-5)
