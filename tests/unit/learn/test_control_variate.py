"""The coefficient of the control: the paper's toy by hand, per colour, and in the units of the picture."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
import warp as wp
from toys import filled, solve

from warpmis.kernels.moments import Layout
from warpmis.learn.control_variate import make_control_variate, make_in_radiance
from warpmis.methods import METHODS

LAYOUT = Layout(0, METHODS["optimal"].statistics)
# Two cells, and the densities that draw them.
P_LIGHT, P_BSDF = np.array([3 / 4, 1 / 4]), np.array([1 / 4, 3 / 4])


def pairs(f: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Probability, estimate by the balance heuristic and control of each pair of a light and a BSDF sample."""
    both = P_LIGHT + P_BSDF
    of_cell, control = f / both, (P_LIGHT - P_BSDF) / both
    cells = list(product(range(2), repeat=2))
    probability = np.array([P_LIGHT[i] * P_BSDF[j] for i, j in cells])
    return probability, *(np.array([one[i] + one[j] for i, j in cells]) for one in (of_cell, control))


def coefficients(X: np.ndarray, c: np.ndarray, probability: np.ndarray) -> np.ndarray:
    """X: shape (n, 3)."""
    moments = np.append(probability @ (X * c[:, None]), probability @ c**2)
    row = filled(LAYOUT, control=moments)
    return solve(make_control_variate(LAYOUT), LAYOUT.relative_vec, row[np.newaxis], np.full((1, 3), 9.0))[0]


def test_by_hand() -> None:
    """f = 2 p_light + 1 p_bsdf = (7/4, 5/4), of integral 3: the optimal coefficients are 2 and 1.

    p_light + p_bsdf is 1 in both cells, so the pair (i, j) brings f_i + f_j, and the control is 1/2 or -1/2 of each:

        pair      probability    X      c
        (1, 1)    3/16           7/2    1
        (1, 2)    9/16           3      0
        (2, 1)    1/16           3      0
        (2, 2)    3/16           5/2    -1

    E[c] = 0, E[X c] = 3/16 (7/2 - 5/2) = 3/16, E[c^2] = 6/16: g = 1/2, half of 2 - 1, and X - c/2 = 3 for every pair.
    """
    probability, X, c = pairs(2.0 * P_LIGHT + P_BSDF)
    assert X.tolist() == [3.5, 3.0, 3.0, 2.5] and c.tolist() == [1.0, 0.0, 0.0, -1.0]
    assert probability @ c == 0.0
    g = coefficients(np.repeat(X[:, None], 3, axis=1), c, probability)
    assert g == pytest.approx([0.5, 0.5, 0.5])
    assert X - g[0] * c == pytest.approx(np.full(4, 3.0)), "no variance is left"


def test_a_sample_of_no_radiance_counts() -> None:
    """f = (1, 0): leave out what the pairs' samples in the second cell count with, and the mean is off."""
    probability, X, c = pairs(np.array([1.0, 0.0]))
    g = coefficients(np.repeat(X[:, None], 3, axis=1), c, probability)[0]
    assert probability @ (X - g * c) == pytest.approx(1.0)
    found = np.array([float(i == 0) + float(j == 0) for i, j in product(range(2), repeat=2)]) / 2.0  # 1/2 of each
    assert probability @ (X - g * found) < 0.8


def test_each_colour_has_its_own() -> None:
    """A light that only light samples find in red, only BSDF samples in green, and both alike in blue."""
    probability, _, c = pairs(P_LIGHT)
    X = np.stack([pairs(f)[1] for f in (P_LIGHT, P_BSDF, P_LIGHT + P_BSDF)], axis=1)
    g = coefficients(X, c, probability)
    assert g == pytest.approx([0.5, -0.5, 0.0], abs=1e-6)
    assert X - np.outer(c, g) == pytest.approx(np.tile([1.0, 1.0, 2.0], (4, 1)))


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_what_tells_nothing_takes_no_control(bad: float) -> None:
    assert coefficients(np.ones((4, 3)), np.zeros(4), np.ones(4)).tolist() == [0.0] * 3
    row = filled(LAYOUT, control=np.array([bad, 1.0, 1.0, 2.0]))
    found = solve(make_control_variate(LAYOUT), LAYOUT.relative_vec, row[np.newaxis], np.zeros((1, 3)))[0]
    assert found.tolist() == [0.0, 0.5, 0.5]


def test_coefficients_are_in_the_pixels_radiance() -> None:
    relative = wp.array([[0.5, -0.5, 1.0], [1.0, 1.0, 1.0]], dtype=wp.types.vector(3, wp.float32), device="cpu")
    brightness = wp.array([4.0, 0.0], dtype=float, device="cpu")
    wp.launch(make_in_radiance(), dim=2, inputs=[0, brightness, relative], device="cpu")
    assert relative.numpy().tolist() == [[2.0, -2.0, 4.0], [0.0, 0.0, 0.0]]
