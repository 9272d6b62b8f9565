"""`warpmis compare`: what it hands on, says and writes; once with the real renderer."""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from compare.fakes import SCENE, FakeRender

import warpmis
from warpmis.cli import main
from warpmis.compare import write
from warpmis.compare.flip import Flip
from warpmis.compare.measure import Settings, run_experiment
from warpmis.compare.summary import summarize
from warpmis.compare.variants import Variant

CORNELL = Path(__file__).parents[2] / "usd_scenes" / "cornell_box" / "scene.usda"


@pytest.fixture
def loaded(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> dict[str, Any]:
    """What the stage was loaded with, in place of loading it."""
    options: dict[str, Any] = {}

    def load_stage(stage: str, **given: Any) -> Any:
        options.update(stage=stage, **given)
        return SCENE

    monkeypatch.setitem(vars(warpmis), "load_stage", load_stage)
    monkeypatch.setitem(vars(warpmis), "render", FakeRender())
    monkeypatch.chdir(tmp_path)
    return options


def test_table_and_folder(loaded: dict[str, Any], capsys: pytest.CaptureFixture[str]) -> None:
    assert main("compare box.usda -o new/folder --spp 16 --method nee --camera Cam".split()) == 0
    assert loaded == {"stage": "box.usda", "width": 256, "camera": "Cam"}
    captured = capsys.readouterr()
    heading, balance, nee = captured.out.splitlines()
    assert heading.split() == "method efficiency error to 10 % to 5 % to 2 % to 1 % to 0.5 %".split()
    assert balance.split()[:2] == ["balance", "1.00"] and nee.split()[0] == "nee"
    assert balance.count("~") == 5, "all predicted: 2 s reach 25 %"
    assert captured.err.splitlines()[-1] == f"warpmis: {Path('new/folder/report.html')}"
    assert Path("new/folder/report.html").is_file()


def test_json_is_all_of_standard_output(loaded: dict[str, Any], capsys: pytest.CaptureFixture[str]) -> None:
    sweeps = "--sweep max-depth=1,2 --sweep learn-spp=4,64"
    assert main(f"compare box.usda -o out --spp 16 --repeats 2 --max-depth 3 {sweeps} --json --quiet".split()) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    summary = json.loads(captured.out)
    assert summary == json.loads(Path("out/report.json").read_text())
    assert (summary["stage"], summary["spp"], summary["repeats"], summary["max_depth"]) == ("box.usda", 16, 2, 3)
    swept = [(method["knob"], method["value"]) for method in summary["methods"] if method["knob"]]
    assert swept == [("max-depth", 1), ("max-depth", 2), ("learn-spp", 4)]


def test_time_finds_the_samples(loaded: dict[str, Any], capsys: pytest.CaptureFixture[str]) -> None:
    """0.1 s a sample: 2 (85/64 + 1) + 16 samples for each of the longest run are 2.07 s."""
    assert main("compare box.usda -o out --time-limit 55 --repeats 2 --method balance --json --quiet".split()) == 0
    assert json.loads(capsys.readouterr().out)["spp"] == 24


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--method magic", "unknown method 'magic'"),
        ("--time-limit 5 --spp 4", "give one of the two"),
        ("--reference a.exr --reference-spp 64", "give one of the two"),
        ("--repeats 1", "repeats must be from 2"),
        ("--device tpu", "unknown device 'tpu'"),
    ],
)
def test_bad_settings(loaded: dict[str, Any], capsys: pytest.CaptureFixture[str], options: str, message: str) -> None:
    assert main(f"compare box.usda -o out {options}".split()) == 2
    said = capsys.readouterr().err
    assert message in said and said.count("\n") == 1


@pytest.mark.parametrize("sweep", ["max-depth=a", "magic=1", "max-depth=-1", "max-depth"])
def test_bad_sweeps(loaded: dict[str, Any], sweep: str) -> None:
    with pytest.raises(SystemExit) as exit_:
        main(["compare", "box.usda", "-o", "out", "--sweep", sweep])
    assert exit_.value.code == 2


def test_a_file_in_the_way(loaded: dict[str, Any], capsys: pytest.CaptureFixture[str]) -> None:
    Path("out").write_text("")
    assert main("compare box.usda -o out".split()) == 1
    assert "out: cannot be made a folder" in capsys.readouterr().err


def test_denoised_rows(loaded: dict[str, Any], capsys: pytest.CaptureFixture[str]) -> None:
    """Below each method, with less error and its own times; nothing is predicted."""
    pytest.importorskip("pyoidn")
    assert main("compare box.usda -o out --spp 64 --method nee --denoise".split()) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == ["method", "balance", "denoised", "nee", "denoised"]
    sampled, denoised = lines[1].split(), lines[2].split()
    assert float(denoised[1]) > 10.0 * float(sampled[1]), "efficiency"
    assert float(denoised[2]) < float(sampled[2]) / 3.0, "error"
    assert lines[2].count(">") == 3 and "~" not in lines[2] and lines[1].count("~") == 5


def test_denoising_without_its_package(
    loaded: dict[str, Any], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    assert main("compare box.usda -o out --denoise".split()) == 2
    assert capsys.readouterr().err == (
        "warpmis: error: denoising needs Open Image Denoise: pip install 'warpmis[denoise]'\n"
    )
    assert not loaded, "found out before the stage is loaded"


class Interrupting(FakeRender):
    """Ctrl-C at one of the renders."""

    at = 0

    def __call__(self, scene: Any, **options: Any) -> warpmis.RenderResult:
        if self.calls == self.at:
            raise KeyboardInterrupt
        return super().__call__(scene, **options)


@pytest.fixture
def quick_flip(monkeypatch: pytest.MonkeyPatch) -> None:
    """FLIP takes as long as all else of a comparison of small pictures: here it says the same of all."""
    monkeypatch.setattr(write, "flip", lambda image, reference: Flip(0.5, np.zeros(image.shape, np.uint8)))


@pytest.mark.usefixtures("quick_flip")
def test_interrupted_it_writes_what_it_has(
    loaded: dict[str, Any], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """From the baseline's and another method's first run of every budget on; the report says what is missing."""
    told = set()
    for at in range(40):
        render = Interrupting()
        render.at = at
        monkeypatch.setitem(vars(warpmis), "render", render)
        status = main(f"compare box.usda -o out{at} --spp 16 --repeats 2 --method nee".split())
        captured = capsys.readouterr()
        if status == 0:
            break
        assert status == 130 and captured.err.splitlines()[-1] == "warpmis: error: interrupted"
        report = Path(f"out{at}/report.json")
        if report.exists():
            summary = json.loads(report.read_text())
            told.add((len(summary["methods"]), summary["repeats"], sum("interrupt" in w for w in summary["warnings"])))
            assert Path(f"out{at}/report.html").is_file()
    assert told == {(1, 1, 3), (2, 1, 2), (2, 2, 2), (2, 1, 1)}, "methods, repetitions, lines about the interrupt"


@pytest.mark.usefixtures("quick_flip")
def test_interrupted_with_denoising_it_writes_what_it_has(
    loaded: dict[str, Any], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A method may be there without its denoised runs, which the report then says; never the other way round."""
    pytest.importorskip("pyoidn")
    told = set()
    for at in range(40):
        render = Interrupting()
        render.at = at
        monkeypatch.setitem(vars(warpmis), "render", render)
        if main(f"compare box.usda -o out{at} --spp 16 --repeats 2 --method nee --denoise".split()) == 0:
            break
        report = Path(f"out{at}/report.json")
        if report.exists():
            summary = json.loads(report.read_text())
            denoised = [method["denoised"] is not None for method in summary["methods"]]
            missing = sum("denoised was not measured before the interrupt" in line for line in summary["warnings"])
            assert missing == denoised.count(False)
            told.add((len(denoised), sum(denoised), summary["repeats"]))
            assert ("With and without denoising" in Path(f"out{at}/report.html").read_text()) == any(denoised)
    assert told == {(1, 0, 1), (1, 1, 1), (2, 1, 1), (2, 2, 1), (2, 2, 2)}, "methods, denoised ones, repetitions"
    capsys.readouterr()


def test_progress_on_a_terminal_alone(loaded: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    assert main("compare box.usda -o out --spp 4 --method balance".split()) == 0
    assert "balance equal time 3/3, 4 spp" in terminal.getvalue()


# ---- the real renderer ----------------------------------------------------------------------------------------------


def test_a_real_comparison(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """From USD to report.json: methods of one mean show no bias, and the reference can be used again."""
    command = f"compare {CORNELL} -w 16 --spp 64 --repeats 2 --method murray20 --json --quiet -o"
    assert main([*command.split(), str(tmp_path)]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["resolution"] == [16, 16]
    balance, murray = summary["methods"]
    assert murray["bias"]["relative_error"] == 0.0
    # Half of the samples; how much of the wall time that is, is the machine's affair.
    assert 0.0 < murray["learning"]["share_of_time"] < 1.0
    assert balance["runs"][0]["relative_error"]["median"] > balance["runs"][-1]["relative_error"]["median"]
    reference = str(tmp_path / "reference.exr")
    assert main([*command.split(), str(tmp_path / "again"), "--reference", reference]) == 0
    again = json.loads(capsys.readouterr().out)
    assert again["reference"]["relative_error"] == pytest.approx(summary["reference"]["relative_error"], rel=1e-3)


def test_a_method_against_itself() -> None:
    """Nine turns, so the range misses 1 with a chance of 0.4 %."""
    scene = warpmis.load_stage(CORNELL, width=16)
    variants = [Variant("balance", {"method": "balance"}), Variant("again", {"method": "balance"})]
    experiment = run_experiment(scene, variants, Settings(spp=64, repeats=9))
    efficiency = summarize(experiment, "cornell")["methods"][1]["efficiency"]
    assert efficiency["low"] <= 1.0 <= efficiency["high"]


def test_a_real_comparison_with_denoising(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Less error with the same samples, and all of the time that it takes."""
    pytest.importorskip("pyoidn")
    command = f"compare {CORNELL} -w 48 --spp 64 --repeats 2 --method balance --denoise --json --quiet -o"
    assert main([*command.split(), str(tmp_path)]) == 0
    (method,) = json.loads(capsys.readouterr().out)["methods"]
    noisy, denoised = method["runs"][-1], method["denoised"]["runs"][-1]
    assert denoised["relative_error"]["high"] < 0.5 * noisy["relative_error"]["low"]
    assert 0.0 < denoised["denoise_seconds"] < denoised["seconds"]["median"]
    assert (tmp_path / method["denoised"]["files"]["equal_time_png"]).is_file()
