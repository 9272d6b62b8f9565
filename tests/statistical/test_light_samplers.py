"""Every light's sampler against the density that a ray's direction is given: the same light asked in two ways.

`lights.sample` draws directions; their density is taken from `gather` and `pdf_emitter_triangles`, which know nothing
of how a direction was drawn. What the sampler says of its own density, distance and radiance is compared as well.

Significance is Sidak-corrected over the file; each chi-square test has the power to find a density that is wrong by
2 % over half of its probability, one way or the other (asserted).
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from statistical.light_cases import CASES, SINGLE, device_scene, normal_of, sampled
from statistical.light_grid import SurfaceGrid
from statistical.lights import COUNT, LOOK, PILOT, RECEIVER, SAMPLE_FIRST, TURN, run
from stats import DirectionGrid, Grid, detectable_imbalance, fit_directions, sidak

from warpmis.scene import CylinderLight, DiskLight, RectLight

SIGNIFICANCE = sidak(0.01, len(CASES))
DETECTABLE = 0.02


def grid_of(name: str) -> tuple[Grid, int]:
    """Cells for a case's directions, and the quadrature's points along a cell's side."""
    if CASES[name].by_surface:
        light = CASES[name].scene().lights[0]
        assert isinstance(light, RectLight | DiskLight | CylinderLight)
        return SurfaceGrid(light), 24
    if name == "dome_picture":
        # The texels' own edges: about the dome's +Y, phi = pi / 2 - 2 pi u.
        frame = np.stack([TURN[:, 0], -TURN[:, 2], TURN[:, 1]])
        return DirectionGrid(frame, 1.0 - np.cos(np.pi * np.arange(9) / 8), np.linspace(-np.pi, np.pi, 17)), 24
    wi, out = sampled(name, PILOT, seed=2)
    grid = DirectionGrid.fitted(wi[out["sampled_pdf"] > 0.0], np.linspace(0.0, 1.0, 13), sectors=12)
    if CASES[name].by_tree:
        return grid, 72  # triangles seen edge-on have samples, too
    return grid, 48 if CASES[name].overlaps else 40


@pytest.mark.parametrize("name", CASES)
def test_directions_have_the_density_that_rays_are_given(name: str) -> None:
    case = CASES[name]
    wi, out = sampled(name)
    has_sample = out["sampled_pdf"] > 0.0
    grid, side = grid_of(name)

    def density(directions: NDArray[np.float32]) -> NDArray[np.float32]:
        return run(device_scene(name), LOOK, RECEIVER, normal_of(name), directions)[1]["pdf"]

    missing = int((~has_sample).sum())
    fit, integral = fit_directions(wi[has_sample], density, grid, side, missing)
    assert fit.p_value > SIGNIFICANCE, fit
    assert detectable_imbalance(fit.count, fit.dof, SIGNIFICANCE) < DETECTABLE
    yields = case.yields
    if np.isnan(yields):
        assert missing < COUNT
        assert missing > 0 or case.by_tree  # which knows an emitter's back
        yields = 1.0 - missing / COUNT
    # The quadrature's error, and where the yield is itself counted 4 standard errors of it.
    assert integral == pytest.approx(yields, abs=5e-3)
    if case.yields == 1.0:
        assert missing == 0


@pytest.mark.parametrize("name", SINGLE)
def test_sampler_and_ray_agree_on_density_distance_and_radiance(name: str) -> None:
    wi, out = sampled(name)
    has_sample = out["sampled_pdf"] > 0.0
    out, wi = out[has_sample], wi[has_sample]
    np.testing.assert_allclose(np.linalg.norm(wi, axis=1), 1.0, atol=1e-6)
    same = np.abs(out["sampled_pdf"] / np.maximum(out["pdf"], 1e-30) - 1.0) < 1e-3
    assert 1.0 - same.mean() <= CASES[name].stray
    same = np.abs(out["sampled_luminance"] - out["radiance"]) <= 1e-3 * out["sampled_luminance"]
    assert 1.0 - same.mean() <= CASES[name].stray
    if not name.startswith("dome"):
        same = np.abs(out["hit_distance"] / out["sampled_distance"] - 1.0) < 1e-3
        assert 1.0 - same.mean() <= CASES[name].stray


ROUND = ["rect", "parallelogram", "disk", "ellipse_sheared", "sphere", "cylinder", "distant_wide"]
ROUND += ["distant_beyond_the_horizon", "dome", "dome_picture", "mesh_one_sided", "mesh_two_sided"]


@pytest.mark.parametrize("name", ROUND)
def test_from_anywhere_a_light_that_contributes_can_be_chosen(name: str) -> None:
    """Receivers all around, near and far, facing anywhere: importance 0 only where the light brings nothing, finite
    numbers, and a density that both routes agree on."""
    random = np.random.default_rng(3)
    count = 1 << 16
    light = CASES[name].scene().lights
    center = light[0].center if light and hasattr(light[0], "center") else RECEIVER
    away = random.normal(size=(count, 3))
    away *= (10.0 ** random.uniform(-2.0, 1.5, count) / np.linalg.norm(away, axis=1))[:, None]
    n = random.normal(size=(count, 3))
    n /= np.linalg.norm(n, axis=1)[:, None]
    wi, out = run(device_scene(name), SAMPLE_FIRST, center + away, n, count)
    for field in ("sampled_pdf", "sampled_distance", "pdf", "radiance", "importance"):
        assert np.isfinite(out[field]).all(), field
    has_sample = out["sampled_pdf"] > 0.0
    assert has_sample.mean() > 0.2
    contributes = has_sample & (np.einsum("ij,ij->i", wi, n) > 1e-5)
    assert contributes.mean() > 0.1
    assert (out["importance"][contributes] > 0.0).all()
    chosen = has_sample & (out["importance"] > 0.0)
    if CASES[name].overlaps:
        assert (out["pdf"][chosen] > 0.999 * out["sampled_pdf"][chosen]).mean() > 0.999
    else:
        same = np.abs(out["pdf"][chosen] / out["sampled_pdf"][chosen] - 1.0) < 2e-3
        assert 1.0 - same.mean() < max(2e-3, CASES[name].stray)
