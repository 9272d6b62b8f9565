"""Which kernels a render needs: those of the effects that its scene and its settings call for, and no others."""

from __future__ import annotations

import warp as wp

from warpmis.config import RenderConfig
from warpmis.device.compilation import Compilation, load_kernels
from warpmis.device.trees import tree_kernels
from warpmis.device.upload import check_device
from warpmis.rendering.guided import guided_kernels
from warpmis.rendering.integrator import identify_of, learner_of, trace_kernels
from warpmis.scene import Scene
from warpmis.scene.features import Features, detect


def features_of(scene: Scene, config: RenderConfig, features: Features | None = None) -> Features:
    """The effects to compile: `features` if given, else what scene and depth call for; and what the method needs."""
    strategies = config.strategies if config.method != "nee" and not config.how.cache else ()
    features = features or detect(scene).with_depth(config.max_depth)
    features = features.with_strategies(strategies, config.how.statistics).with_sampler(config.sampler)
    return features.with_tree("wide" if config.device == "cpu" else "warp")


def kernels_of(features: Features, config: RenderConfig) -> list[wp.Kernel]:
    """All that a run would launch, whatever the size of its picture.

    Raises:
        ConfigError: the machine lacks the device.
    """
    check_device(config.device)
    if config.how.cache:
        return [*guided_kernels(features), *identify_of(features, config), *tree_kernels(config.device)]
    kernels = [*learner_of(features, config, (1, 1)).kernels, *identify_of(features, config)]
    return [*trace_kernels(features), *kernels, *tree_kernels(config.device)]


def compile_scene(scene: Scene, config: RenderConfig, features: Features | None = None) -> Compilation:
    """Compile the kernels that `render` would launch for the scene, without rendering it.

    Raises:
        ConfigError: the machine lacks the device.
    """
    return load_kernels(kernels_of(features_of(scene, config, features), config), config.device)
