"""Bad input at the command line: one clear line and status 1, or a warning and a picture with no NaN in it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from warpmis import cli
from warpmis.output.exr import read_exr

CAMERA = """
def Camera "Camera" {
    float focalLength = 10
    float horizontalAperture = 10
    float verticalAperture = 10
    double3 xformOp:translate = (0.5, 0.5, 2)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""


def square(points: str = "(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)", indices: str = "0, 1, 2, 3") -> str:
    return f"""
def Mesh "Square" {{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [{indices}]
    point3f[] points = [{points}]
}}
def Mesh "Good" {{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points = [(0, 0, -1), (1, 0, -1), (0.5, 1, -1)]
}}
"""


def render(stage: Path, *options: str) -> tuple[int, Path]:
    out = stage.with_suffix(".exr")
    return cli.main(["render", str(stage), str(out), "-w", "8", "--spp", "4", *options]), out


def write(folder: Path, text: str) -> Path:
    stage = folder / "stage.usda"
    stage.write_text(text)
    return stage


def error_line(capsys: pytest.CaptureFixture[str]) -> str:
    """What was printed: one line on standard error, nothing on standard output."""
    printed = capsys.readouterr()
    assert printed.out == ""
    (line,) = printed.err.strip().splitlines()
    assert line.startswith("warpmis: error: ")
    return line


def test_missing_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, out = render(tmp_path / "nowhere.usda")
    assert (status, out.exists()) == (1, False)
    assert "nowhere.usda" in error_line(capsys)


@pytest.mark.parametrize("text", ["", "this is no USD", "#usda 1.0\ndef Mesh {{{"])
def test_broken_file(text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, out = render(write(tmp_path, text))
    assert (status, out.exists()) == (1, False)
    assert "stage.usda" in error_line(capsys)


def test_no_such_camera(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, _ = render(write(tmp_path, "#usda 1.0\n" + square() + CAMERA), "--camera", "/World/Other")
    assert status == 1
    line = error_line(capsys)
    assert "/World/Other" in line
    assert "/Camera" in line  # the remedy: the cameras that there are


def test_empty_stage(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, _ = render(write(tmp_path, '#usda 1.0\ndef Xform "Nothing" {\n}\n'))
    assert status == 1
    assert "empty" in error_line(capsys)


@pytest.mark.parametrize(
    "mesh",
    [
        square(indices="0, 1, 2, 99"),
        square(indices="0, 1, 2, -1"),
        square(points="(0, 0, 0), (1, 0, 0), (nan, 1, 0), (0, 1, 0)"),
        square(points="(0, 0, 0), (1, 0, 0), (1, inf, 0), (0, 1, 0)"),
    ],
    ids=["index too large", "index negative", "NaN point", "infinite point"],
)
def test_broken_mesh_is_left_out_with_a_warning(mesh: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, out = render(write(tmp_path, "#usda 1.0\n" + mesh + CAMERA))
    assert status == 0
    warnings = [line for line in capsys.readouterr().err.splitlines() if "warning" in line]
    assert len(warnings) == 1
    assert "/Square" in warnings[0]
    channels, _ = read_exr(out)
    assert all(np.isfinite(picture).all() for picture in channels.values())
    # The good triangle behind is seen: the broken one does not hide it.
    assert channels["A"].max() == 1.0
    assert channels["N.Z"].max() == pytest.approx(1.0)
    assert channels["Z"].max() == pytest.approx(3.0, abs=1e-3)
