"""Sequences: which frames, which names, each at its time; and what is left when a render is interrupted."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scenes

import warpmis
from warpmis.cli import main
from warpmis.cli.frame_ranges import frame_list, numbered
from warpmis.device import upload
from warpmis.errors import ConfigError
from warpmis.output.exr import read_exr

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


@pytest.mark.parametrize(
    ("text", "frames"),
    [
        ("7", [7]),
        ("-1.5", [-1.5]),
        ("1:4", [1, 2, 3, 4]),
        ("4:1", [4, 3, 2, 1]),
        ("1:10x2", [1, 3, 5, 7, 9]),
        ("10:1x-3", [10, 7, 4, 1]),
        ("1:2x0.25", [1, 1.25, 1.5, 1.75, 2]),
        ("0:1x0.1", [step * 0.1 for step in range(11)]),
        ("1:3, 20,5:5", [1, 2, 3, 20, 5]),
    ],
)
def test_frame_lists_are_usdrecords(text: str, frames: list[float]) -> None:
    assert frame_list(text) == pytest.approx(frames)


@pytest.mark.parametrize(
    "text", ["", "a", "1:", ":2", "1:2x", "1:2x0", "1:2x-1", "2:1x1", "1,,2", "nan", "1:1e9", "0:200000"]
)
def test_other_text_is_no_frame_list(text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError):
        frame_list(text)


def test_numbers_in_names() -> None:
    assert numbered("a/b.####.exr", [1, 24]) == ["a/b.0001.exr", "a/b.0024.exr"]
    assert numbered("b#.exr", [7, 12345]) == ["b7.exr", "b12345.exr"]
    assert numbered("b.###.##.exr", [1, 1.25]) == ["b.001.00.exr", "b.001.25.exr"]
    assert numbered("b.####.exr", [-3]) == ["b.-003.exr"]
    for path, frames, message in (
        ("b.exr", [1, 2], "####"),
        ("##/b.##.exr", [1, 2], "once"),
        ("b.##.exr", [1, 1.5], "1.5 needs decimals"),
        ("b.##.exr", [1, 2, 1], "twice"),
    ):
        with pytest.raises(ConfigError, match=message):
            numbered(path, frames)


def brightness(path: Path) -> float:
    return float(np.mean(read_exr(path)[0]["R"]))


@pytest.fixture
def stage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    Path("sky.usda").write_text(BRIGHTENING)
    return "sky.usda"


SMALL = "--image-width 4 --spp 2 --method nee".split()


def test_each_frame_is_rendered_at_its_time(stage: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["render", stage, "--frames", "1:5x2,20", "--png", "p##.png", "--json", *SMALL]) == 0
    assert [brightness(Path(f"sky.{frame:04}.exr")) for frame in (1, 3, 5, 20)] == pytest.approx([1, 3, 5, 20])
    assert sorted(path.name for path in Path().glob("*.png")) == ["p01.png", "p03.png", "p05.png", "p20.png"]
    captured = capsys.readouterr()
    frames = json.loads(captured.out)["frames"]
    assert [(frame["output"], frame["time"]) for frame in frames][:2] == [("sky.0001.exr", 1.0), ("sky.0003.exr", 3.0)]
    assert captured.err.count("sky.0020.exr: 4 x ") == 1


def test_one_time_code(stage: str) -> None:
    assert main(["render", stage, "a.exr", *SMALL]) == 0
    assert main(["render", stage, "b.exr", "--time", "2.5", *SMALL]) == 0
    assert [brightness(Path(name)) for name in ("a.exr", "b.exr")] == pytest.approx([5, 2.5])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["a.exr", "--frames", "1:2"], "a.exr: with --frames the name must contain the frame number once"),
        (["a.##.exr", "--frames", "1:2", "--png", "a.png"], "a.png: with --frames"),
        (["a.##.exr", "--frames", "1:2", "--time", "3"], "give one of the two"),
        (["a.##.exr", "--frames", "1:2", "--round-maps", "maps"], "maps: with --frames"),
    ],
)
def test_impossible_sequences_are_one_line(stage: str, capsys: pytest.CaptureFixture[str], options, message) -> None:
    assert main(["render", stage, *options]) == 2
    said = capsys.readouterr().err
    assert message in said and said.count("\n") == 1
    assert not list(Path().glob("*.exr"))


@pytest.mark.parametrize(("moving", "builds"), [("Camera", 1), ("Sphere", 3)])
def test_trees_are_built_again_only_where_triangles_have_changed(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, moving: str, builds: int
) -> None:
    """Three frames, and the same pictures as those of renders of their own."""
    monkeypatch.chdir(tmp_path)
    moves = """double3 xformOp:translate.timeSamples = { 1: (0, 0, 5), 3: (1, 0, 6) }
    uniform token[] xformOpOrder = ["xformOp:translate"]"""
    prims = [f'def {kind} "{kind}" {{\n{moves if kind == moving else ""}\n}}\n' for kind in ("Camera", "Sphere")]
    prims.append('def DomeLight "Sky" {\n}\n')
    Path("moving.usda").write_text("#usda 1.0\n" + "".join(prims))
    made = []
    build = upload.upload_solids
    monkeypatch.setattr(upload, "upload_solids", lambda *scene: made.append(scene) or build(*scene))
    assert main(["render", "moving.usda", "f#.exr", "--frames", "1:3", *SMALL]) == 0
    assert len(made) == builds
    for frame in (1, 2, 3):
        assert main(["render", "moving.usda", "one.exr", "--time", str(frame), *SMALL]) == 0
        found, expected = read_exr(f"f{frame}.exr")[0], read_exr("one.exr")[0]
        np.testing.assert_array_equal(found["Z"], expected["Z"])
        np.testing.assert_array_equal(found["R"], expected["R"])


# ---- interruption ---------------------------------------------------------------------------------------------------


class Impatient:
    """A progress function that interrupts once a share of the samples is taken."""

    def __init__(self, share: float) -> None:
        self.share = share

    def __call__(self, progress: warpmis.Progress) -> None:
        if progress.total and progress.done >= self.share * progress.total:
            raise KeyboardInterrupt


def test_an_interrupted_render_holds_what_was_rendered(monkeypatch: pytest.MonkeyPatch) -> None:
    """After the second of three learn rounds every pixel has its samples, and the picture is the two rounds' own."""
    monkeypatch.setattr("warpmis.rendering.reporter.REPORT_SECONDS", 0.0)
    settings: dict[str, Any] = {"method": "murray20", "learn_rounds": 3, "learn_spp": 8, "threads": 1}
    with pytest.raises(warpmis.Interrupted) as stop:
        warpmis.render(scenes.room(8), spp=32, progress=Impatient(0.5), **settings)
    result = stop.value.result
    assert (result.samples == 16).all()
    assert result.notes[-1] == "interrupted after 50 % of the samples"
    whole = warpmis.render(scenes.room(8), spp=16, **{**settings, "learn_rounds": 2})
    np.testing.assert_allclose(result.image, whole.image, rtol=1e-5)
    assert isinstance(stop.value, KeyboardInterrupt)


def test_an_interrupt_before_the_first_sample_holds_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(KeyboardInterrupt) as stop:
        warpmis.render(
            scenes.room(8), spp=4, method="nee", progress=lambda progress: (_ for _ in ()).throw(KeyboardInterrupt)
        )
    assert not isinstance(stop.value, warpmis.Interrupted)


def test_the_command_writes_it_and_ends_with_130(
    stage: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    original = warpmis.render

    def interrupted(*arguments: Any, **options: Any) -> warpmis.RenderResult:
        result = original(*arguments, **options)
        if options["time"] == 2.0:
            raise warpmis.Interrupted(result)
        return result

    monkeypatch.setitem(vars(warpmis), "render", interrupted)
    assert main(["render", stage, "--frames", "1:4", "--json", *SMALL]) == 130
    captured = capsys.readouterr()
    assert sorted(path.name for path in Path().glob("*.exr")) == ["sky.0001.exr", "sky.0002.exr"]
    assert [frame["output"] for frame in json.loads(captured.out)["frames"]] == ["sky.0001.exr", "sky.0002.exr"]
    assert captured.err.splitlines()[-2:] == [
        "warpmis: sky.0002.exr: written as far as it was rendered", "warpmis: error: interrupted"
    ]  # fmt: skip
