"""What breaks in the naive form of a formula, in float32, beside the form that the renderer has: relative errors."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

F = np.float32
Errors = tuple[float, float]  # of the naive form, and of ours


def relative(value: object, exact: object) -> float:
    """The largest error relative to float64's result; inf where there is no number."""
    with np.errstate(all="ignore"):
        error = np.abs(np.asarray(value, np.float64) / np.asarray(exact, np.float64) - 1.0)
    return float(np.where(np.isfinite(error), error, np.inf).max())


def cone(share: float = 1e-4) -> Errors:
    """1 - cos(theta_max) of a sphere of r / d = 1e-4."""
    sin2 = F(share) ** 2
    exact = share**2 / (1.0 + np.sqrt(1.0 - share**2))
    return relative(F(1) - np.sqrt(F(1) - sin2), exact), relative(sin2 / (F(1) + np.sqrt(F(1) - sin2)), exact)


def near_side(radius: float = 1e6, height: float = 1.0) -> Errors:
    """Distance to the near side of a sphere of radius 1e6 whose nearest point is 1 away, seen at its tangent."""
    d = radius + height
    cos = 0.5 + 0.5 * np.sqrt(1.0 - (radius / d) ** 2)
    sin2 = 1.0 - cos**2
    exact = d * cos - np.sqrt(radius**2 - d**2 * sin2)
    d32, r32, cos32, sin32 = F(d), F(radius), F(cos), F(sin2)
    root = np.sqrt(np.maximum(r32 * r32 - d32 * d32 * sin32, F(0)))
    return relative(d32 * cos32 - root, exact), relative((d32 - r32) * (d32 + r32) / (d32 * cos32 + root), exact)


def lost_directions(share: float = 1e-6, count: int = 200_000) -> Errors:
    """Share of the directions drawn within a cone of r / d = 1e-6 that lie beside it once they are rounded."""
    rng = np.random.default_rng(1)
    axis = np.array([0.36, 0.48, 0.8])
    side = np.array([0.8, -0.6, 0.0])
    radius, phi = share * np.sqrt(rng.random(count)), 2.0 * np.pi * rng.random(count)
    offset = np.cos(phi)[:, None] * side + np.sin(phi)[:, None] * np.cross(axis, side)
    wi = (axis + radius[:, None] * offset).astype(F).astype(np.float64)
    across = wi - (wi @ axis)[:, None] * axis
    missed = (across**2).sum(axis=1) > share**2
    return float(missed.mean()), 0.0  # what was drawn counts as hit


def sines(middle: float = 1.0, half_length: float = 1e-6, rho: float = 1.0) -> Errors:
    """Difference of the sines of elevation of a short cylinder's ends."""

    def ends(t: type) -> list[NDArray[np.float64]]:
        heights = (t(middle) - t(half_length), t(middle) + t(half_length))
        return [t(z) / np.sqrt(t(rho) ** 2 + t(z) ** 2) for z in heights]

    exact = np.subtract(*ends(np.float64)[::-1])
    low, high = ends(F)
    r0, r1 = (np.sqrt(F(rho) ** 2 + F(z) ** 2) for z in (middle - half_length, middle + half_length))
    ours = F(rho) / r0 * (F(rho) / r1) * (F(2) * F(half_length) / r0) * (F(2) * F(middle) / r1) / (low + high)
    return relative(high - low, exact), relative(ours, exact)


def normals(edge: float = 1e-12) -> Errors:
    """Length of the unit normal of a triangle with edges of 1e-12."""
    e1, e2 = np.array([edge, 0.0, 0.0], F), np.array([0.0, edge, 0.0], F)

    def length(a: NDArray[np.float32], b: NDArray[np.float32]) -> np.float32:
        cross = np.cross(a, b)
        square = (cross * cross).sum(dtype=F)
        return np.sqrt((cross * cross / square).sum(dtype=F))

    with np.errstate(all="ignore"):
        return relative(length(e1, e2), 1.0), relative(length(e1 / F(edge), e2 / F(edge)), 1.0)


def place_on_rect(half: float = 1e-12) -> Errors:
    """Where on a rectangle of half edges 1e-12 a point lies: by Cramer's rule, and by dual vectors made in float64."""
    u, v, d = np.array([half, 0.0], F), np.array([0.0, half], F), np.array([0.3 * half, 0.4 * half], F)
    with np.errstate(all="ignore"):
        determinant = (u @ u) * (v @ v) - (u @ v) ** 2
        naive = ((d @ u) * (v @ v) - (d @ v) * (u @ v)) / determinant
    dual = np.linalg.pinv(np.stack([[half, 0.0], [0.0, half]], axis=1)).astype(F)[0]
    return relative(naive, 0.3), relative(d @ dual, 0.3)


def microfacets(alpha: float = 1e-3) -> Errors:
    """GGX's D within a few slopes of the normal: by the cosine, and by the slope."""
    sin = np.linspace(0.1, 3.0, 64) * alpha
    exact = alpha**2 / (np.pi * ((1.0 - sin**2) * (alpha**2 - 1.0) + 1.0) ** 2)
    a, s = F(alpha), sin.astype(F)
    cos = np.sqrt(F(1) - s * s)
    naive = a * a / (F(np.pi) * (cos * cos * (a * a - F(1)) + F(1)) ** 2)
    slope2 = s * s / (a * a) + cos * cos
    return relative(naive, exact), relative(F(1) / (F(np.pi) * a * a * slope2 * slope2), exact)


def far_away(by: float = 1e6) -> Errors:
    """Edges 0.01 long at 1e6 from the origin: rounded there, and rounded after the move to the origin."""
    ends = np.array([0.3, 0.31])
    return relative(np.diff((ends + by).astype(F)), 0.01), relative(np.diff((ends + by - by).astype(F)), 0.01)


def faint_light(radiance: float = 1e-30, solid_angle: float = 1e-12) -> Errors:
    """Importance, luminance times solid angle, of two equal lights: its share of the sum."""
    with np.errstate(all="ignore"):
        one = F(radiance) * F(solid_angle) * F(1e-5)
        naive = one / (one + one)
    ours = F(1) * F(solid_angle)
    return relative(naive, 0.5), relative(ours / (ours + ours), 0.5)


NAIVE_FORMS: dict[str, Callable[[], Errors]] = {
    "cone of a small sphere": cone,
    "near side of a large sphere": near_side,
    "directions towards a small light": lost_directions,
    "elevations of a short cylinder": sines,
    "normal of a small triangle": normals,
    "place on a small rectangle": place_on_rect,
    "narrow GGX lobe": microfacets,
    "far from the origin": far_away,
    "importance of a faint light": faint_light,
}
