"""A film's sums in device memory."""

from __future__ import annotations

import numpy as np
import warp as wp

from warpmis.device.views import FilmView
from warpmis.film.film import Film


def allocate_film(pixels: int, device: str, aov_rows: int = 0) -> FilmView:
    """A film with no samples in it, and so many sums a pixel of light that is kept apart."""
    view = FilmView()
    view.color = wp.zeros(pixels, dtype=wp.vec3d, device=device)
    view.luminance = wp.zeros(pixels, dtype=wp.vec2d, device=device)
    view.albedo = wp.zeros(pixels, dtype=wp.vec3d, device=device)
    view.normal = wp.zeros(pixels, dtype=wp.vec3d, device=device)
    view.depth = wp.zeros(pixels, dtype=wp.float64, device=device)
    view.alpha = wp.zeros(pixels, dtype=wp.float64, device=device)
    view.hits = wp.zeros(pixels, dtype=wp.int32, device=device)
    view.accepted = wp.zeros(pixels, dtype=wp.int32, device=device)
    view.rejected = wp.zeros(pixels, dtype=wp.int32, device=device)
    view.rays = wp.zeros(pixels, dtype=wp.int64, device=device)
    view.shadow_rays = wp.zeros(pixels, dtype=wp.int64, device=device)
    view.aovs = wp.zeros((pixels, aov_rows), dtype=wp.vec3d, device=device)
    return view


def download_film(view: FilmView, width: int, height: int) -> Film:
    """The film's sums on the host."""
    luminance = view.luminance.numpy()
    return Film(
        count=view.accepted.numpy().reshape(height, width).astype(np.int64),
        rejected=view.rejected.numpy().reshape(height, width).astype(np.int64),
        hits=view.hits.numpy().reshape(height, width).astype(np.int64),
        color=view.color.numpy().reshape(height, width, 3),
        luminance_mean=luminance[:, 0].reshape(height, width),
        luminance_m2=luminance[:, 1].reshape(height, width),
        albedo=view.albedo.numpy().reshape(height, width, 3),
        normal=view.normal.numpy().reshape(height, width, 3),
        depth=view.depth.numpy().reshape(height, width),
        alpha=view.alpha.numpy().reshape(height, width),
        aovs=view.aovs.numpy().reshape(height, width, view.aovs.shape[1], 3),
    )
