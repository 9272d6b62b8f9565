"""Rough dielectric interfaces: directions against Walter's densities on the whole sphere, weights against his BSDF, and
the same picture by all methods, with light samples and without.

Significance is Sidak-corrected over the file. The densities are NumPy's, written from the paper's equations.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from itertools import combinations
from typing import Any

import numpy as np
import pytest
import scenes
import warp as wp
from numpy.typing import NDArray
from statistical.estimates import REGIONS, block_means, caught_bias, paired_p_values
from stats import DirectionGrid, detectable_imbalance, fit_directions, sidak
from superset import shared

import warpmis
from warpmis.device.material import material_view
from warpmis.device.views import MaterialView
from warpmis.kernels import rng
from warpmis.kernels.bsdf.dielectric import sample_interface
from warpmis.kernels.bsdf.rough_interface import evaluate_side, side_of, to_other_side
from warpmis.methods import METHODS
from warpmis.rendering.render import Uploads
from warpmis.scene import DomeLight, Material, RectLight, Scene, SphereLight

FloatArray = NDArray[np.float64]
COUNT = 330_000
COSINES = (0.95, 0.5, 0.15)
CASES = [(rough, ior, front) for rough, ior in ((0.5, 1.5), (0.8, 1.33), (1.0, 2.4)) for front in (True, False)]
PANES = (0.4, 0.6, 0.9)
SIGNIFICANCE = sidak(0.01, (len(CASES) + len(PANES)) * len(COSINES))
SIDE = 16  # of the quadrature's points in a cell, over which the densities vary little
GRID = DirectionGrid.about(np.array([0.0, 0.0, 1.0]), np.linspace(0.0, 2.0, 41), 24)


@wp.kernel(module="unique", enable_backward=False)
def draw(
    material: MaterialView, wo: wp.vec3, front: bool, wis: wp.array(dtype=wp.vec3), weights: wp.array(dtype=wp.vec3)
):
    i = wp.tid()
    key = rng.RngKey()
    key.sample = wp.uint32(i)
    u = rng.uniform4(key, 0)
    s = sample_interface(material, wo, front, u[3], u)
    wis[i] = s.wi
    weights[i] = s.weight


@wp.kernel(module="unique", enable_backward=False)
def evaluate(
    material: MaterialView,
    wo: wp.vec3,
    front: bool,
    wis: wp.array(dtype=wp.vec3),
    pdfs: wp.array(dtype=float),
    f_cos: wp.array(dtype=wp.vec3),
):
    i = wp.tid()
    wi = wis[i]
    side = side_of(material, front, wi[2] < 0.0)
    if side.is_beyond:
        wi = to_other_side(wi)
    s = evaluate_side(side, wo, material.alpha, wi)
    pdfs[i] = s.pdf
    f_cos[i] = s.f_cos


def evaluated(material: Material, cosine: float, front: bool, wis: NDArray[Any]) -> tuple[FloatArray, FloatArray]:
    """Densities, shape (N,), and BSDF times cosine, shape (N, 3), of directions to either side."""
    count = len(wis)
    pdfs, f_cos = wp.zeros(count, dtype=float, device="cpu"), wp.zeros(count, dtype=wp.vec3, device="cpu")
    directions = wp.array(np.asarray(wis, np.float32), dtype=wp.vec3, device="cpu")
    inputs = [material_view(material, False, -1), wp.vec3(*direction(cosine)), front, directions]
    wp.launch(evaluate, count, inputs, [pdfs, f_cos], device="cpu")
    return pdfs.numpy(), f_cos.numpy()


def direction(cosine: float) -> FloatArray:
    return np.array([np.sqrt(1.0 - cosine**2), 0.0, cosine])


def drawn(material: Material, cosine: float, front: bool) -> tuple[FloatArray, FloatArray]:
    """Directions, zero where there is none, and weights, shape (COUNT, 3) each."""
    wis, weights = (wp.zeros(COUNT, dtype=wp.vec3, device="cpu") for _ in range(2))
    view = material_view(material, False, -1)
    wp.launch(draw, COUNT, [view, wp.vec3(*direction(cosine)), front, wis, weights], device="cpu")
    return wis.numpy(), weights.numpy()


def fresnel(c: FloatArray, eta: float) -> FloatArray:
    """Walter et al. (2007), equation 22."""
    g2 = eta**2 - 1.0 + c**2
    g = np.sqrt(np.maximum(g2, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        f = 0.5 * ((g - c) / (g + c)) ** 2 * (1.0 + ((c * (g + c) - 1.0) / (c * (g - c) + 1.0)) ** 2)
    return np.where(g2 > 0.0, f, 1.0)


def facets(h: FloatArray, alpha: float) -> FloatArray:
    """D of equation 33."""
    c2 = h[:, 2] ** 2
    tan2 = (1.0 - c2) / np.maximum(c2, 1e-12)
    return alpha**2 / (np.pi * c2**2 * (alpha**2 + tan2) ** 2)


def seen(w: FloatArray, alpha: float) -> FloatArray:
    """G1 of equation 34."""
    c2 = w[:, 2] ** 2
    return 2.0 / (1.0 + np.sqrt(1.0 + alpha**2 * (1.0 - c2) / np.maximum(c2, 1e-12)))


def density(wi: NDArray[Any], wo: FloatArray, alpha: float, eta: float) -> FloatArray:
    """Of visible facets (D G1(wo) (wo . h) / cos) times Fresnel's choice times equations 14 and 17."""
    wi = np.asarray(wi, np.float64)
    up = wi[:, 2] > 0.0
    h = np.where(up[:, None], wi + wo, -(eta * wi + wo))
    h /= np.maximum(np.linalg.norm(h, axis=1, keepdims=True), 1e-12)
    h *= np.sign(h[:, 2:])
    o, i = h @ wo, (h * wi).sum(axis=1)
    sides = (o > 0.0) & np.where(up, i > 0.0, i < 0.0)
    visible = facets(h, alpha) * seen(wo[None], alpha) * np.maximum(o, 0.0) / wo[2]
    refracts = eta**2 * np.abs(i) / np.maximum((o + eta * i) ** 2, 1e-12)
    jacobian = np.where(up, 1.0 / np.maximum(4.0 * o, 1e-12), refracts)
    f = fresnel(np.maximum(o, 0.0), eta)
    return np.where(sides, visible * np.where(up, f, 1.0 - f) * jacobian, 0.0)


@pytest.mark.parametrize("cosine", COSINES)
@pytest.mark.parametrize(("roughness", "ior", "front"), CASES)
def test_directions_have_walters_density(roughness: float, ior: float, front: bool, cosine: float) -> None:
    wis, weights = drawn(Material(transmission=1.0, roughness=roughness, ior=ior), cosine, front)
    eta = ior if front else 1.0 / ior
    there = np.linalg.norm(wis, axis=1) > 0.0
    fit, _ = fit_directions(
        wis[there],
        lambda w: density(w, direction(cosine), roughness**2, eta).astype(np.float32),
        GRID,
        SIDE,
        missing=int((~there).sum()),
    )
    assert fit.p_value > SIGNIFICANCE
    assert detectable_imbalance(COUNT, fit.dof, SIGNIFICANCE) < 0.03
    # The BSDF times the cosine over the density is G1(wi), and (1 / eta)^2 of the radiance comes out.
    expected = seen(wis[there].astype(np.float64), roughness**2) * np.where(wis[there][:, 2] > 0.0, 1.0, 1.0 / eta**2)
    np.testing.assert_allclose(weights[there][:, 0], expected, rtol=2e-4, atol=1e-5)
    # What a light sample is weighed by says the same.
    few = wis[there][:4096]
    pdfs, f_cos = evaluated(Material(transmission=1.0, roughness=roughness, ior=ior), cosine, front, few)
    np.testing.assert_allclose(pdfs, density(few, direction(cosine), roughness**2, eta), rtol=5e-3)
    np.testing.assert_allclose(f_cos[:, 0], pdfs * expected[:4096], rtol=5e-4, atol=1e-6)


@pytest.mark.parametrize("cosine", COSINES)
@pytest.mark.parametrize("roughness", PANES)
def test_directions_through_a_pane_have_the_density_of_light_samples(roughness: float, cosine: float) -> None:
    pane = Material(transmission=1.0, roughness=roughness, thin_walled=True, transmission_color=(0.9, 0.5, 0.2))
    wis, weights = drawn(pane, cosine, True)
    there = np.linalg.norm(wis, axis=1) > 0.0
    fit, _ = fit_directions(
        wis[there], lambda w: evaluated(pane, cosine, True, w)[0], GRID, SIDE, missing=int((~there).sum())
    )
    assert fit.p_value > SIGNIFICANCE
    assert detectable_imbalance(COUNT, fit.dof, SIGNIFICANCE) < 0.03
    pdfs, f_cos = evaluated(pane, cosine, True, wis[there][:4096])
    np.testing.assert_allclose(f_cos, weights[there][:4096] * pdfs[:, None], rtol=1e-3, atol=1e-6)


def still_life() -> Scene:
    """A room with a glass ball's stand-in (a block), a rough pane and a thin box, under a lamp and a faint sky."""
    walls = scenes.box_faces((-1, 0, -1), (1, 2, 1), inward=True)
    faces = [(face, m) for face, m in zip(walls, [0, 0, 1, 1, 0, -1], strict=True) if m >= 0]
    for low, high, m in (
        ((-0.7, 0.1, -0.5), (-0.2, 0.6, 0.0), 2),
        ((0.0, 0.1, -0.4), (0.7, 0.9, -0.36), 3),
        ((0.1, 0.1, 0.1), (0.5, 0.5, 0.4), 4),
    ):
        faces += [(face, m) for face in scenes.box_faces(low, high, inward=False)]
    clear = Material(transmission=1.0, roughness=0.0)
    materials = [
        scenes.WHITE,
        scenes.RED,
        replace(clear, path="/ball", transmission_color=(0.5, 0.8, 0.9), transmission_depth=1.0),
        Material(path="/pane", transmission=0.9, roughness=0.4, diffuse_color=(0.2, 0.6, 0.3)),
        replace(clear, path="/bottle", thin_walled=True, transmission_color=(0.9, 0.7, 0.6)),
    ]
    lamp = RectLight(
        "/lamp", np.array([0.0, 1.95, 0.0]), np.array([0.5, 0, 0]), np.array([0.0, 0.0, -0.5]), 4.0 * np.ones(3)
    )
    sky = DomeLight("/sky", np.eye(3), 0.5 * np.ones(3))
    view = scenes.camera((0, 1, 0.95), (0, 0.6, -1), half_width=0.8)
    return scenes.scene(scenes.quads(faces), materials, [lamp, sky], view, pixels=18)


def without_light_samples(scene: Scene) -> dict[str, Any]:
    features = shared(scene)
    assert features.rough_transmission
    return {"features": replace(features, rough_transmission=False)}


# Many seeds and few samples: t-distributions of few pictures have long tails, and the levels lie far out in them.
WAYS: dict[str, dict[str, Any]] = {
    "nee": {"method": "nee"},
    "balance": {"method": "balance"},
    "whole": {"method": "balance", "strategies": ("bsdf", "light", "uniform")},
    "murray20": {"method": "murray20", "learn_rounds": 2, "learn_spp": 6},
    "guided": {"method": "guided"},
    "cells": {"method": "cells", "strategies": ("bsdf", "light", "guide"), "spp": 80},
    "nee, no light samples at glass": {"method": "nee", **without_light_samples(still_life())},
}
PAIRS = list(combinations(WAYS, 2))
SEEDS = 24


def rendered(scene: Scene, **settings: Any) -> Iterator[NDArray[np.float32]]:
    """The picture by every seed."""
    uploads = Uploads()
    return (warpmis.render(scene, seed=k, uploads=uploads, **settings).image for k in range(SEEDS))


@cache
def pictures(way: str) -> FloatArray:
    return np.array([block_means(image) for image in rendered(still_life(), **{"spp": 24, **WAYS[way]})])


@pytest.mark.parametrize(("a", "b"), PAIRS)
def test_all_methods_make_the_same_picture_of_glass(a: str, b: str) -> None:
    level = sidak(0.01, len(PAIRS) * REGIONS)
    assert paired_p_values(pictures(a), pictures(b)).min() > level
    assert caught_bias(pictures(a), pictures(b), level) < 0.03


# `fixed` is a method of given shares.
OTHERS = sorted(set(METHODS) - {"fixed"} - {settings["method"] for settings in WAYS.values()})


@pytest.mark.slow
@pytest.mark.parametrize("method", OTHERS)
def test_the_other_methods_make_that_picture_too(method: str) -> None:
    level = sidak(0.01, len(OTHERS) * REGIONS)
    found = np.array(
        [block_means(warpmis.render(still_life(), method=method, spp=256, seed=k).image) for k in range(24)]
    )
    expected = np.concatenate([pictures("nee"), pictures("nee, no light samples at glass")])
    assert paired_p_values(found, expected).min() > level
    assert caught_bias(found, expected, level) < 0.05


def frosted(lamp: SphereLight, **glass: Any) -> Scene:
    """A floor and a frosted block or pane above it, lit by a lamp beyond."""
    floor = np.array([(-2, 0, 2), (2, 0, 2), (2, 0, -2), (-2, 0, -2)], dtype=np.float32)
    thickness = 0.02 if glass.get("thin_walled") else 0.3
    block = scenes.box_faces((-0.6, 0.1, -0.2 - thickness), (0.6, 1.2, -0.2), inward=False)
    block = block[3:4] if glass.get("thin_walled") else block
    frost = Material(path="/frost", transmission=1.0, **glass)
    view = scenes.camera((0, 0.8, 1.5), (0, 0.5, -0.2), half_width=0.6)
    return scenes.scene(
        scenes.quads([(floor, 0), *((face, 1) for face in block)]), [scenes.WHITE, frost], [lamp], view, 18
    )


BEYOND = np.array([0.3, 0.9, -1.2])
FROST: dict[str, dict[str, Any]] = {
    "block": {"roughness": 0.5},
    "tinted pane": {"roughness": 0.4, "thin_walled": True, "transmission_color": (0.9, 0.5, 0.2)},
    "absorbing block": {"roughness": 0.6, "transmission_color": (0.9, 0.5, 0.2), "transmission_depth": 0.3},
}
FROST_LEVEL = sidak(0.01, 2 * len(FROST) * REGIONS)


def means(scene: Scene, spp: int, **settings: Any) -> FloatArray:
    found = rendered(scene, spp=spp, method="nee", max_depth=4, **settings)
    return np.array([block_means(image) for image in found])


def lit(name: str, radius: float) -> Scene:
    """By a lamp of the intensity of 1 in every direction."""
    return frosted(SphereLight("/lamp", BEYOND, radius, np.ones(3) / (np.pi * radius**2)), **FROST[name])


@pytest.mark.parametrize("name", FROST)
def test_light_samples_at_frosted_glass_change_no_mean(name: str) -> None:
    scene = lit(name, 0.15)
    found, without = means(scene, 128), means(scene, 320, **without_light_samples(scene))
    assert paired_p_values(found, without).min() > FROST_LEVEL
    assert caught_bias(found, without, FROST_LEVEL) < 0.05


@pytest.mark.parametrize("name", FROST)
def test_light_samples_find_a_small_lamp_behind_frosted_glass(name: str) -> None:
    scene = lit(name, 0.03)
    found, without = (
        warpmis.render(scene, spp=256, method="nee", max_depth=4, **settings).variance.mean()
        for settings in ({}, without_light_samples(scene))
    )
    print(f"{name}: {without / found:.1f} times less variance")
    assert without > 4.0 * found


@pytest.mark.parametrize("name", FROST)
def test_a_point_light_shines_through_frosted_glass_as_a_small_lamp_does(name: str) -> None:
    """Radiance times the projected area is the point's intensity."""
    point = frosted(SphereLight("/point", BEYOND, 0.0, np.ones(3)), **FROST[name])
    found, expected = means(point, 24), means(lit(name, 0.005), 24)
    assert paired_p_values(found, expected).min() > FROST_LEVEL
    assert caught_bias(found, expected, FROST_LEVEL) < 0.05
