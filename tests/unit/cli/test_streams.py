"""Closed, full and broken streams, as a shell makes them: the picture is written, and nobody sees a traceback."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from warpmis.output.exr import read_exr

STAGE = """#usda 1.0
def Camera "Camera"
{
    double3 xformOp:translate = (0, 0, 4)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Sphere "Ball" {}
"""
SMALL = "--image-width 8 --spp 2 --method nee"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "stage.usda").write_text(STAGE)
    return tmp_path


def shell(folder: Path, line: str) -> subprocess.CompletedProcess[str]:
    """Run a line of a shell in which `warpmis` is the program."""
    script = f'warpmis() {{ "{sys.executable}" -m warpmis "$@"; }}\n{line}'
    return subprocess.run(["bash", "-c", script], cwd=folder, capture_output=True, text=True, check=False)


def rendered(folder: Path) -> bool:
    channels, _ = read_exr(folder / "a.exr")
    return bool(channels["R"].max() > 0.0)


@pytest.mark.parametrize("streams", ["2>&-", ">&-", "<&-", "<&- >&- 2>&-", "2>/dev/full"])
def test_a_picture_needs_no_streams(streams: str, folder: Path) -> None:
    done = shell(folder, f"warpmis render stage.usda a.exr {SMALL} {streams}")
    assert (done.returncode, done.stdout) == (0, "")
    assert "Traceback" not in done.stderr
    assert rendered(folder)


def test_errors_of_a_program_without_an_error_stream_are_its_status(folder: Path) -> None:
    done = shell(folder, "warpmis render nothing.usda a.exr 2>&-")
    assert (done.returncode, done.stdout, done.stderr) == (1, "", "")


@pytest.mark.parametrize(
    ("output", "status", "message"),
    [
        (">&-", 2, "--json prints on standard output, which is closed; open it or drop --json"),
        (">/dev/full", 1, "standard output cannot be written: No space left on device"),
    ],
)
def test_a_result_that_cannot_be_printed_is_one_line(output: str, status: int, message: str, folder: Path) -> None:
    done = shell(folder, f"warpmis inspect stage.usda --json {output}")
    assert (done.returncode, done.stdout) == (status, "")
    assert done.stderr == f"warpmis: error: {message}\n"


def test_a_reader_that_has_read_enough_is_no_error(folder: Path) -> None:
    done = shell(folder, "warpmis inspect stage.usda --json | true; exit ${PIPESTATUS[0]}")
    assert (done.returncode, done.stderr) == (0, "")


def test_a_terminal_that_goes_away_takes_no_picture_with_it(folder: Path) -> None:
    master, slave = os.openpty()
    command = [sys.executable, "-m", "warpmis", "render", "stage.usda", "a.exr", *SMALL.split(), "--json"]
    with subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=slave, text=True) as running:
        os.close(slave)
        os.close(master)
        assert running.stdout is not None
        report = json.loads(running.stdout.read())
    assert running.returncode == 0
    assert report["stats"]["samples"] == 8 * report["settings"]["spp"] * len(read_exr(folder / "a.exr")[0]["R"])
    assert rendered(folder)


def test_arguments_that_are_not_utf8_are_one_line(folder: Path) -> None:
    for arguments in (b"render stage.usda \xff.exr", b"render \xff.usda", b"inspect stage.usda --mask /\xff"):
        command = [sys.executable, "-m", "warpmis", *arguments.split()]
        done = subprocess.run(command, cwd=folder, capture_output=True, check=False)
        assert (done.returncode, done.stderr.count(b"\n")) == (2, 1)
        assert b"is not UTF-8" in done.stderr and b"\\udcff" in done.stderr
