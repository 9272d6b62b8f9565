"""The command line: what it hands to the renderer, what it says, and how it ends."""

from __future__ import annotations

import io
import json
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest

import warpmis
from warpmis.cli import console, main
from warpmis.cli.console import progress_bar
from warpmis.config import RenderConfig
from warpmis.errors import StageError
from warpmis.rendering.progress import Progress
from warpmis.rendering.result import RenderResult


class FakeRender:
    """Stands in for warpmis.render: keeps what it was called with, and returns a small picture or raises."""

    def __init__(self) -> None:
        self.stage = ""
        self.options: dict[str, Any] = {}
        self.error: BaseException | None = None
        self.progress = Progress("learn", 50, 100, 50, 0.5, "round 3/8")
        self.rounds: tuple[np.ndarray, ...] = ()
        self.stats: dict[str, Any] = {"seconds": {"load": 0.1, "learn": 1.0, "render": 3.0}, "samples": 8_000_000}

    @property
    def config(self) -> RenderConfig:
        config = self.options["config"]
        assert isinstance(config, RenderConfig)
        return config

    def __call__(self, stage: str, **options: Any) -> RenderResult:
        self.stage, self.options = stage, options
        if self.error is not None:
            raise self.error
        if options["progress"] is not None:
            options["progress"](Progress("load", 0, 0, 0, 0.0))
            options["progress"](self.progress)
        count = len(self.config.strategies)
        zeros, rgb = np.zeros((4, 6), np.float32), np.zeros((4, 6, 3), np.float32)
        return RenderResult(
            image=rgb, alpha=zeros, albedo=rgb, normal=rgb, depth=zeros, samples=zeros, variance=zeros,
            allocation=np.full((4, 6, count), 1.0 / count, np.float32), strategies=self.config.strategies,
            round_allocations=self.rounds, stats=self.stats, name=stage, settings=self.config.to_dict(),
            warnings=("/A: Volume is not supported", "/B: odd\nshader", "/A: Volume is not supported"),
            notes=("no light: a dome of radiance 1",),
        )  # fmt: skip


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> FakeRender:
    render = FakeRender()
    monkeypatch.setitem(vars(warpmis), "render", render)  # setattr would import the renderer to remember it
    monkeypatch.chdir(tmp_path)
    return render


# ---- arguments ------------------------------------------------------------------------------------------------------


def test_defaults_are_left_to_the_stage(fake: FakeRender) -> None:
    assert main(["render", "scenes/box.usda"]) == 0
    assert fake.stage == "scenes/box.usda"
    assert set(fake.options) == {"config", "progress"}
    assert fake.config.to_dict() == RenderConfig().to_dict()
    assert Path("box.exr").is_file()


def test_every_option_reaches_the_renderer(fake: FakeRender) -> None:
    learning = "--learn-rounds 4 --learn-spp 2 --initial-allocation 0.25,0.75".split()
    stage = "--camera /Cam --image-width 320 --purposes render,proxy --render-settings-prim-path /Render/A".split()
    render = "--spp 32 --method murray20 --strategies light,bsdf --max-depth 3 --seed 7 --device cuda:0 --threads 2"
    render += " --strategy-choice random --mis-compensation --ids --target-error 2% --time-limit 90"
    render += " --aov direct,lights --cryptomatte"
    geometry = "--complexity low --variant /A{b=c} --variant /A{d=e} --mask /A,/B --session-layer s.usda".split()
    assert main(["render", "box.usda", "out.exr", *stage, *geometry, *render.split(), *learning]) == 0
    options = {name: fake.options[name] for name in ("camera", "purposes", "render_settings")}
    assert options == {"camera": "/Cam", "purposes": ("render", "proxy"), "render_settings": "/Render/A"}
    options = {name: fake.options[name] for name in ("complexity", "variants", "mask", "session_layer")}
    assert options == {
        "complexity": "low", "variants": ["/A{b=c}", "/A{d=e}"], "mask": ("/A", "/B"), "session_layer": "s.usda",
    }  # fmt: skip
    assert fake.config.to_dict() == {
        "width": 320, "spp": 32, "method": "murray20", "strategies": ["light", "bsdf"], "allocation": None,
        "strategy_choice": "random", "sampler": "lattice", "mis_compensation": 1,
        "max_depth": 3, "seed": 7, "ids": 1, "target_error": 0.02, "time_limit": 90.0, "device": "cuda:0", "threads": 2,
        "aov": ["direct", "lights"], "cryptomatte": 1,
        "learn": {"rounds": 4, "spp": 2, "initial_allocation": [0.25, 0.75]},
    }  # fmt: skip
    assert Path("out.exr").is_file()


def test_the_sampler_reaches_the_renderer(fake: FakeRender) -> None:
    assert main(["render", "box.usda", "--sampler", "independent"]) == 0
    assert fake.config.sampler == "independent"


@pytest.mark.parametrize(
    "options", ["-cam /Cam -w 320 -rs /Render/A", "--camera /Cam --imageWidth 320 --renderSettingsPrimPath /Render/A"]
)
def test_usdrecord_spellings(fake: FakeRender, options: str) -> None:
    assert main(["render", "box.usda", *options.split()]) == 0
    assert fake.options["camera"] == "/Cam"
    assert fake.options["render_settings"] == "/Render/A"
    assert fake.config.width == 320


def test_fixed_allocation(fake: FakeRender) -> None:
    assert main("render box.usda --method fixed --allocation 0.2,0.8".split()) == 0
    np.testing.assert_allclose(fake.config.allocation, [0.2, 0.8])


def test_universal_kernel_is_asked_for_by_name(fake: FakeRender) -> None:
    from warpmis.scene.features import Features

    assert main("render box.usda --features all".split()) == 0
    assert fake.options["features"] == Features.all()
    with pytest.raises(SystemExit, match="2"):
        main("render box.usda --features some".split())


def test_round_maps_are_pictures_numbered_from_one(fake: FakeRender) -> None:
    """Each in the colours of its own round: the first all red, where the BSDF has everything, the last all blue."""
    fake.rounds = tuple(np.full((4, 6, 2), (share, 1.0 - share), np.float32) for share in (1.0, 0.5, 0.0))
    Path("maps").mkdir()
    assert main(["render", "box.usda", "--round-maps", "maps"]) == 0
    assert fake.config.learn.keep_maps
    assert sorted(path.name for path in Path("maps").iterdir()) == [f"round_000{n}.png" for n in (1, 2, 3)]
    pictures = [oiio.ImageBuf(f"maps/round_000{n}.png").get_pixels(oiio.UINT8) for n in (1, 2, 3)]
    assert [picture.shape[:2] for picture in pictures] == [(4, 6)] * 3
    red_over_blue = [int(picture[0, 0, 0]) - int(picture[0, 0, 2]) for picture in pictures]
    assert red_over_blue[0] > 50 and abs(red_over_blue[1]) < 50 and red_over_blue[2] < -50


def test_maps_are_not_kept_unless_wanted(fake: FakeRender) -> None:
    assert main(["render", "box.usda"]) == 0
    assert not fake.config.learn.keep_maps


# ---- exit status and what is said -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--spp 0", "warpmis: error: samples per pixel (spp) must be from 1 to 16777216, got 0"),
        ("--method magic", "unknown method 'magic'"),
        ("--strategies bsdf,magic", "unknown strategy 'magic'"),
        ("--method fixed", "needs an allocation"),
        ("--strategy-choice magic", "unknown strategy choice 'magic'; choose one of stratified, random"),
        ("--sampler halton", "unknown sampler 'halton'; choose one of lattice, independent"),
        ("--method nee --learn-rounds 2", "method 'nee' takes no learn settings: drop them"),
        ("--method nee --round-maps .", "method 'nee' takes no learn settings"),
        ("--png a.jpg", "a.jpg: the file's name must end in .png"),
        ("--png a.png --balance-map ./a.png", "name the same file"),
    ],
)
def test_bad_settings_are_usage_errors(
    fake: FakeRender, capsys: pytest.CaptureFixture[str], options: str, message: str
) -> None:
    assert main(["render", "box.usda", *options.split()]) == 2
    captured = capsys.readouterr()
    assert message in captured.err
    assert captured.err.count("\n") == 1
    assert not fake.options, "nothing was rendered"


@pytest.mark.parametrize("option", ["--balance-map map.png", "--round-maps maps"])
def test_map_of_too_many_strategies_is_refused_before_the_render(
    fake: FakeRender, capsys: pytest.CaptureFixture[str], option: str
) -> None:
    options = f"--method pooled --strategies bsdf,light,uniform,cosine {option}"
    assert main(["render", "box.usda", "out.exr", *options.split()]) == 1
    assert "one more strategy" in capsys.readouterr().err
    assert fake.stage == ""


def test_picture_as_out_is_a_usage_error(fake: FakeRender, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["render", "box.usda", "out.png"]) == 2
    assert "must end in .exr; use --png for a picture" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("", "arguments are required: COMMAND; see warpmis --help"),
        ("render", "arguments are required: STAGE; see warpmis render --help"),
        (
            "render a.usda --spp many",
            "argument --spp: 'many' is not a whole number such as 64; see warpmis render --help",
        ),
        ("render a.usda --purposes magic", "there is no purpose 'magic'; choose from default, render, proxy, guide"),
        ("render a.usda --allocation half", "'half' is not a list of numbers such as 0.5,0.5"),
        ("render a.usda --sp 4", "unrecognized arguments: --sp 4"),
        ("render a.usda --target-error 5", "'5' is not an error such as 1% or 0.01"),
        ("render a.usda --target-error 5%%", "'5%%' is not an error such as 1% or 0.01"),
        ("render a.usda --time-limit 1m", "'1m' is not a time in seconds such as 60"),
        ("render a.usda --time nan", "'nan' is not a time code such as 12 or 3.5"),
        ("render a.usda --complexity ultra", "argument --complexity/-c: invalid choice: 'ultra'"),
        ("render a.usda --spp " + 5000 * "9", f"argument --spp: '{40 * '9'}...' is not a whole number"),
        ("compare a.usda -o b --sweep speed=1", "cannot sweep 'speed'; choose from learn-spp"),
        ("compare a.usda -o b --repeats few", "argument --repeats: 'few' is not a whole number"),
    ],
)
def test_unreadable_arguments_are_one_line(
    fake: FakeRender, capsys: pytest.CaptureFixture[str], arguments: str, message: str
) -> None:
    with pytest.raises(SystemExit) as exit_:
        main(arguments.split())
    assert exit_.value.code == 2
    said = capsys.readouterr().err
    assert said.startswith("warpmis: error: ") and message in said and said.count("\n") == 1
    assert not fake.options


@pytest.mark.parametrize("option", ["OUT", "--png", "--balance-map", "--round-maps"])
def test_missing_folder_is_found_before_rendering(
    fake: FakeRender, capsys: pytest.CaptureFixture[str], option: str
) -> None:
    target = ["nowhere/a.exr"] if option == "OUT" else [option, "nowhere/a.png"]
    if option == "--round-maps":
        target = [option, "nowhere"]
    assert main(["render", "box.usda", *target]) == 1
    assert "the folder nowhere does not exist; create it first" in capsys.readouterr().err
    assert not fake.options


def test_stage_error_names_the_prim(fake: FakeRender, capsys: pytest.CaptureFixture[str]) -> None:
    fake.error = StageError("no such\ncamera", "/World/Cam")
    assert main(["render", "box.usda"]) == 1
    assert capsys.readouterr().err == "warpmis: error: /World/Cam: no such camera\n"
    assert not Path("box.exr").exists()


@pytest.mark.parametrize("wanted", [False, True])
def test_unexpected_error_is_one_line_unless_the_traceback_is_wanted(
    fake: FakeRender, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, wanted: bool
) -> None:
    if wanted:
        monkeypatch.setenv("WARPMIS_TRACEBACK", "1")
    fake.error = KeyError("lost")
    assert main(["render", "box.usda"]) == 1
    said = capsys.readouterr().err
    assert "warpmis: error: internal error: KeyError: 'lost' (run with WARPMIS_TRACEBACK=1 for the traceback)" in said
    assert ("Traceback" in said) == wanted


def test_the_output_may_stand_behind_options(fake: FakeRender, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["render", "box.usda", "--spp", "16", "other.exr"]) == 0
    assert Path("other.exr").is_file()
    for wrong in (["other.exr", "--spp", "16", "third.exr"], ["--sp", "16"]):
        with pytest.raises(SystemExit):
            main(["render", "box.usda", *wrong])
        assert "unrecognized arguments" in capsys.readouterr().err


def test_interrupt(fake: FakeRender, capsys: pytest.CaptureFixture[str]) -> None:
    fake.error = KeyboardInterrupt()
    assert main(["render", "box.usda"]) == 130
    assert capsys.readouterr().err == "warpmis: error: interrupted\n"


def test_an_interrupt_waits_until_pxr_is_there(monkeypatch: pytest.MonkeyPatch) -> None:
    loaded = []

    def slow_import(name: str) -> None:
        signal.raise_signal(signal.SIGINT)
        loaded.append(name)

    monkeypatch.setattr(console, "import_module", slow_import)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it
    try:
        assert main(["render", "box.usda"]) == 130
        assert loaded == ["warpmis.usd"]
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)


def test_messages_and_summary(fake: FakeRender, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["render", "box.usda", "--spp", "16"]) == 0
    captured = capsys.readouterr()
    warning, odd, note, summary = captured.err.splitlines()
    assert warning == "warpmis: warning: /A: Volume is not supported"
    assert odd == "warpmis: warning: /B: odd shader"
    assert note == "warpmis: note: no light: a dome of radiance 1"
    assert summary.startswith("warpmis: box.exr: 6 x 4, 16 spp, ")
    assert summary.endswith(" s, 2.00 Msamples/s")
    assert captured.out == ""


@pytest.mark.parametrize("text", ["2%", "2 %", "0.02"])
def test_spellings_of_an_error(fake: FakeRender, text: str) -> None:
    assert main(["render", "box.usda", "--target-error", text]) == 0
    assert fake.config.target_error == 0.02


def test_summary_of_a_watched_render(fake: FakeRender, capsys: pytest.CaptureFixture[str]) -> None:
    told = {"relative_error": 0.0877526, "standard_error": 0.0037285, "bound": 0.0974157, "confidence": 0.95}
    fake.stats["stopping"] = {"spp": 1081, **told}
    assert main(["render", "box.usda", "--target-error", "10%"]) == 0
    summary = capsys.readouterr().err.splitlines()[-1]
    assert "6 x 4, 1081 spp" in summary
    assert summary.endswith(", error 8.78 ± 0.37 %, below 9.74 % with 95 % confidence")


def test_quiet_says_nothing(fake: FakeRender, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["render", "box.usda", "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")


def test_json(fake: FakeRender, capsys: pytest.CaptureFixture[str]) -> None:
    fake.stats |= {"rays": np.int64(5), "worst": np.float32(np.inf), "per_round": np.array([1.0, np.nan])}
    assert main(["render", "box.usda", "--json", "--png", "box.png", "--balance-map", "map.png"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert set(report) == {
        "output", "png", "balance_map", "version", "stage", "strategies", "settings", "stats", "warnings", "notes",
    }  # fmt: skip
    assert (report["output"], report["png"], report["balance_map"]) == ("box.exr", "box.png", "map.png")
    assert report["settings"] == RenderConfig().to_dict()
    assert report["settings"]["ids"] is False and report["settings"]["mis_compensation"] is False
    assert report["stats"]["rays"] == 5
    assert report["stats"]["worst"] is None
    assert report["stats"]["per_round"] == [1.0, None]
    assert report["warnings"] == ["/A: Volume is not supported", "/B: odd\nshader"]
    assert Path("box.png").is_file() and Path("map.png").is_file()


def test_progress_is_shown_on_a_terminal_alone(fake: FakeRender, monkeypatch: pytest.MonkeyPatch) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    assert main(["render", "box.usda"]) == 0
    assert "learn round 3/8" in terminal.getvalue()
    fake.progress = Progress("render", 60, 100, 60, 0.6, "", 0.0231, 0.0005, 9.0)
    assert main(["render", "box.usda"]) == 0
    assert "render error 2.310 ± 0.050 %" in terminal.getvalue()
    assert main(["render", "box.usda", "--quiet"]) == 0
    assert fake.options["progress"] is None


def test_a_line_tells_of_compilation_where_there_is_no_bar(capsys: pytest.CaptureFixture[str]) -> None:
    with progress_bar(quiet=False) as show:
        assert show is not None
        for detail in ("", "2 kernels, first use of these effects", "1 of 2 kernels, 3.1 s: trace"):
            show(Progress("compile", 0, 0, 0, 0.0, detail))
        show(Progress("learn", 50, 100, 50, 0.5, "round 3/8"))
    assert capsys.readouterr().err == "warpmis: compiling kernels, first use of these effects\n"


# ---- as a program ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("arguments", [["--version"], ["render", "--help"]])
def test_runs_as_a_module(arguments: list[str]) -> None:
    command = [sys.executable, "-m", "warpmis", *arguments]
    output = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert output == f"warpmis {warpmis.__version__}\n" if arguments == ["--version"] else "--spp" in output


def test_errors_of_a_program_have_no_traceback(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "warpmis", "render", "box.usda", str(tmp_path / "nowhere" / "a.exr")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr.startswith("warpmis: error: ") and done.stderr.count("\n") == 1


def test_warp_keeps_quiet() -> None:
    """Standard output is for --json alone, and a machine without a GPU is no reason to warn."""
    code = "from warpmis.cli import console; console.start_warp(); import os; os.write(2, b'still there')"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("", "still there")
