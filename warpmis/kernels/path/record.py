"""What learning keeps of a path: the light that came by way of its first vertex, and the rays that it cost.

The first vertex is the first one that is not a mirror. There the strategies share the samples. Kernels that do not
learn have the functions of `no_record`, which do nothing.
"""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import SceneView
from warpmis.kernels.roulette import MAX_SURVIVAL

wp.set_module_options({"enable_backward": False})


@wp.struct
class NoRecord:
    """Nothing."""


@wp.struct
class Record:
    """In the words of kernels/moments.py:

    F: the estimate of the light by way of the first vertex, throughput up to it included; L_before: all other light.
    direct: the part of F that came straight from the lights, met by the ray from the first vertex.
    had_roulette: whether there was a Russian roulette by throughput; those before it end paths at a constant rate.
    early_rays, early_shadow_rays: all that were traced before that roulette; 0 without a first vertex.
    first_bounce: PathState.bounces at the first vertex.
    """

    F: wp.vec3
    L_before: wp.vec3
    direct: wp.vec3
    early_rays: int
    early_shadow_rays: int
    first_bounce: int
    had_roulette: bool


def no_record(PathState: type) -> SimpleNamespace:
    """Functions of the same names as those of `make_record`, for kernels that do not learn."""

    @wp.func
    def begin(path: wp.ref[PathState]):
        pass

    @wp.func
    def emission(path: wp.ref[PathState], radiance: wp.vec3):
        pass

    @wp.func
    def roulette(path: wp.ref[PathState], survival: float):
        pass

    @wp.func
    def end(scene: SceneView, path: wp.ref[PathState]):
        pass

    return SimpleNamespace(begin=begin, emission=emission, roulette=roulette, end=end)


def make_record(PathState: type) -> SimpleNamespace:
    """begin: at the first vertex, after its delta lights and before all other light samples;
    emission: of light that a ray has met; roulette: before each Russian roulette; end: of the path."""

    @wp.func
    def begin(path: wp.ref[PathState]):
        path.record.first_bounce = path.bounces
        path.record.L_before = path.L
        path.L = wp.vec3(0.0, 0.0, 0.0)

    @wp.func
    def emission(path: wp.ref[PathState], radiance: wp.vec3):
        if path.has_scattered and path.bounces == path.record.first_bounce:
            path.record.direct += radiance

    @wp.func
    def roulette(path: wp.ref[PathState], survival: float):
        """survival: the probability that this roulette lets the path live."""
        if not path.record.had_roulette and survival < MAX_SURVIVAL:
            path.record.had_roulette = True
            path.record.early_rays = path.rays
            path.record.early_shadow_rays = path.shadow_rays

    @wp.func
    def end(scene: SceneView, path: wp.ref[PathState]):
        if path.has_scattered:
            path.record.F = path.L
            path.L = path.record.L_before + path.L
            if not path.record.had_roulette:
                path.record.early_rays = path.rays
                path.record.early_shadow_rays = path.shadow_rays

    return SimpleNamespace(begin=begin, emission=emission, roulette=roulette, end=end)
