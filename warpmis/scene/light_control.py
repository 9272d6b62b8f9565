"""What a light does beside shining alike everywhere: in which directions, on which materials and on which prims."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class IesProfile:
    """Luminous intensity over directions, linear between its angles and 0 beyond the vertical ones.

    Attributes:
        vertical: angles from the light's axis, shape (v,) float64 [radian], ascending.
        horizontal: angles about it, from the light's +X towards +Y, shape (h,) float64 [radian], ascending, a full
            turn.
        candela: shape (h, v) float64, not negative.
    """

    vertical: NDArray[np.float64]
    horizontal: NDArray[np.float64]
    candela: NDArray[np.float64]

    @property
    def mean(self) -> float:
        """Mean intensity over the sphere: the profile's power over 4 pi."""
        theta = (np.arange(7200) + 0.5) / 7200 * np.pi
        around = np.trapezoid(_within_a_turn(self), axis=0, x=np.linspace(0.0, 1.0, TURN_STEPS + 1))
        intensity = np.interp(theta, self.vertical, around, left=0.0, right=0.0)
        return float((intensity * np.sin(theta)).mean() * np.pi / 2.0)


TURN_STEPS = 1440


def _within_a_turn(profile: IesProfile) -> NDArray[np.float64]:
    """Intensities at TURN_STEPS + 1 horizontal angles from 0 to 2 pi."""
    phi = np.linspace(0.0, 2.0 * np.pi, TURN_STEPS + 1)
    return np.stack([np.interp(phi, profile.horizontal, column) for column in profile.candela.T], axis=1)


@dataclass(frozen=True, eq=False)
class Shaping:
    """The share of a light's radiance that leaves in a direction (UsdLuxShapingAPI), with the angle t to the axis:

    lerp(|cos t|^focus, focus_tint, 1) (1 - smoothstep(t; (1 - cone_softness) cone_angle, cone_angle))

    times the intensity of `ies`, at t / ies_angle_scale, or (t - pi) / -ies_angle_scale + pi for a negative one.

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
    ies: IesProfile | None = None
    ies_angle_scale: float = 1.0


@dataclass(frozen=True, eq=False)
class LightControl:
    """All that UsdLux lets change about a light whose shape and mean radiance are given; the default changes nothing.

    Attributes:
        shaping: where the light shines to; None for everywhere.
        picture: of a RectLight alone, a factor on its radiance, linear Rec.709, shape (rows, columns, 3) float32, row 0
            at +half_v and column 0 at +half_u; interpolated between texels.
        tint: of a light made of geometry, a factor on what its material emits, seen by surfaces but not by the camera,
            shape (3,) float64; None for 1.
        diffuse, specular: factors on what the diffuse and the specular lobes of materials make of the light.
        group: key of the light group that it belongs to, "" for none.
        illuminates: which of Scene.prims the light reaches, shape (prims,) bool; None for all.
        shadow_casters: which of Scene.prims stand in its way, shape (prims,) bool; None for all.
    """

    shaping: Shaping | None = None
    picture: NDArray[np.float32] | None = None
    tint: NDArray[np.float64] | None = None
    diffuse: float = 1.0
    specular: float = 1.0
    group: str = ""
    illuminates: NDArray[np.bool_] | None = None
    shadow_casters: NDArray[np.bool_] | None = None

    @property
    def asks(self) -> bool:
        """Whether it changes anything."""
        given = (self.shaping, self.picture, self.tint, self.illuminates, self.shadow_casters)
        return self.changes_response or any(value is not None for value in given)

    @property
    def changes_response(self) -> bool:
        return (self.diffuse, self.specular) != (1.0, 1.0)

    @property
    def mean_share(self) -> NDArray[np.float64]:
        """What picture, tint and profile make of the radiance on average, shape (3,)."""
        share = self.shaping.ies.mean if self.shaping and self.shaping.ies else 1.0
        picture = np.ones(3) if self.picture is None else self.picture.astype(np.float64).mean(axis=(0, 1))
        return share * (picture if self.tint is None else picture * self.tint)


PLAIN = LightControl()
EVERYWHERE = Shaping(np.eye(3))
