"""Which kernels a render needs: those of the effects that its scene and its settings call for, and no others."""

from __future__ import annotations

from warpmis.config import RenderConfig
from warpmis.device.compilation import Compilation, load_kernels
from warpmis.rendering.integrator import kernels_of
from warpmis.scene import Scene
from warpmis.scene.features import Features, detect


def features_of(scene: Scene, config: RenderConfig, features: Features | None = None) -> Features:
    """The effects to compile: `features` if given, else what scene and depth call for; and what the method needs."""
    strategies = config.strategies if config.method != "nee" else ()
    features = features or detect(scene).with_depth(config.max_depth)
    features = features.with_strategies(strategies, config.how.statistics).with_sampler(config.sampler)
    return features.with_tree("wide" if config.device == "cpu" else "warp")


def compile_scene(scene: Scene, config: RenderConfig, features: Features | None = None) -> Compilation:
    """Compile the kernels that `render` would launch for the scene, without rendering it.

    Raises:
        ConfigError: the machine lacks the device.
    """
    return load_kernels(kernels_of(features_of(scene, config, features), config), config.device)
