"""Kernels are named by what they are specialised to: two that differ are two modules, from every factory."""

from __future__ import annotations

import ast
import importlib
from collections.abc import Callable, Iterator
from itertools import combinations
from pathlib import Path
from typing import Any

import pytest
import warp as wp

import warpmis
from warpmis.device.kernel_factory import CPU_COMPILER_FLAGS, KernelFunction, kernel_factory
from warpmis.kernels.moments import Layout
from warpmis.methods import METHODS
from warpmis.scene.features import Features

PACKAGE = Path(warpmis.__file__).parent
OWN_FILE = PACKAGE / "device" / "kernel_factory.py"
SOURCES = [path for path in sorted(PACKAGE.rglob("*.py")) if path != OWN_FILE]


def make_weight(names: tuple[str, ...]) -> Callable[[], float]:
    """A device function with static values that depend on a loop's variable, as the table of strategies has them."""
    count = len(names)

    @wp.func
    def weight() -> float:
        total = float(0.0)  # noqa: UP018  # so Warp declares a variable
        for i in range(wp.static(count)):
            if wp.static(names[i] == "heavy"):
                total += float(i + 1)
        return total

    return weight


@kernel_factory
def make_weigh(names: tuple[str, ...], offset: float = 0.0) -> KernelFunction:
    weight = make_weight(names)

    def weigh(out: wp.array(dtype=float)):  # type: ignore[valid-type, no-untyped-def]
        out[wp.tid()] = weight() + wp.static(offset)

    return weigh


def test_kernels_that_differ_in_a_static_value_of_a_loop_are_two() -> None:
    """Warp by itself gives both one name, and the second one silently runs the code of the first."""
    results = []
    for names in (("heavy", "light"), ("light", "heavy")):
        out = wp.zeros(1, dtype=float, device="cpu")
        wp.launch(make_weigh(names), dim=1, inputs=[out], device="cpu")
        results.append(float(out.numpy()[0]))
    assert results == [1.0, 2.0]


def test_equal_arguments_give_one_kernel_however_they_are_given() -> None:
    names = ("heavy",)
    assert make_weigh(names) is make_weigh(names=names) is make_weigh(names, offset=0.0)
    assert make_weigh(names, 1.0) is not make_weigh(names)


def test_a_caller_s_compiler_flags_are_not_ours(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is compiled otherwise, nor anew."""
    before = make_weigh(("caller",))
    monkeypatch.setattr(wp.config, "cpu_compiler_flags", "-march=native")
    after = make_weigh(("light", "caller"))
    options = [kernel.module.resolve_options(wp.config)["cpu_compiler_flags"] for kernel in (before, after)]
    assert options == [CPU_COMPILER_FLAGS] * 2


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.relative_to(PACKAGE).as_posix())
def test_kernels_come_from_the_factory_alone(path: Path) -> None:
    """No file uses Warp's own decorator, and ours for kernels that are not specialised stands at a module's top."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    top = {
        id(decorator) for node in tree.body if isinstance(node, ast.FunctionDef) for decorator in node.decorator_list
    }
    for node in ast.walk(tree):
        where = f"{path}:{getattr(node, 'lineno', 0)}"
        if isinstance(node, ast.ImportFrom) and node.module == "warp":
            raise AssertionError(f"{where}: import warp as wp")
        if isinstance(node, ast.Name) and node.id == "device_kernel":
            assert id(node) in top, f"{where}: a kernel within a function needs kernel_factory"
        if isinstance(node, ast.Call | ast.FunctionDef):
            names = [node.func] if isinstance(node, ast.Call) else node.decorator_list
            assert "wp.kernel" not in map(ast.unparse, names), f"{where}: use kernel_factory or device_kernel"


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.relative_to(PACKAGE).as_posix())
def test_no_struct_has_the_name_of_a_constant_of_warp(path: Path) -> None:
    """Until a function is built, Warp takes `e.x` for a constant, wp.e, and afterwards for a field of the variable e:
    each kernel that calls the function would then be named anew, and compiled again."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            name = node.value.id
            assert not isinstance(getattr(wp, name, None), float), f"{path}:{node.lineno}: {name} is a constant of Warp"


def factories() -> Iterator[tuple[str, Callable[..., wp.Kernel]]]:
    """All functions of the package that `kernel_factory` decorates."""
    for path in SOURCES:
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.FunctionDef) and "kernel_factory" in map(ast.unparse, node.decorator_list):
                module = ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts)
                yield node.name, getattr(importlib.import_module(module), node.name)


TWO = Layout(2, METHODS["pooled"].statistics)
WEIGHTS, OTHER_WEIGHTS = (Layout(2, (*METHODS["variance_aware"].statistics, *more)) for more in ((), ("mean",)))
CONTROL, OTHER_CONTROL = (Layout(2, (*METHODS["optimal"].statistics, *more)) for more in ((), ("mean",)))
THREE, FOUR = (Layout(count, METHODS["cost-aware"].statistics) for count in (3, 4))

# Arguments that differ as little as they can.
DIFFERING: dict[str, list[tuple[Any, ...]]] = {
    "make_trace": [
        *((Features().with_strategies(("bsdf", name)),) for name in ("light", "uniform", "cosine", "specular")),
        (Features().with_cache(),),
        (Features().with_contributions("apart"),),
    ],
    "make_locate": [()],
    "make_coverage": [(Features(),), (Features(opacity=True),)],
    "make_locate_surface": [(Features(),), (Features(opacity=True),)],
    "make_identify": [(Features(),), (Features(opacity=True),)],
    "make_relative": [(THREE,), (FOUR,), (TWO,)],
    "make_row_sums": [(THREE,), (FOUR,), (TWO,)],
    "make_pool": [(THREE,), (FOUR,), (TWO,)],
    "make_expectation": [(Layout(count, ("posterior",)),) for count in (2, 3)],
    "make_newton_seed": [(Layout(2),), (Layout(3),)],
    "make_newton_share": [(Layout(2),), (Layout(2, ("mean",)),)],
    "make_newton_simplex": [(THREE,), (FOUR,)],
    "make_whole_samples": [(2,), (3,)],
    "make_end_round": [(WEIGHTS,), (OTHER_WEIGHTS,)],
    "make_variance_aware": [(WEIGHTS,), (OTHER_WEIGHTS,)],
    "make_control_variate": [(CONTROL,), (OTHER_CONTROL,)],
    "make_in_radiance": [()],
}


@pytest.mark.parametrize("name", DIFFERING)
def test_other_arguments_give_another_module(name: str) -> None:
    factory = dict(factories())[name]
    kernels = [factory(*arguments) for arguments in DIFFERING[name]]
    for mine, other in combinations(kernels, 2):
        assert mine.key != other.key and mine.module.name != other.module.name
    assert all(factory(*arguments) is kernel for arguments, kernel in zip(DIFFERING[name], kernels, strict=True))


def test_no_factory_is_left_out() -> None:
    assert {name for name, _ in factories()} == set(DIFFERING)
