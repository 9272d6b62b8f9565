"""Every kernel compiles for CUDA: shown without a GPU or driver, by ahead-of-time compilation to PTX."""

from __future__ import annotations

from pathlib import Path

import pytest
import warp as wp

from warpmis.config import STRATEGIES
from warpmis.features import Features
from warpmis.kernels.trace import make_trace
from warpmis.learn.newton import make_newton

HOPPER = 90
KERNELS = {
    "trace, every effect, mixture": lambda: make_trace(Features.all(STRATEGIES)),
    "trace, every effect, next-event estimation": lambda: make_trace(Features.all()),
    "trace, no effect": lambda: make_trace(Features()),
    "newton, two strategies": lambda: make_newton(2),
    "newton, five strategies": lambda: make_newton(5),
}


@pytest.mark.parametrize("name", KERNELS)
def test_compiles_for_cuda(name: str, tmp_path: Path) -> None:
    kernel = KERNELS[name]()
    wp.compile_aot_module(kernel.module, arch=[HOPPER], module_dir=tmp_path, use_ptx=True)
    (ptx,) = tmp_path.glob("*.ptx")
    code = ptx.read_text()
    assert f".target sm_{HOPPER}" in code
    assert f".entry {kernel.key}" in code
