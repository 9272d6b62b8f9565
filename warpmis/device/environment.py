"""The environment on the device: one constant colour or one picture, with the distribution that samples it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpmis.scene import DomeLight

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


@dataclass(frozen=True, eq=False)
class Environment:
    """All domes as one.

    Attributes:
        to_world: rotation of the picture's frame, shape (3, 3).
        radiance: constant radiance, or the factor on the picture, shape (3,).
        picture: shape (rows, columns, 3) float32, or None.
        luminance: mean luminance over the sphere.
    """

    to_world: NDArray[np.float64]
    radiance: NDArray[np.float64]
    picture: NDArray[np.float32] | None
    luminance: float


@dataclass(frozen=True, eq=False)
class PictureDistribution:
    """What samples a picture: cumulative distributions over rows and columns, density over the unit square."""

    marginal: NDArray[np.float32]
    conditional: NDArray[np.float32]
    density: NDArray[np.float32]


def combine(domes: list[DomeLight]) -> Environment:
    """One environment from one or more domes: a single dome as it is, several added up in world orientation."""
    pictured = [dome for dome in domes if dome.picture is not None]
    if not pictured:
        radiance = np.sum([dome.radiance for dome in domes], axis=0)
        return Environment(np.eye(3), radiance, None, float(radiance @ LUMINANCE))
    if len(domes) == 1:
        dome = domes[0]
        assert dome.picture is not None
        mean = mean_over_sphere(dome.picture) * dome.radiance
        return Environment(dome.to_world, dome.radiance, dome.picture, float(mean @ LUMINANCE))
    rows = max(dome.picture.shape[0] for dome in pictured if dome.picture is not None)
    columns = max(dome.picture.shape[1] for dome in pictured if dome.picture is not None)
    picture = np.sum([resample(dome, rows, columns) for dome in domes], axis=0).astype(np.float32)
    return Environment(np.eye(3), np.ones(3), picture, float(mean_over_sphere(picture) @ LUMINANCE))


def row_solid_angles(rows: int, columns: int) -> NDArray[np.float64]:
    """Solid angle of one texel of each row [sr], shape (rows,)."""
    edges = np.cos(np.pi * np.arange(rows + 1) / rows)
    return (edges[:-1] - edges[1:]) * 2.0 * np.pi / columns


def mean_over_sphere(picture: NDArray[np.float32]) -> NDArray[np.float64]:
    """Mean colour, each texel by its solid angle."""
    weights = row_solid_angles(*picture.shape[:2])
    return np.einsum("r,rcd->d", weights, picture.astype(np.float64)) / (4.0 * np.pi)


def resample(dome: DomeLight, rows: int, columns: int) -> NDArray[np.float64]:
    """The dome's radiance in world directions on a lat-long grid (nearest texel)."""
    if dome.picture is None:
        return np.broadcast_to(dome.radiance, (rows, columns, 3))
    v, u = np.meshgrid((np.arange(rows) + 0.5) / rows, (np.arange(columns) + 0.5) / columns, indexing="ij")
    sin_theta = np.sin(np.pi * v)
    world = np.stack(
        [sin_theta * np.sin(2 * np.pi * u), np.cos(np.pi * v), -sin_theta * np.cos(2 * np.pi * u)], axis=-1
    )
    d = world @ dome.to_world
    u = np.mod(np.arctan2(d[..., 0], -d[..., 2]) / (2 * np.pi), 1.0)
    v = np.arccos(np.clip(d[..., 1], -1.0, 1.0)) / np.pi
    row = np.minimum((v * dome.picture.shape[0]).astype(int), dome.picture.shape[0] - 1)
    column = np.minimum((u * dome.picture.shape[1]).astype(int), dome.picture.shape[1] - 1)
    return dome.picture[row, column] * dome.radiance


def distribution(environment: Environment, mis_compensation: bool = False) -> PictureDistribution:
    """Piecewise constant over texels, in proportion to solid angle times luminance.

    With `mis_compensation` the luminance above the mean counts alone: where light is spread evenly the BSDF's sampler
    does as well, and the density may be 0 there, since the weights make up for it.

    Rendering interpolates between texels, so each texel's weight is what the interpolation makes of it and its
    neighbours: no direction that shines has density 0.

    Reference: Karlik, Sik, Vevoda, Skrivan, Krivanek (2019), "MIS Compensation: Optimizing Sampling Techniques in
    Multiple Importance Sampling", equation 14.
    """
    assert environment.picture is not None
    y = (environment.picture.astype(np.float64) * environment.radiance) @ LUMINANCE
    y = 0.75 * y + 0.125 * (np.roll(y, 1, axis=1) + np.roll(y, -1, axis=1))
    padded = np.pad(y, ((1, 1), (0, 0)), mode="edge")
    y = 0.75 * y + 0.125 * (padded[:-2] + padded[2:])
    rows, columns = y.shape
    if mis_compensation:
        y = np.maximum(y - environment.luminance, 0.0)
    weights = y * row_solid_angles(rows, columns)[:, None]
    if weights.sum() <= 0.0:
        weights = np.broadcast_to(row_solid_angles(rows, columns)[:, None], (rows, columns)).copy()
    weights /= weights.sum()
    by_row = weights.sum(axis=1)
    within = np.divide(weights, by_row[:, None], out=np.full_like(weights, 1.0 / columns), where=by_row[:, None] > 0)
    marginal = np.cumsum(by_row)
    conditional = np.cumsum(within, axis=1)
    marginal /= marginal[-1]
    conditional /= conditional[:, -1:]
    # The density is taken from the float32 tables that are sampled, so that both agree to the last digit.
    marginal32, conditional32 = marginal.astype(np.float32), conditional.astype(np.float32)
    p_row = np.diff(marginal32.astype(np.float64), prepend=0.0)
    p_column = np.diff(conditional32.astype(np.float64), prepend=0.0, axis=1)
    density = p_row[:, None] * p_column * rows * columns
    return PictureDistribution(marginal32, conditional32, density.astype(np.float32))


def index_of(cumulative: NDArray[np.float32]) -> NDArray[np.int32]:
    """Where to begin and to end the search for the first column above a value, for kernels/light/dome.py.

    Args:
        cumulative: distributions that end with 1, shape (rows, columns).

    Returns:
        of each row the first column above k / n, for k from 0 to n, a power of two at least half of the columns (so
        that float32 finds a value's part without rounding), shape (rows, n + 1).
    """
    rows, columns = cumulative.shape
    parts = 1 << max((columns - 1).bit_length() - 1, 0)
    values = np.arange(parts + 1, dtype=np.float32) / np.float32(parts)
    index = np.empty((rows, parts + 1), np.int32)
    for row in range(rows):
        index[row] = np.searchsorted(cumulative[row], values, side="right")
    return np.minimum(index, columns - 1)
