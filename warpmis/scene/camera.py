"""The camera."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Camera:
    """A camera with a pinhole or a thin lens, or an orthographic one.

    The ray through the picture point (x, y), both in [0, 1) with (0, 0) the upper left corner, leaves `position`
    along  forward + (left + x (right - left)) right_axis + (top + y (bottom - top)) up_axis  with the window
    (left, right, bottom, top) at unit distance, already fitted to `resolution`'s aspect. An orthographic camera's
    ray leaves that point of the window about `position`, along `forward`.

    Attributes:
        position: [scene units], shape (3,) float64.
        right_axis, up_axis, forward: orthonormal, world space, shape (3,) float64.
        window: (left, right, bottom, top) at unit distance; of an orthographic camera [scene units].
        lens_radius: of a thin lens, perspective alone; 0 is a pinhole [scene units].
        focus_distance: along `forward`, above 0 where there is a lens [scene units].
        exposure: factor on the picture.
        shutter: when it opens and closes, relative to Scene.time [time codes]; both equal without motion blur.
        clipping_planes: rows (n, d), world space; the camera sees a point p where n . (p - position) + d >= 0
            for all of them, light goes everywhere, shape (n, 4) float64.
    """

    path: str
    position: NDArray[np.float64]
    right_axis: NDArray[np.float64]
    up_axis: NDArray[np.float64]
    forward: NDArray[np.float64]
    window: tuple[float, float, float, float]
    orthographic: bool = False
    lens_radius: float = 0.0
    focus_distance: float = 0.0
    exposure: float = 1.0
    shutter: tuple[float, float] = (0.0, 0.0)
    clipping_planes: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 4)))
