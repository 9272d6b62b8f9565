"""Which kernels the parts of a render launch, by its effects and settings."""

from __future__ import annotations

import warp as wp

from warpmis.config import RenderConfig
from warpmis.kernels.identify import make_identify
from warpmis.kernels.trace import make_trace
from warpmis.learn.learner import Learner
from warpmis.scene.features import Features


def trace_kernels(features: Features) -> tuple[wp.Kernel, wp.Kernel, wp.Kernel]:
    """For rounds that learn; in the others for pixels with the mixture, and for those with next-event estimation.

    The second is the first where learning takes no statistics. The third is the second where pixels have no choice.
    """
    mixture = features.with_strategies(features.strategies)
    next_event = features.with_strategies(()) if features.learns_from_pairs else mixture
    return make_trace(features), make_trace(mixture), make_trace(next_event)


def learner_of(features: Features, config: RenderConfig, size: tuple[int, int]) -> Learner:
    """size: the picture's width and height [pixel]."""
    stratified = config.strategy_choice == "stratified"
    lattice = config.sampler == "lattice"
    return Learner(config.how, features.strategies, size, stratified, config.device, config.learn_stride, lattice)


def identify_of(features: Features, config: RenderConfig) -> list[wp.Kernel]:
    """The kernel that finds ids, if they are asked for: one for all methods and samplers."""
    return [make_identify(features.with_strategies(()).with_sampler())] if config.ids else []
