"""What a light tree is built over: where each light is, where it shines to and how much, for kernels/light/tree.py."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from warpmis.device.struct_arrays import Records
from warpmis.device.views import CYLINDER, DISK, RECT, SPHERE
from warpmis.scene.light_control import LightControl, Shaping

FloatArray = NDArray[np.float64]

# Cones are wider by so much than what they hold, so that rounding leaves nothing outside [radian].
CONE_SLACK = 1e-3
# Bits of `links`: a light without a list of prims has the last; each list has one of the others.
LINK_BITS = 31
ALL_PRIMS = 1 << LINK_BITS


@dataclass(frozen=True, eq=False)
class LightLeaves:
    """Lights as a tree sees them, one row each.

    Attributes:
        low, high: corners of the box that holds the light, shape (n, 3).
        mean: its centre, shape (n, 3); variance: mean squared distance of its points from there, shape (n,).
        weight: luminance times area, over 4: the intensity in all directions of a body that shows each of its sides
            alike, shape (n,), above 0.
        axis, cone: a unit vector, shape (n, 3), and the angle to it up to which light is emitted [radian], shape (n,).
        directed: 1 where a flat light's intensity falls off with the cosine to the axis, else 0, shape (n,).
        two_sided: flat, and alike on both sides, shape (n,).
        links: bits of which a prim that the light reaches has one at least, shape (n,) uint32.
    """

    low: FloatArray
    high: FloatArray
    mean: FloatArray
    variance: FloatArray
    weight: FloatArray
    axis: FloatArray
    cone: FloatArray
    directed: FloatArray
    two_sided: NDArray[np.bool_]
    links: NDArray[np.uint32]

    def __len__(self) -> int:
        return len(self.weight)

    def then(self, others: LightLeaves) -> LightLeaves:
        """These rows followed by others."""
        return LightLeaves(*(np.concatenate([getattr(self, f.name), getattr(others, f.name)]) for f in fields(self)))


def analytic_leaves(records: Records, controls: Sequence[LightControl], links: NDArray[np.uint32]) -> LightLeaves:
    """The leaves of rect, disk, sphere and cylinder lights, from their records (views.LightView)."""
    kind, center = records["kind"], records["center"].astype(np.float64)
    u, v = records["u"].astype(np.float64), records["v"].astype(np.float64)
    radius = np.where(np.isin(kind, (SPHERE, CYLINDER)), records["radius"], 0.0).astype(np.float64)[:, None]
    is_rect, is_disk, is_flat = kind == RECT, kind == DISK, np.isin(kind, (RECT, DISK))
    reach = np.select([is_rect[:, None], is_disk[:, None]], [np.abs(u) + np.abs(v), np.hypot(u, v)], np.abs(u) + radius)
    squares = (u**2).sum(axis=1), (v**2).sum(axis=1)
    variance = np.select(
        [is_rect, is_disk, kind == CYLINDER],
        [(squares[0] + squares[1]) / 3.0, (squares[0] + squares[1]) / 4.0, squares[0] / 3.0 + radius[:, 0] ** 2],
        radius[:, 0] ** 2,
    )
    axis = np.where(is_flat[:, None], records["n"], (0.0, 0.0, 1.0)).astype(np.float64)
    cone = np.where(is_flat, 0.5 * np.pi, np.pi)
    weight = records["luminance"].astype(np.float64) * records["area"] / 4.0
    for i, control in enumerate(controls[: len(kind)]):
        if control.shaping is not None:
            widest = emission_angle(control.shaping)
            weight[i] *= over_cone(control.shaping, widest)
            towards = -control.shaping.to_world[:, 2]
            # A flat light that is sheared has its front elsewhere: that of its plane alone is sure.
            if widest < cone[i] and (not is_flat[i] or towards @ axis[i] > 1.0 - 1e-6):
                axis[i], cone[i] = towards, widest
    return LightLeaves(
        low=center - reach,
        high=center + reach,
        mean=center,
        variance=variance,
        weight=weight,
        axis=axis,
        cone=np.minimum(cone + CONE_SLACK, np.pi),
        directed=is_flat.astype(np.float64),
        two_sided=np.zeros(len(kind), bool),
        links=links,
    )


def point_leaves(
    place: FloatArray, intensity: FloatArray, controls: Sequence[LightControl], links: NDArray[np.uint32]
) -> LightLeaves:
    """The leaves of point lights.

    Args:
        place: shape (n, 3); intensity: its luminance in any unit, shape (n,), above 0.
    """
    count = len(place)
    axis, cone = np.tile((0.0, 0.0, 1.0), (count, 1)), np.full(count, np.pi)
    weight = intensity.copy()
    for i, control in enumerate(controls):
        if control.shaping is not None:
            axis[i], cone[i] = -control.shaping.to_world[:, 2], emission_angle(control.shaping)
            weight[i] *= over_cone(control.shaping, cone[i])
    return LightLeaves(
        low=place,
        high=place,
        mean=place,
        variance=np.zeros(count),
        weight=weight,
        axis=axis,
        cone=np.minimum(cone + CONE_SLACK, np.pi),
        directed=np.zeros(count),
        two_sided=np.zeros(count, bool),
        links=links,
    )


def over_cone(shaping: Shaping, angle: float) -> float:
    """A profile's mean over the cone that it shines in, over that over the sphere, which LightControl states."""
    return 1.0 if shaping.ies is None else 2.0 / max(1.0 - float(np.cos(angle)), 1e-3)


def emission_angle(shaping: Shaping) -> float:
    """The angle to the light's axis beyond which a shaping leaves nothing [radian]."""
    angle = shaping.cone_angle
    if shaping.ies is not None and shaping.ies_angle_scale > 0.0:
        lit = np.flatnonzero(shaping.ies.candela.max(axis=0) > 0.0)
        last = min(lit[-1] + 1, len(shaping.ies.vertical) - 1) if len(lit) else 0
        angle = min(angle, float(shaping.ies.vertical[last]) * shaping.ies_angle_scale)
    return angle


def triangle_leaves(
    corners: FloatArray, luminance: FloatArray, two_sided: NDArray[np.bool_], links: NDArray[np.uint32]
) -> LightLeaves:
    """The leaves of emissive triangles.

    Args:
        corners: shape (n, 3, 3), counter-clockwise seen from the front; luminance: shape (n,), above 0.
    """
    a, b, c = (corners[:, k] for k in range(3))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    mean = (a + b + c) / 3.0
    return LightLeaves(
        low=np.minimum(np.minimum(a, b), c),
        high=np.maximum(np.maximum(a, b), c),
        mean=mean,
        variance=sum(((corner - mean) ** 2).sum(axis=1) for corner in (a, b, c)) / 12.0,
        weight=luminance * 0.5 * length / 4.0 * np.where(two_sided, 2.0, 1.0),
        axis=normal / length[:, None],
        cone=np.where(two_sided, np.pi, 0.5 * np.pi + CONE_SLACK),
        directed=np.ones(len(length)),
        two_sided=two_sided,
        links=links,
    )


def link_bits(controls: Sequence[LightControl], prims: int) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
    """`links` of lights with these controls, shape (n,), and the bits of each prim, shape (prims,).

    Lists of prims beyond the first LINK_BITS share bits: a light may then look as if it reached a prim that it does
    not, never the other way round.
    """
    lists: dict[bytes, int] = {}
    lights = np.full(len(controls), ALL_PRIMS, np.uint32)
    reached = np.full(prims, ALL_PRIMS, np.uint32)
    for i, control in enumerate(controls):
        if control.illuminates is None:
            continue
        key = control.illuminates.tobytes()
        bit = np.uint32(1 << (lists.setdefault(key, len(lists)) % LINK_BITS))
        lights[i] = bit
        reached[control.illuminates] |= bit
    return lights, reached
