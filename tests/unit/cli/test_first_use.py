"""The first render on a machine, as a program: how Ctrl-C ends its compiling, and where kernels go without a home."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.own_kernels

STAGE = """#usda 1.0
def Camera "Camera"
{
    double3 xformOp:translate = (0, 0, 4)
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
# The compiler's threads end with the process, not after seconds more of compiling [s].
PATIENCE = 2.0


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "warpmis", "render", "stage.usda", *arguments]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "stage.usda").write_text(STAGE)
    return tmp_path


def test_an_interrupt_while_kernels_compile_ends_the_program(folder: Path) -> None:
    environment = {**os.environ, "WARP_CACHE_PATH": str(folder / "cache"), "TMPDIR": str(folder)}
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it
    try:
        running = subprocess.Popen(
            command("--image-width", "16"), cwd=folder, env=environment, stderr=subprocess.PIPE, text=True
        )
    finally:
        signal.signal(signal.SIGINT, before)
    with running:
        assert running.stderr is not None
        assert running.stderr.readline() == "warpmis: compiling kernels, first use of these effects\n"
        time.sleep(0.5)
        pressed = time.perf_counter()
        running.send_signal(signal.SIGINT)
        said = running.stderr.read()
    assert time.perf_counter() - pressed < PATIENCE
    assert (running.returncode, said) == (130, "warpmis: error: interrupted\n")
    assert not list(folder.rglob("*_p*_t*")) and not list(folder.glob("wp_pch_*"))  # nothing half done is left
    assert not (folder / "stage.exr").exists()


def test_kernels_that_cannot_be_kept_are_compiled_into_a_temporary_folder(folder: Path) -> None:
    environment = {**os.environ, "TMPDIR": str(folder)}
    for name in ("WARP_CACHE_PATH", "XDG_CACHE_HOME"):
        environment.pop(name, None)
    small = "--image-width 16 --spp 4 --method nee --json".split()
    # A home that is no folder: as good as one that cannot be written, also for root.
    homeless = {**environment, "HOME": "/dev/null"}
    done = subprocess.run(command(*small), cwd=folder, env=homeless, capture_output=True, text=True, check=True)
    assert json.loads(done.stdout)["stats"]["kernels_compiled"] == 2
    assert "note: kernels are compiled into a temporary folder, anew each time, for /dev/null/" in done.stderr
    assert "cannot be written (Not a directory): set WARP_CACHE_PATH to a folder that can" in done.stderr
    assert (folder / "stage.exr").exists()
    assert not list(folder.glob("warpmis-kernels-*"))
    asked = [sys.executable, "-m", "warpmis", "compile", "stage.usda"]
    elsewhere = {**environment, "WARP_CACHE_PATH": "/dev/null/kernels"}
    done = subprocess.run(asked, cwd=folder, env=elsewhere, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith("warpmis: error: kernels are compiled into a temporary folder")
    assert "/dev/null/kernels" in done.stderr and done.stderr.count("\n") == 1
