"""What each method adds up beside the moments compiles for CUDA, in the trace kernel of no scene's effects."""

from __future__ import annotations

from pathlib import Path

import pytest
import warp as wp

from warpmis.config import DEFAULT_STRATEGIES, STRATEGIES
from warpmis.kernels.trace import make_trace
from warpmis.methods import METHODS
from warpmis.scene.features import Features

HOPPER = 90
# The first method of each, for all strategies where it takes them.
BY_STATISTICS = {method.statistics: name for name, method in reversed(METHODS.items())}


@pytest.mark.parametrize("name", BY_STATISTICS.values())
def test_statistics_of_a_method_compile_for_cuda(name: str, tmp_path: Path) -> None:
    method = METHODS[name]
    strategies = DEFAULT_STRATEGIES if method.two_strategies else STRATEGIES
    features = Features(tree="warp").with_strategies(strategies, method.statistics)
    compile_for_cuda(features.with_allocation(method.allocation), tmp_path)


def test_paths_by_the_cache_compile_for_cuda(tmp_path: Path) -> None:
    compile_for_cuda(Features(tree="warp", indirect=True).with_cache(), tmp_path)


def compile_for_cuda(features: Features, tmp_path: Path) -> None:
    kernel = make_trace(features)
    wp.compile_aot_module(kernel.module, arch=[HOPPER], module_dir=tmp_path, use_ptx=True)
    (ptx,) = tmp_path.glob("*.ptx")
    assert f".entry {kernel.key}" in ptx.read_text()
