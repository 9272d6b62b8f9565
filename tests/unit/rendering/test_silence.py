"""Importing and calling the Python API prints nothing: standard output is its caller's."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
import scenes

pytestmark = pytest.mark.own_kernels

STAGE = scenes.USD_SCENES / "cornell_box" / "scene.usda"

CALLS = {
    "render": 'warpmis.render(STAGE, width=8, spp=2, method="nee").write("a.png")',
    "scene": 'warpmis.render(warpmis.load_stage(STAGE, width=8), spp=2, method="nee", ids=True).write("a.exr")',
    "notebook": 'warpmis.render(STAGE, width=8, spp=2, method="nee", progress=lambda _: None)._repr_html_()',
    "compile": (
        "from warpmis.rendering.specialise import compile_scene; "
        'compile_scene(warpmis.load_stage(STAGE, width=8), warpmis.RenderConfig(method="nee"))'
    ),
    "refusal": "\ntry: warpmis.render(STAGE, device='cuda:99')\nexcept warpmis.ConfigError: pass",
}


@pytest.mark.parametrize("call", CALLS)
def test_a_fresh_process_says_what_its_script_says(tmp_path: Path, call: str) -> None:
    """Warp would print a banner once it starts, and a line for every module that it loads."""
    code = f"import warpmis; STAGE = {str(STAGE)!r}; {CALLS[call]}\nprint('mine')"
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "mine\n"), done.stderr
    assert done.stderr == ""
