"""`warpmis compile` leaves nothing to compile, whatever of light, camera, size and learning is then changed."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from warpmis.cli import main

pytestmark = pytest.mark.own_kernels

STAGE = """#usda 1.0
def Camera "Here"
{
    double3 xformOp:translate = (0, 0, 4)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Camera "There"
{
    double3 xformOp:translate = (0, 1, 6)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Sphere "Ball" {}
def RectLight "Lamp"
{
    float inputs:intensity = 5
    double3 xformOp:translate = (0, 0, 3)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
BRIGHTER = """#usda 1.0
over "Lamp"
{
    float inputs:intensity = 9
    color3f inputs:color = (1, 0.5, 0.2)
    float inputs:width = 2
}
"""


def run(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "WARP_CACHE_PATH": str(folder / "cache")}
    command = [sys.executable, "-m", "warpmis", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True, cwd=folder, env=environment)


def modules(folder: Path) -> set[str]:
    return {path.name for path in (folder / "cache").glob("*/wp_*")}


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a stage, and a cache with the kernels of method murray20 for it."""
    folder = tmp_path_factory.mktemp("compile")
    (folder / "stage.usda").write_text(STAGE)
    (folder / "brighter.usda").write_text(BRIGHTER)
    done = run(folder, "compile", "stage.usda", "--camera", "Here", "--method", "murray20", "--json")
    report = json.loads(done.stdout)
    assert (report["compiled"], report["cached"]) == (4, 0)
    assert done.stderr.startswith("warpmis: stage.usda: 4 kernels compiled in ")
    assert len(done.stderr.splitlines()) == 1  # the compiler itself says nothing
    assert len(modules(folder)) == 4  # trace, solver, whole samples, and the tree
    return folder


@pytest.mark.parametrize(
    "changed",
    [
        "--camera Here",
        "--camera There --image-width 24 --spp 9 --seed 5 --threads 1",
        "--camera Here --session-layer brighter.usda",
        "--camera Here --learn-rounds 3 --learn-spp 2 --initial-allocation 0.3,0.7 --max-depth 5",
    ],
)
def test_nothing_is_left_to_compile(changed: str, compiled: Path) -> None:
    before = modules(compiled)
    small = "--image-width 16 --spp 8 --method murray20 --json"
    done = run(compiled, "render", "stage.usda", *small.split(), *changed.split())
    stats = json.loads(done.stdout)["stats"]
    assert (stats["kernels_compiled"], stats["kernels_cached"]) == (0, 4)
    assert modules(compiled) == before
    assert "compiling" not in done.stderr


def test_explanation_names_effects_their_prims_and_what_was_compiled(compiled: Path) -> None:
    arguments = "render stage.usda --camera Here --image-width 16 --spp 8 --method murray20 --explain"
    said = run(compiled, *arguments.split()).stderr.splitlines()
    assert "warpmis: effect rect_light: /Lamp" in said
    assert "warpmis: effect indirect: /Ball" in said
    (left_out,) = (line for line in said if line.startswith("warpmis: left out: "))
    assert "dome_picture" in left_out and "rect_light" not in left_out
    assert any(line.startswith("warpmis: kernels: 0 compiled, 4 from the cache, ready after ") for line in said)
    assert any("memory: geometry" in line and "picture" in line for line in said)


def test_ids_take_one_kernel_more(compiled: Path) -> None:
    asked = "stage.usda --camera Here --method murray20 --ids --json".split()
    report = json.loads(run(compiled, "compile", *asked).stdout)
    assert (report["compiled"], report["cached"]) == (1, 4)
    stats = json.loads(run(compiled, "render", *asked, "--image-width", "16", "--spp", "8").stdout)["stats"]
    assert (stats["kernels_compiled"], stats["kernels_cached"]) == (0, 5)


def test_the_method_fixed_needs_no_shares_to_be_compiled(compiled: Path) -> None:
    kernels = {
        method: json.loads(
            run(compiled, "compile", *f"stage.usda --camera Here --json --method {method}".split()).stdout
        )
        for method in ("balance", "fixed")
    }
    assert kernels["balance"]["compiled"] <= 1
    assert (kernels["fixed"]["compiled"], kernels["fixed"]["cached"]) == (0, 2)


def test_a_device_that_is_not_there_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "stage.usda").write_text(STAGE)
    assert main(["compile", str(tmp_path / "stage.usda"), "--camera", "Here", "--device", "cuda:7"]) == 2
    assert "this machine has no device 'cuda:7'" in capsys.readouterr().err
