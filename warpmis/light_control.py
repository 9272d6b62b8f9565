"""What a light does beside shining alike everywhere: in which directions, on which materials and on which prims."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Shaping:
    """The share of a light's radiance that leaves in a direction (UsdLuxShapingAPI), with the angle t to the axis:

    lerp(|cos t|^focus, focus_tint, 1) (1 - smoothstep(t; (1 - cone_softness) cone_angle, cone_angle)).

    Attributes:
        to_world: the light's axes, of which it emits along -Z, orthogonal, shape (3, 3) float64, used as
            to_world @ direction.
        cone_angle: beyond it the light is dark [radian].
        focus_tint: linear Rec.709, shape (3,) float64.
    """

    to_world: NDArray[np.float64]
    cone_angle: float = math.pi
    cone_softness: float = 0.0
    focus: float = 0.0
    focus_tint: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True, eq=False)
class LightControl:
    """All that UsdLux lets change about a light whose shape and mean radiance are given; the default changes nothing.

    Attributes:
        shaping: where the light shines to; None for everywhere.
        picture: of a RectLight alone, a factor on its radiance, linear Rec.709, shape (rows, columns, 3) float32, row 0
            at +half_v and column 0 at +half_u; interpolated between texels.
    """

    shaping: Shaping | None = None
    picture: NDArray[np.float32] | None = None

    @property
    def asks(self) -> bool:
        """Whether it changes anything."""
        return any(getattr(self, f.name) is not f.default for f in fields(self))

    @property
    def mean_share(self) -> NDArray[np.float64]:
        """What the picture leaves of the radiance on average, shape (3,)."""
        return np.ones(3) if self.picture is None else self.picture.astype(np.float64).mean(axis=(0, 1))


PLAIN = LightControl()
EVERYWHERE = Shaping(np.eye(3))
