"""Sequences whose frames fail, are there already, or are interrupted; checkpoints and previews on the command line."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import warpmis
from warpmis.cli import main
from warpmis.errors import StageError
from warpmis.output.exr import read_exr
from warpmis.output.whole import is_whole

# The sky is as bright as the time code.
BRIGHTENING = """#usda 1.0
(
    startTimeCode = 5
)
def DomeLight "Sky" {
    float inputs:intensity.timeSamples = { 0: 0, 100: 100 }
}
def Camera "Camera" {
}
"""
SMALL = "--image-width 4 --spp 2 --method nee".split()
SEQUENCE = ["render", "sky.usda", "a.##.exr", "--frames", "1:3", *SMALL]


@pytest.fixture(autouse=True)
def stage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("sky.usda").write_text(BRIGHTENING)


def failing_at(monkeypatch: pytest.MonkeyPatch, time: float, error: BaseException) -> list[float]:
    """Let the render of one time fail; the times that were rendered."""
    original, rendered = warpmis.render, []

    def render(*arguments: Any, **options: Any) -> warpmis.RenderResult:
        rendered.append(options["time"])
        if options["time"] == time:
            raise error
        return original(*arguments, **options)

    monkeypatch.setitem(vars(warpmis), "render", render)
    return rendered


@pytest.mark.parametrize("error", [StageError("the texture is gone", "/Sky"), RuntimeError("broken")])
def test_a_frame_that_fails_is_named_and_passed_over(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], error: Exception
) -> None:
    failing_at(monkeypatch, 2.0, error)
    assert main([*SEQUENCE, "--json"]) == 1
    assert sorted(path.name for path in Path().glob("*.exr")) == ["a.01.exr", "a.03.exr"]
    out, said = capsys.readouterr()
    assert f"error: frame 2 (2/3): {'/Sky: ' if isinstance(error, StageError) else 'RuntimeError: '}" in said
    assert said.splitlines()[-1] == "warpmis: error: 1 of 3 pictures failed: a.02.exr"
    report = json.loads(out)
    assert [one["output"] for one in report["failed"]] == ["a.02.exr"]
    assert len(report["frames"]) == 2


def test_a_stage_that_is_not_there_fails_once_for_each_frame(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["render", "gone.usda", "a.##.exr", "--frames", "1:2", *SMALL]) == 1
    assert capsys.readouterr().err.count("gone.usda") == 2


def test_pictures_that_are_there_and_whole_are_left_alone(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A file that was cut, or that is of an interrupted render, is rendered again."""
    assert main([*SEQUENCE, "--quiet"]) == 0
    Path("a.01.exr").write_bytes(Path("a.01.exr").read_bytes()[:-40])
    before = Path("a.03.exr").stat().st_mtime_ns
    rendered = failing_at(monkeypatch, -1.0, RuntimeError())
    assert main([*SEQUENCE, "--skip-existing"]) == 0
    assert rendered == [1.0]
    assert "a.01.exr: is there but not whole, rendered again" in capsys.readouterr().err
    assert Path("a.03.exr").stat().st_mtime_ns == before
    assert is_whole("a.01.exr")


def test_a_png_beside_it_is_looked_at_too(monkeypatch: pytest.MonkeyPatch) -> None:
    command = [*SEQUENCE, "--png", "p.##.png", "--quiet"]
    assert main(command) == 0
    os.unlink("p.02.png")
    rendered = failing_at(monkeypatch, -1.0, RuntimeError())
    assert main([*command, "--skip-existing"]) == 0
    assert rendered == [2.0]
    assert is_whole("p.02.png")


def test_an_interrupted_picture_says_so_and_is_not_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    result = warpmis.render("sky.usda", width=4, spp=2, method="nee", time=2.0)
    result.settings["interrupted"] = "after 50 % of the samples"
    result.write("a.exr")
    assert read_exr("a.exr")[1]["interrupted"] == "after 50 % of the samples"
    assert not is_whole("a.exr")


def test_a_sequence_goes_on_where_it_was_interrupted(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with monkeypatch.context() as patch:
        failing_at(patch, 2.0, KeyboardInterrupt())
        assert main([*SEQUENCE, "--checkpoint", "a.ckpt"]) == 130
    assert Path("a.ckpt").exists()
    assert main([*SEQUENCE, "--checkpoint", "a.ckpt"]) == 2, "nobody asked to go on"
    rendered = failing_at(monkeypatch, -1.0, RuntimeError())
    assert main([*SEQUENCE, "--checkpoint", "a.ckpt", "--resume", "--spp", "3"]) == 2
    assert "spp was 2" in capsys.readouterr().err
    assert main([*SEQUENCE, "--checkpoint", "a.ckpt", "--resume"]) == 0
    assert rendered == [2.0, 3.0]
    assert not Path("a.ckpt").exists()


def test_a_failed_frame_alone_is_tried_again(monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patch:
        failing_at(patch, 2.0, StageError("the texture is gone"))
        assert main([*SEQUENCE, "--checkpoint", "a.ckpt"]) == 1
    rendered = failing_at(monkeypatch, -1.0, RuntimeError())
    assert main([*SEQUENCE, "--checkpoint", "a.ckpt", "--resume"]) == 0
    assert rendered == [2.0]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--resume"], "--resume is for --checkpoint"),
        (["--checkpoint-interval", "5"], "--checkpoint-interval is for --checkpoint"),
        (["--preview", "a.jpg"], "must end in .png"),
    ],
)
def test_impossible_options_are_one_line(options: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*SEQUENCE, *options]) == 2
    said = capsys.readouterr().err
    assert message in said and said.count("\n") == 1


def test_the_preview_ends_as_the_picture() -> None:
    assert main(["render", "sky.usda", "a.exr", "--png", "a.png", "--preview", "look.png", *SMALL]) == 0
    assert Path("look.png").read_bytes() == Path("a.png").read_bytes()


def test_a_preview_in_a_notebook_is_updated(monkeypatch: pytest.MonkeyPatch) -> None:
    display = pytest.importorskip("IPython.display")
    shown: list[Any] = []

    class Handle:
        def update(self, picture: Any) -> None:
            shown.append(picture)

    monkeypatch.setattr(display, "display", lambda picture, display_id: shown.append(picture) or Handle())
    show = warpmis.notebook_preview()
    for grey in (0.1, 0.5):
        show(np.full((2, 3, 3), grey, np.float32))
    assert len(shown) == 2 and all(one.data.startswith(b"\x89PNG") for one in shown)
