"""What a pilot of counts.py keeps of a path: what its first two light samples and its first two branches brought.

With R for all light that neither of them brought, and L_i and B_j for what each would have brought alone:

    U_0, U_1, B_0, B_1    luminance of R + L_i, and of B_j
    rays, shadow_rays     before the branches: all rays, and those of the light samples

Kernels that do not learn have functions of the same names, which do nothing.
"""

from types import SimpleNamespace

import warp as wp

from warpmis.kernels.path.record import NoRecord, no_record
from warpmis.kernels.shading_frame import luminance

wp.set_module_options({"enable_backward": False})

vec_parts = wp.types.vector(length=6, dtype=wp.float32)
B_0, RAYS, SHADOW_RAYS = 2, 4, 5


@wp.struct
class Parts:
    """sums: as above; rest: R; seen: the luminance of PathState.L up to the last part."""

    sums: vec_parts
    rest: float
    seen: float


def parts_type(is_on: bool) -> type:
    return Parts if is_on else NoRecord


def make_parts(PathState: type, is_on: bool) -> SimpleNamespace:
    """Functions of no_record; and begin_vertex, light_sample, end_light_samples, branch."""
    functions = no_record(PathState)

    @wp.func
    def begin_vertex(path: wp.ref[PathState]):
        if wp.static(is_on):
            path.record.rest = luminance(path.L)
            path.record.seen = path.record.rest
            path.record.sums[SHADOW_RAYS] = -float(path.shadow_rays)

    @wp.func
    def light_sample(path: wp.ref[PathState], sample: int, count: int):
        if wp.static(is_on):
            if sample < 2:
                now = luminance(path.L)
                path.record.sums[sample] = path.record.rest + (now - path.record.seen) * float(count)
                path.record.seen = now

    @wp.func
    def end_light_samples(path: wp.ref[PathState]):
        if wp.static(is_on):
            path.record.seen = luminance(path.L)
            path.record.sums[RAYS] = float(path.rays)
            path.record.sums[SHADOW_RAYS] += float(path.shadow_rays)

    @wp.func
    def branch(path: wp.ref[PathState], index: int, count: int):
        """After a branch; count: 0 for a path without a first vertex."""
        if wp.static(is_on):
            now = luminance(path.L)
            if count == 0:
                path.record.sums[0] = now
                path.record.sums[1] = now
                path.record.sums[RAYS] = float(path.rays)
            elif index < 2:
                path.record.sums[B_0 + index] = (now - path.record.seen) * float(count)
                path.record.seen = now

    functions.begin_vertex, functions.light_sample = begin_vertex, light_sample
    functions.end_light_samples, functions.branch = end_light_samples, branch
    return functions
