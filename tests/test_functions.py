"""Functions are small enough to read: few parameters, and few lines; kernels and device functions most of all."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

PACKAGE = Path(__file__).parent.parent / "warpmis"
MAX_PARAMETERS = 12
# A factory is as long as the functions in it: those are counted one by one.
MAX_LINES = 80
MAX_DEVICE_LINES = 60
MAX_LINES_OF_LI = 100


def functions_of(source: str) -> Iterator[ast.FunctionDef]:
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef):
            yield node


def is_for_device(function: ast.FunctionDef) -> bool:
    return any(ast.unparse(one).startswith(("wp.func", "wp.kernel")) for one in function.decorator_list)


def lines_of(function: ast.FunctionDef) -> int:
    """Of the function itself, functions within it left out."""
    inner = [
        node for node in ast.walk(function) if isinstance(node, ast.FunctionDef | ast.ClassDef) and node is not function
    ]
    covered = {
        line for node in inner for line in range(node.lineno - len(node.decorator_list), (node.end_lineno or 0) + 1)
    }
    return len(set(range(function.lineno, (function.end_lineno or 0) + 1)) - covered)


def parameters_of(function: ast.FunctionDef) -> int:
    """Those that a call may give without their names; of a device function all."""
    arguments = function.args
    return (
        len(arguments.posonlyargs) + len(arguments.args) + (len(arguments.kwonlyargs) if is_for_device(function) else 0)
    )


def faults_of(source: str) -> list[str]:
    faults = []
    for function in functions_of(source):
        most = MAX_LINES_OF_LI if function.name == "Li" else MAX_DEVICE_LINES if is_for_device(function) else MAX_LINES
        if parameters_of(function) > MAX_PARAMETERS:
            faults.append(f"{function.name} has {parameters_of(function)} parameters")
        if lines_of(function) > most:
            faults.append(f"{function.name} has {lines_of(function)} lines")
    return faults


def test_functions_are_short_and_take_few_parameters() -> None:
    faults = {str(path.relative_to(PACKAGE)): faults_of(path.read_text("utf-8")) for path in PACKAGE.rglob("*.py")}
    assert len(faults) > 100
    assert {path: found for path, found in faults.items() if found} == {}


def test_the_path_tracer_is_held_to_its_own_length() -> None:
    sources = [path.read_text("utf-8") for path in (PACKAGE / "kernels").rglob("*.py")]
    (li,) = [function for source in sources for function in functions_of(source) if function.name == "Li"]
    assert is_for_device(li)
    assert lines_of(li) <= MAX_LINES_OF_LI


def test_what_is_too_long_or_takes_too_much_is_found() -> None:
    names = ", ".join(f"a{k}" for k in range(MAX_PARAMETERS + 1))
    assert faults_of(f"@wp.func\ndef f({names}):\n    pass") == ["f has 13 parameters"]
    assert faults_of(f"@wp.kernel(enable_backward=False)\ndef f(*, {names}):\n    pass") == ["f has 13 parameters"]
    assert faults_of(f"def f(*, {names}):\n    pass") == []
    body = "\n".join(["    x = 1"] * MAX_DEVICE_LINES)
    assert faults_of(f"@wp.func\ndef f():\n{body}") == ["f has 61 lines"]
    assert faults_of(f"def factory():\n    @wp.func\n    def f():\n{body.replace('    x', '        x')}") == [
        "f has 61 lines"
    ]
    assert faults_of(f"def f():\n{body}") == []
