"""The architecture's import rules, and the other rules about files that a reader of one file cannot see."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "warpmis"
MAX_LINES = 450

# Who may import whom. A layer is a module or a subpackage of warpmis; a dotted name allows that module alone.
# "" is warpmis/__init__.py, which knows every layer but loads none until it is asked to.
ALLOWED: dict[str, set[str]] = {
    "errors": set(),
    "methods": set(),
    "path_expression": {"errors"},
    "aovs": {"errors", "path_expression"},
    "whole_numbers": {"errors"},
    "config": {"aovs", "errors", "methods", "whole_numbers"},
    "scene": {"errors"},
    "usd": {"aovs", "path_expression", "scene", "errors", "whole_numbers"},
    "film": {"errors"},
    "device": {"scene", "film", "errors"},
    "kernels": {
        *("scene.features", "scene.material", "device.kernel_factory", "device.aov_views", "device.cache_views"),
        *("device.instance_views", "device.texel_views", "device.views"),
    },
    "cache": {"device.cache_views", "device.struct_arrays", "film.metrics", "kernels", "learn.newton_simplex"},
    "learn": {"config", "methods", "device.views", "device.kernel_factory", "scene.features", "kernels", "errors"},
    "output": {"film", "errors"},
    "inspection": {"scene", "device.environment"},
    "rendering": {
        "aovs", "cache", "config", "device", "errors", "film", "kernels", "learn", "output", "path_expression", "scene",
        "usd", "whole_numbers", "",
    },
    "compare": {
        "config", "methods", "errors", "film", "output", "rendering.progress", "rendering.stats", "whole_numbers", "",
    },
    "cli": {
        "aovs", "compare", "config", "device.kernel_cache", "device.start", "errors", "inspection", "methods", "output",
        "rendering", "scene", "usd", "",
    },
    "__main__": {"cli"},
    "": {"config", "errors", "output.notebook", "rendering", "scene", "usd"},
}  # fmt: skip

# Which layers may import what is heavy, optional or about the outside.
EXTERNAL: dict[str, set[str]] = {
    "pxr": {"usd"},
    "OpenEXR": {"output", "usd"},
    "OpenImageIO": {"output", "usd"},
    "rich": {"cli"},
    "flip_evaluator": {"compare"},
    "pyoidn": {"film"},
    "IPython": {"output"},
    "distributed": {"rendering"},
    "dask": {"rendering"},
    "MaterialX": {"usd"},
}

SOURCES = sorted(PACKAGE.rglob("*.py"))


def layer_of(path: Path) -> str:
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return "" if parts == ("__init__",) else parts[0]


def imports_of(nodes: Iterator[ast.AST]) -> Iterator[tuple[str, int]]:
    """The full names that import statements ask for, with their lines. `from a import b` asks for a.b."""
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"line {node.lineno}: relative import; write it in full"
            yield from ((f"{node.module}.{alias.name}", node.lineno) for alias in node.names)


def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"), filename=str(path))


def own_target(name: str) -> str | None:
    """The part after "warpmis." of an import of our own; "" for the package itself; None for another's."""
    if name.split(".")[0] != "warpmis":
        return None
    target = name.partition(".")[2]
    known = {layer_of(path) for path in SOURCES} | set(ALLOWED)
    return target if target.split(".")[0] in known else ""


def is_allowed(target: str, allowed: set[str]) -> bool:
    return any(target == rule or (rule != "" and target.startswith(rule + ".")) for rule in allowed)


def sources_by_name() -> list[object]:
    return [pytest.param(path, id=path.relative_to(ROOT).as_posix()) for path in SOURCES]


@pytest.mark.parametrize("path", sources_by_name())
def test_imports_only_what_its_layer_may(path: Path) -> None:
    layer = layer_of(path)
    assert layer in ALLOWED, f"{layer} is a new layer: say in ALLOWED what it may import"
    for name, line in imports_of(ast.walk(tree_of(path))):
        target = own_target(name)
        if target is None or (target.split(".")[0] == layer and layer):
            continue
        assert is_allowed(target, ALLOWED[layer]), f"{path}:{line}: {layer or 'warpmis'} may not import {name}"


@pytest.mark.parametrize("path", sources_by_name())
def test_imports_outside_packages_only_where_they_belong(path: Path) -> None:
    layer = layer_of(path)
    for name, line in imports_of(ast.walk(tree_of(path))):
        package = name.split(".")[0]
        assert layer in EXTERNAL.get(package, {layer}), f"{path}:{line}: {package} belongs in {EXTERNAL[package]}"
        assert (layer, package) != ("kernels", "numpy"), f"{path}:{line}: kernels are for the device: no numpy"


@pytest.mark.parametrize("path", sources_by_name())
def test_only_the_command_line_prints_and_exits(path: Path) -> None:
    if layer_of(path) in ("cli", "__main__"):
        return
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.Call):
            call = ast.unparse(node.func)
            assert call not in ("print", "exit", "sys.exit", "os._exit"), f"{path}:{node.lineno}: {call}"


@pytest.mark.parametrize("path", sources_by_name())
def test_files_are_short_enough_to_read(path: Path) -> None:
    lines = len(path.read_text(encoding="utf-8").splitlines())
    assert lines <= MAX_LINES, f"{path} has {lines} lines: split it by idea"


def test_rendering_loads_the_stage_reader_only_for_a_stage() -> None:
    """A Scene made elsewhere renders without pxr: the import stands inside a function."""
    path = PACKAGE / "rendering" / "render.py"
    names = [name for name, _ in imports_of(iter(tree_of(path).body))]
    assert not [name for name in names if name.startswith("warpmis.usd")]


def test_layers_have_no_cycle() -> None:
    # warpmis/__init__.py is left out: it names the others for its callers, and loads them lazily.
    graph = {
        layer: {rule.split(".")[0] for rule in allowed if rule} - {layer} for layer, allowed in ALLOWED.items() if layer
    }
    assert list(TopologicalSorter(graph).static_order())


def module_of(path: Path) -> str:
    return ".".join(path.relative_to(PACKAGE).with_suffix("").parts)


def test_modules_have_no_cycle() -> None:
    """Within a package, too, no arrow runs back up. A package's __init__ may name its own modules."""
    modules = {module_of(path): path for path in SOURCES if path.name != "__init__.py"}
    graph: dict[str, set[str]] = {}
    for module, path in modules.items():
        names = [name.partition(".")[2] for name, _ in imports_of(ast.walk(tree_of(path)))]
        graph[module] = {name if name in modules else name.rpartition(".")[0] for name in names} & set(modules)
    assert len(graph) > 100
    assert list(TopologicalSorter(graph).static_order())


# One name is one thing, on its way down the stairs: described, read from a stage, put on the device, evaluated there.
# A command is named after the function that it calls.
STAIRS = {"scene", "usd", "device", "kernels", "rendering", "cli"}


def test_files_of_one_name_are_one_thing() -> None:
    homes: dict[str, list[str]] = {}
    for path in SOURCES:
        if path.name not in ("__init__.py", "__main__.py"):
            homes.setdefault(path.stem, []).append(layer_of(path))
    twins = {name: layers for name, layers in homes.items() if len(layers) > 1}
    for name, layers in twins.items():
        assert set(layers) <= STAIRS and len(set(layers)) == len(layers), f"{name}.py in {', '.join(layers)}"


def test_nothing_imports_the_command_line() -> None:
    importers = {layer for layer, allowed in ALLOWED.items() if "cli" in allowed}
    assert importers == {"__main__"}


@pytest.mark.parametrize("statement", ["import warpmis", "import warpmis.rendering.result, warpmis.cli"])
def test_importing_loads_nothing_heavy(statement: str) -> None:
    heavy = ["pxr", "OpenEXR", "OpenImageIO", "warp", "rich"]
    code = f"{statement}; import sys; print([name for name in {heavy} if name in sys.modules])"
    output = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT).stdout
    assert output.strip() == "[]"


def test_public_names_exist() -> None:
    import warpmis

    for name in warpmis.__all__:
        assert getattr(warpmis, name) is not None
    assert set(warpmis.__all__) <= set(dir(warpmis))
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        _ = warpmis.nonsense
