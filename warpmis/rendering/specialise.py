"""Which kernels a render needs: those of the effects that its scene and its settings call for, and no others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import warp as wp

from warpmis.aovs import asks_for_light
from warpmis.config import RenderConfig
from warpmis.device.compilation import Compilation, Compiler
from warpmis.device.trees import tree_kernels, tree_of
from warpmis.device.upload import check_device
from warpmis.kernels.trace import make_trace
from warpmis.rendering.counted import pilot_kernel, plain_kernel
from warpmis.rendering.guided import guided_kernels
from warpmis.rendering.kernel_choice import camera_kernels, learner_of, trace_kernels
from warpmis.rendering.reporter import ProgressCallback, Reporter
from warpmis.scene import Scene
from warpmis.scene.features import Features, detect


def features_of(scene: Scene, config: RenderConfig, features: Features | None = None) -> Features:
    """The effects to compile: `features` if given, else what scene and depth call for; and what the method needs."""
    strategies = config.strategies if config.method != "nee" and config.how.has_strategies else ()
    features = features or detect(scene).with_depth(config.max_depth)
    features = features.with_strategies(strategies, config.how.statistics).with_sampler(config.sampler)
    features = features.with_allocation(config.how.allocation)
    features = features.with_contributions("apart" if asks_for_light(config.aov) else "summed")
    return features.with_tree(tree_of(config.device))


@dataclass(frozen=True)
class RunKernels:
    """The kernels of a run: those that it needs, in the order in which it does, and those that it may never need."""

    sure: tuple[wp.Kernel, ...]
    perhaps: tuple[wp.Kernel, ...]

    @property
    def all(self) -> tuple[wp.Kernel, ...]:
        return (*self.sure, *self.perhaps)


def kernels_of(features: Features, config: RenderConfig) -> RunKernels:
    """All that a run would launch, whatever the size of its picture.

    Raises:
        ConfigError: the machine lacks the device.
    """
    check_device(config.device)
    tree, ids = tree_kernels(config.device), camera_kernels(features, config)
    if config.how.cache:
        plain, *guided = guided_kernels(features)
        if config.how.tries:
            return RunKernels((plain, *tree, *ids), tuple(guided))
        return RunKernels((*guided, *tree, *ids), (plain,))
    if config.how.allocation == "counts":
        return RunKernels((pilot_kernel(features), *tree, plain_kernel(features), *ids), (make_trace(features),))
    learn, shared = trace_kernels(features)
    return RunKernels((learn, *tree, *learner_of(features, config, (1, 1)).kernels, shared, *ids), ())


def begin_compiling(kernels: Sequence[wp.Kernel], device: str, reporter: Reporter) -> Compiler:
    """Kernels on their way, the first ones first, with a report of how many have to be compiled."""
    compiler = Compiler(device, reporter.compiling)
    compiler.begin(kernels)
    if compiler.absent:
        plural = "s" if compiler.absent > 1 else ""
        reporter.phase("compile", f"{compiler.absent} kernel{plural}, first use of these effects")
    return compiler


def compile_scene(
    scene: Scene, config: RenderConfig, features: Features | None = None, progress: ProgressCallback | None = None
) -> Compilation:
    """Compile the kernels that `render` would launch for the scene, without rendering it.

    Raises:
        ConfigError: the machine lacks the device.
        WarpmisError: there is no room to compile them.
    """
    reporter = Reporter(progress)
    reporter.phase("compile")
    kernels = kernels_of(features_of(scene, config, features), config).all
    with begin_compiling(kernels, config.device, reporter) as compiler:
        compiler.wait(kernels)
        return compiler.outcome()
