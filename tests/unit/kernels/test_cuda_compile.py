"""Every kernel compiles for CUDA: shown without a GPU or driver, by ahead-of-time compilation to PTX."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import warp as wp

from warpmis.config import CELL_STRATEGIES, DEFAULT_STRATEGIES, STRATEGIES
from warpmis.kernels.identify import make_identify
from warpmis.kernels.moments import Layout
from warpmis.kernels.trace import make_trace
from warpmis.learn.control_variate import make_control_variate, make_in_radiance
from warpmis.learn.expectation import make_expectation
from warpmis.learn.newton_seed import make_newton_seed
from warpmis.learn.newton_share import make_newton_share
from warpmis.learn.newton_simplex import make_newton_simplex
from warpmis.learn.pooling import make_pool, make_relative, make_row_sums
from warpmis.learn.variance_aware import make_end_round, make_variance_aware
from warpmis.learn.whole_samples import make_whole_samples
from warpmis.methods import METHODS
from warpmis.scene.features import Features

HOPPER = 90
EVERY = Features.all().with_tree("warp")
FEW = Features(rect_light=True, dome_constant=True, specular=True, clearcoat=True, indirect=True, tree="warp")
MANY = replace(
    FEW,
    **dict.fromkeys(("sphere_light", "delta_light", "shaping", "dome_picture", "opacity"), True),
    **dict.fromkeys(("transmission", "absorption", "textures", "shading_normals"), True),
)
# Apart from the others: together they take longer than each by itself.
TREES = Features(
    specular=True, indirect=True, delta_light=True, mesh_light=True, light_tree=True, instances=True,
    emissive_instances=True, tree="warp",
)  # fmt: skip
POOLED = Layout(2, METHODS["pooled"].statistics)
COST_AWARE = METHODS["cost-aware"].statistics
COUNTS = FEW.with_strategies(DEFAULT_STRATEGIES).with_allocation("counts")
WEIGHTS = FEW.with_strategies(DEFAULT_STRATEGIES).with_allocation("weights")
CONTROL = replace(FEW, mesh_light=True).with_strategies(DEFAULT_STRATEGIES).with_allocation("control")
OF_WEIGHTS, OF_CONTROL = METHODS["variance_aware"].statistics, METHODS["optimal"].statistics
KERNELS = {
    "trace, every effect, mixture": lambda: make_trace(EVERY.with_strategies(STRATEGIES)),
    "trace, every effect, next-event estimation": lambda: make_trace(EVERY),
    "trace, no effect": lambda: make_trace(Features().with_tree("warp")),
    "trace, few effects, every strategy": lambda: make_trace(FEW.with_strategies(STRATEGIES)),
    "trace, few effects, cost-aware": lambda: make_trace(FEW.with_strategies(DEFAULT_STRATEGIES, COST_AWARE)),
    "trace, few effects, counts": lambda: make_trace(COUNTS),
    "trace, few effects, pilot of counts": lambda: make_trace(COUNTS.with_strategies(DEFAULT_STRATEGIES, ("parts",))),
    "trace, few effects, weights": lambda: make_trace(WEIGHTS),
    "trace, few effects, pilot of weights": lambda: make_trace(WEIGHTS.with_strategies(DEFAULT_STRATEGIES, OF_WEIGHTS)),
    "trace, few effects, control": lambda: make_trace(CONTROL),
    "trace, many effects, next-event estimation": lambda: make_trace(MANY),
    "trace, lights of instances by trees": lambda: make_trace(TREES),
    "trace, every effect, guided": lambda: make_trace(EVERY.with_cache()),
    "trace, few effects, mixture by cells": lambda: make_trace(FEW.with_strategies(CELL_STRATEGIES).with_cache()),
    "identify, every effect": lambda: make_identify(EVERY),
    "newton_share": lambda: make_newton_share(Layout(2)),
    "newton_seed, four strategies": lambda: make_newton_seed(Layout(4)),
    "newton_seed, eight strategies": lambda: make_newton_seed(Layout(8)),
    "newton_simplex, eight strategies": lambda: make_newton_simplex(Layout(8, COST_AWARE)),
    "expectation, eight strategies": lambda: make_expectation(Layout(8, METHODS["kl-em"].statistics)),
    "end of a round": lambda: make_end_round(Layout(0, OF_WEIGHTS)),
    "weights by variances": lambda: make_variance_aware(Layout(0, OF_WEIGHTS)),
    "control variate": lambda: make_control_variate(Layout(0, OF_CONTROL)),
    "control variate in radiance": make_in_radiance,
    "relative": lambda: make_relative(POOLED),
    "row sums": lambda: make_row_sums(POOLED),
    "pool": lambda: make_pool(POOLED),
    "whole samples, eight strategies": lambda: make_whole_samples(8),
}
# Of parts that shorter ones compile: nearly all of those of every effect, which take over a minute each; what is added
# up is in test_cuda_statistics.py, too.
LONG = {name for name in KERNELS if name.startswith("trace, every effect")} | {
    "trace, few effects, cost-aware",
    "trace, few effects, pilot of weights",
    "newton_seed, eight strategies",
}


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.slow] * (name in LONG)) for name in KERNELS])
def test_compiles_for_cuda(name: str, tmp_path: Path) -> None:
    kernel = KERNELS[name]()
    wp.compile_aot_module(kernel.module, arch=[HOPPER], module_dir=tmp_path, use_ptx=True)
    (ptx,) = tmp_path.glob("*.ptx")
    code = ptx.read_text()
    assert f".target sm_{HOPPER}" in code
    assert f".entry {kernel.key}" in code
