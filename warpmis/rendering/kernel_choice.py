"""Which kernels the parts of a render launch, by its effects and settings."""

from __future__ import annotations

import warp as wp

from warpmis.aovs import asks_for_surfaces
from warpmis.config import RenderConfig
from warpmis.kernels.coverage import make_coverage
from warpmis.kernels.first_surface import make_locate_surface
from warpmis.kernels.identify import make_identify
from warpmis.kernels.trace import make_trace
from warpmis.learn.learner import Learner
from warpmis.scene.features import Features


def trace_kernels(features: Features) -> tuple[wp.Kernel, wp.Kernel]:
    """For rounds that learn, and for the others: the same one where learning takes no statistics."""
    return make_trace(features), make_trace(features.with_strategies(features.strategies))


def learner_of(features: Features, config: RenderConfig, size: tuple[int, int]) -> Learner:
    """size: the picture's width and height [pixel]."""
    stratified = config.strategy_choice == "stratified"
    lattice = config.sampler == "lattice"
    return Learner(config.how, features.strategies, size, stratified, config.device, lattice)


def identify_of(features: Features, config: RenderConfig) -> list[wp.Kernel]:
    """The kernel that finds ids, if they are asked for: one for all methods and samplers."""
    return [make_identify(_of_camera(features).with_sampler())] if config.ids else []


def coverage_of(features: Features, config: RenderConfig) -> list[wp.Kernel]:
    """The kernel that finds what covers each pixel, if that is asked for: one for all methods."""
    return [make_coverage(_of_camera(features))] if config.cryptomatte else []


def locate_of(features: Features, config: RenderConfig) -> list[wp.Kernel]:
    """The kernel that finds the surface in the middle of each pixel, if AOVs ask for it: one for all methods."""
    return [make_locate_surface(_of_camera(features).with_sampler())] if asks_for_surfaces(config.aov) else []


def camera_kernels(features: Features, config: RenderConfig) -> list[wp.Kernel]:
    """All those that trace camera rays alone."""
    return [*identify_of(features, config), *coverage_of(features, config), *locate_of(features, config)]


def _of_camera(features: Features) -> Features:
    """The effects, but for those of paths."""
    return features.with_strategies(()).with_contributions()
