"""Functions are small enough to read: few parameters, and few lines; kernels and device functions most of all."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

PACKAGE = Path(__file__).parent.parent / "warpmis"
MAX_PARAMETERS = 12
# A factory is as long as the functions in it: those are counted one by one.
MAX_LINES = 45
MAX_DEVICE_LINES = 50
MAX_LINES_OF_LI = 100
LI = ("Li", "follow")  # the path tracer and its loop
DEVICE_DECORATORS = ("wp.func", "wp.kernel", "device_kernel")


def functions_of(source: str) -> Iterator[tuple[ast.FunctionDef, bool]]:
    """All functions, and whether they are kernels or device functions. A kernel factory returns a kernel's function,
    which has no decorator of its own."""
    tree = ast.parse(source)
    kernels = {
        id(inner)
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef) and "kernel_factory" in map(ast.unparse, node.decorator_list)
        for inner in node.body
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            names = [ast.unparse(one) for one in node.decorator_list]
            yield node, id(node) in kernels or any(name.startswith(DEVICE_DECORATORS) for name in names)


def lines_of(function: ast.FunctionDef) -> int:
    """Of the function's own body, without signature, docstring, and functions within it."""
    inner = [
        node for node in ast.walk(function) if isinstance(node, ast.FunctionDef | ast.ClassDef) and node is not function
    ]
    covered = {
        line for node in inner for line in range(node.lineno - len(node.decorator_list), (node.end_lineno or 0) + 1)
    }
    body = function.body[1:] if ast.get_docstring(function) else function.body
    if not body:
        return 0
    return len(set(range(body[0].lineno, (function.end_lineno or 0) + 1)) - covered)


def parameters_of(function: ast.FunctionDef, for_device: bool) -> int:
    """Those that a call may give without their names; of a device function all."""
    arguments = function.args
    positional = len(arguments.posonlyargs) + len(arguments.args)
    return positional + (len(arguments.kwonlyargs) if for_device else 0)


def faults_of(source: str) -> list[str]:
    faults = []
    for function, for_device in functions_of(source):
        most = MAX_LINES_OF_LI if function.name in LI else MAX_DEVICE_LINES if for_device else MAX_LINES
        if parameters_of(function, for_device) > MAX_PARAMETERS:
            faults.append(f"{function.name} has {parameters_of(function, for_device)} parameters")
        if lines_of(function) > most:
            faults.append(f"{function.name} has {lines_of(function)} lines")
    return faults


def test_functions_are_short_and_take_few_parameters() -> None:
    faults = {str(path.relative_to(PACKAGE)): faults_of(path.read_text("utf-8")) for path in PACKAGE.rglob("*.py")}
    assert len(faults) > 100
    assert {path: found for path, found in faults.items() if found} == {}


def test_the_path_tracer_and_its_kernel_are_among_them() -> None:
    """What no rule finds, no rule holds."""
    sources = [path.read_text("utf-8") for path in (PACKAGE / "kernels").rglob("*.py")]
    found = [(function.name, lines_of(function)) for source in sources for function, on in functions_of(source) if on]
    assert all(dict(found)[name] <= MAX_LINES_OF_LI for name in LI)
    assert "trace" in dict(found) and "identify" in dict(found)


def test_what_is_too_long_or_takes_too_much_is_found() -> None:
    names = ", ".join(f"a{k}" for k in range(MAX_PARAMETERS + 1))
    factory = "@kernel_factory\ndef make():\n"
    assert faults_of(f"@wp.func\ndef f({names}):\n    pass") == ["f has 13 parameters"]
    assert faults_of(f"@device_kernel\ndef f(*, {names}):\n    pass") == ["f has 13 parameters"]
    assert faults_of(f"{factory}    def f(*, {names}):\n        pass") == ["f has 13 parameters"]
    assert faults_of(f"def f(*, {names}):\n    pass") == []
    lines = ["x = 1"] * (MAX_DEVICE_LINES + 1)
    assert faults_of("@wp.func\ndef f():\n    " + "\n    ".join(lines)) == ["f has 51 lines"]
    assert faults_of(f"{factory}    def f():\n        " + "\n        ".join(lines)) == ["f has 51 lines"]
    assert faults_of("def f():\n    " + "\n    ".join(lines)) == ["f has 51 lines"]
    assert faults_of("def f():\n    " + "\n    ".join(lines[:MAX_LINES])) == []
