"""From the record of a path (path/record.py) to the pixel's moments (moments.py)."""

from types import SimpleNamespace

import warp as wp

from warpmis.kernels.moments import SHADOW_RAY_COST, Layout, make_moments, squared
from warpmis.kernels.shading_frame import luminance
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})


PARTS = 6
vec_parts_d = wp.types.vector(length=PARTS, dtype=wp.float64)
no_moments = wp.types.vector(length=1, dtype=wp.float64)


@wp.func
def ray_cost(rays: int, shadow_rays: int) -> float:
    """In units of a path's ray with the vertex at its end."""
    return float(rays) + SHADOW_RAY_COST * float(shadow_rays)


def make_sums_of_parts(PathState: type, is_on: bool) -> SimpleNamespace:
    """The same for kernels with counts of samples, whose moments are the sums of path/parts.py."""
    vec_k = vec_parts_d if is_on else no_moments

    @wp.func
    def add(sums: wp.ref[vec_k], path: wp.ref[PathState], direct_only: bool):
        if wp.static(is_on):
            for i in range(wp.static(PARTS)):
                sums[i] += wp.float64(path.record.sums[i])

    return SimpleNamespace(vec_k=vec_k, is_on=is_on, add=add)


def make_sums_of_pair(PathState: type, layout: Layout) -> SimpleNamespace:
    """The same for kernels that learn how to join next-event estimation's two samples (path/weighted_pair.py)."""
    vec_k = layout.vec
    is_on = layout.size > 0
    mean, now, control = layout.offset("mean"), layout.offset("between_rounds") + 1, layout.offset("control")

    @wp.func
    def add(sums: wp.ref[vec_k], path: wp.ref[PathState], direct_only: bool):
        if wp.static(is_on):
            F = path.record.light + path.record.bsdf
            sums[wp.static(mean)] += wp.float64(luminance(F))
            sums[wp.static(mean + 1)] += squared(F)
            if wp.static(now > 0):
                sums[wp.static(now)] += wp.float64(luminance(path.record.light))
                sums[wp.static(now + 1)] += wp.float64(luminance(path.record.bsdf))
            if wp.static(control >= 0):
                c = path.estimate.control
                for color in range(3):
                    sums[wp.static(control) + color] += wp.float64(F[color] * c)
                sums[wp.static(control + 3)] += wp.float64(c * c)

    return SimpleNamespace(vec_k=vec_k, is_on=is_on, add=add)


def make_learning(features: Features, path: SimpleNamespace) -> SimpleNamespace:
    """The type vec_k of a pixel's moments; is_on, whether there are any; and add, which adds a path to them."""
    if features.allocation == "counts":
        return make_sums_of_parts(path.PathState, "parts" in features.statistics)
    if features.allocation in ("weights", "control"):
        return make_sums_of_pair(path.PathState, Layout(0, features.statistics))
    strategies = path.strategies
    layout = Layout(strategies.count if strategies.count > 1 else 0, features.statistics)
    moments = make_moments(layout)
    vec_k = moments.vec_k
    PathState = path.PathState

    @wp.func
    def add_statistics(sums: wp.ref[vec_k], path: wp.ref[PathState], early_cost: float, late_cost: float):
        sums = moments.add_statistics(
            sums,
            path.record.F,
            early_cost,
            late_cost,
            path.estimate.q,
            path.estimate.allocation,
        )

    @wp.func
    def add(sums: wp.ref[vec_k], path: wp.ref[PathState], direct_only: bool):
        """direct_only: the moments are those of the light that comes straight from the lights."""
        F = path.record.F
        if direct_only:
            F = path.record.direct
        sums = moments.add(sums, F, path.estimate.q)
        if wp.static(len(features.statistics) > 0):
            # The cost of a path without a first vertex does not depend on the shares: all of it is late cost.
            early_cost = ray_cost(path.record.early_rays, path.record.early_shadow_rays)
            late_cost = ray_cost(path.rays, path.shadow_rays) - early_cost
            add_statistics(sums, path, early_cost, late_cost)

    return SimpleNamespace(vec_k=vec_k, is_on=layout.size > 0, add=add)
