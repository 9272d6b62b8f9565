"""The command line killed with no chance to say goodbye, or told to end, or on a full disk."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import scenes

from warpmis.output.exr import read_exr

ROOT = Path(__file__).parent.parent.parent
STAGE = scenes.USD_SCENES / "cornell_box" / "scene.usda"
# A second or so of tracing on one thread, with rounds of learning and a spatial cache.
SETTINGS = "--image-width 48 --max-depth 3 --quiet"
METHODS = {"auto": "--method auto --spp 512", "guided": "--method guided --spp 256"}


def command(*options: str) -> subprocess.Popen[str]:
    line = [sys.executable, "-m", "warpmis", "render", str(STAGE), *options]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)


def finished(*options: str) -> None:
    process = command(*options)
    _, said = process.communicate()
    assert process.returncode == 0, said


def killed_until_whole(folder: Path, method: str, kills: int, seed: int) -> int:
    """Kill -9 at random moments of the time that a whole render takes, and go on; how many found a checkpoint."""
    settings = [*SETTINGS.split(), *METHODS[method].split()]
    finished(str(folder / "warm.exr"), *settings)  # compiles
    start = time.monotonic()
    finished(str(folder / "whole.exr"), *settings)
    seconds = time.monotonic() - start
    checkpoint = folder / "a.ckpt"
    again = [str(folder / "found.exr"), *settings, "--checkpoint", str(checkpoint), "--resume"]
    again += ["--checkpoint-interval", "0.05"]
    rng = np.random.default_rng(seed)
    found = 0
    for _ in range(kills):
        found += checkpoint.exists()
        process = command(*again)
        time.sleep(float(rng.uniform(0.3, 1.0)) * seconds)
        process.kill()
        process.communicate()
    finished(*again)
    expected, resumed = read_exr(folder / "whole.exr")[0], read_exr(folder / "found.exr")[0]
    for name, picture in expected.items():
        np.testing.assert_array_equal(resumed[name], picture, err_msg=name)
    assert not checkpoint.exists()
    assert not list(folder.glob(".warpmis-*")), "no temporary file is left"
    return found


@pytest.mark.parametrize("method", ["guided"])
def test_killed_three_times(tmp_path: Path, method: str) -> None:
    killed_until_whole(tmp_path, method, kills=3, seed=1)


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_killed_twenty_times(tmp_path: Path, method: str) -> None:
    assert killed_until_whole(tmp_path, method, kills=20, seed=2) > 3


@pytest.mark.parametrize(("ending", "status"), [(signal.SIGTERM, 143), (signal.SIGHUP, 129), (signal.SIGINT, 130)])
def test_told_to_end_it_writes_a_whole_picture_and_a_checkpoint(
    tmp_path: Path, ending: signal.Signals, status: int
) -> None:
    out, checkpoint = tmp_path / "a.exr", tmp_path / "a.ckpt"
    preview = tmp_path / "look.png"
    options = [str(out), "--image-width", "48", "--max-depth", "3", "--spp", "1000000"]
    process = command(*options, "--checkpoint", str(checkpoint), "--preview", str(preview))
    wait_for(preview)
    process.send_signal(ending)
    _, said = process.communicate(timeout=60)
    assert process.returncode == status, said
    assert "Traceback" not in said and said.count("error: interrupted") == 1
    channels, header = read_exr(out)
    assert channels["samples.Y"].min() > 0.0
    assert header["interrupted"].startswith("after ")
    assert checkpoint.exists()


@pytest.fixture
def tiny_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of half a megabyte."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=512k", "tmpfs", str(folder)], capture_output=True, check=False
    )
    if mounted.returncode:
        pytest.skip("a file system can be mounted by its administrator alone")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


def test_a_disk_that_fills_costs_the_checkpoint_alone(tiny_disk: Path, tmp_path: Path) -> None:
    out = tmp_path / "a.exr"
    options = [str(out), "--image-width", "96", "--max-depth", "3", "--method", "nee", "--spp", "64"]
    process = command(*options, "--checkpoint", str(tiny_disk / "a.ckpt"), "--checkpoint-interval", "0.01")
    _, said = process.communicate()
    assert process.returncode == 0, said
    assert said.count("warning: ") == 1 and "No space left on device; the render goes on" in said
    assert list(tiny_disk.iterdir()) == []
    assert (read_exr(out)[0]["samples.Y"] == 64.0).all()


def wait_for(path: Path) -> None:
    until = time.monotonic() + 120.0
    while not path.exists():
        assert time.monotonic() < until, f"{path} does not come"
        time.sleep(0.05)
