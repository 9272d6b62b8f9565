"""The experiment with a renderer of known noise and speed: what it measures is what was put in."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scenes
from compare.fakes import HEIGHT, SCENE, TRUTH, WIDTH, FakeRender

import warpmis
from warpmis.compare import measure
from warpmis.compare.measure import Settings, run_experiment
from warpmis.compare.plan import affordable_spp, ladder
from warpmis.compare.reference import read_reference
from warpmis.compare.summary import summarize
from warpmis.compare.variants import Variant, chosen_variants, default_variants, swept, variant
from warpmis.compare.write import write_comparison
from warpmis.errors import ConfigError, WarpmisError
from warpmis.output.exr import write_exr


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> FakeRender:
    render = FakeRender()
    monkeypatch.setitem(vars(warpmis), "render", render)  # setattr would import the renderer to remember it
    return render


def compared(*variants: Variant, **settings: Any) -> dict[str, Any]:
    """The summary's methods by label, under "methods", and the rest of it."""
    summary = summarize(run_experiment(SCENE, variants, Settings(**{"spp": 64, **settings})), "fake.usda")
    json.dumps(summary, allow_nan=False)
    return {**summary, "methods": {method["label"]: method for method in summary["methods"]}}


BALANCE, NEE = Variant("balance", {"method": "balance"}), Variant("nee", {"method": "nee"})


def test_error_falls_as_it_was_made_to(fake: FakeRender) -> None:
    summary = compared(BALANCE)
    method = summary["methods"]["balance"]
    # A picture from 1 to 2: L^2 / (L^2 + (0.1 * 1.5)^2) is 0.988 on average, and the tail of 0.1 % is worth 0.7 %.
    for point in method["runs"]:
        assert point["relative_error"]["median"] == pytest.approx(0.985 / np.sqrt(point["spp"]), rel=0.04)
        assert point["seconds"]["median"] == pytest.approx(0.1 * point["spp"]), "compilation is left out"
    assert [point["spp"] for point in method["runs"]] == [4, 16, 64]
    assert method["slope"] == pytest.approx(-0.5, abs=0.02)
    assert method["compile_seconds"] == 7.0
    assert summary["reference"]["relative_error"] == pytest.approx(0.985 / np.sqrt(16 * 64), rel=0.04)


def test_times_to_an_error(fake: FakeRender) -> None:
    """Noise 1 and 0.1 s a sample: 2 % after (1 / 0.02)^2 samples, 250 s."""
    arrivals = {a["relative_error"]: a for a in compared(BALANCE)["methods"]["balance"]["time_to"]}
    assert arrivals[0.02]["kind"] == "predicted"
    assert arrivals[0.02]["seconds"]["median"] == pytest.approx(0.97 * 250.0, rel=0.06)
    assert arrivals[0.1]["seconds"]["low"] <= arrivals[0.1]["seconds"]["median"] <= arrivals[0.1]["seconds"]["high"]


def test_efficiency_is_that_of_noise_and_time(fake: FakeRender) -> None:
    fake.noise["nee"], fake.cost["nee"] = 0.5, 0.2
    method = compared(BALANCE, NEE)["methods"]["nee"]
    assert method["efficiency"]["median"] == pytest.approx(1.0 / (0.5**2 * 2.0), rel=0.06)
    assert method["equal_time"]["spp"] == 32
    assert method["equal_time"]["seconds"]["median"] == pytest.approx(6.4)
    assert method["learning"] == {"share_of_time": 0.0, "per_sample": pytest.approx(2.0)}


def test_learning_is_told(fake: FakeRender) -> None:
    fake.cost["murray20"] = 0.11
    method = compared(BALANCE, variant("murray20"))["methods"]["murray20"]
    assert method["learning"] == {"share_of_time": pytest.approx(0.5), "per_sample": pytest.approx(1.1)}
    assert method["time_to"][2]["learn_seconds"] == pytest.approx(
        0.5 * method["time_to"][2]["seconds"]["median"], rel=0.1
    )


def test_rejected_samples_are_counted_and_warned_of(fake: FakeRender) -> None:
    """Three repeats of three budgets and of the equal time, with 2 each."""
    assert compared(BALANCE)["methods"]["balance"]["rejected_samples"] == 0
    fake.rejected = 2
    summary = compared(BALANCE)
    assert summary["methods"]["balance"]["rejected_samples"] == 2 * 3 * (3 + 1)
    assert "balance: 24 samples were not finite and are in no picture" in summary["warnings"]


def test_a_method_against_itself(fake: FakeRender) -> None:
    """Nine turns: that all of them lie on one side of 1 has a chance of 0.4 %, and the seeds are fixed."""
    fake.jitter = 0.2
    again = Variant("again", {"method": "balance"})
    efficiency = compared(BALANCE, again, repeats=9)["methods"]["again"]["efficiency"]
    assert efficiency["low"] < 1.0 < efficiency["high"]
    assert efficiency["median"] == pytest.approx(1.0, abs=0.1)


def test_a_rendered_method_against_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nine turns of real renders, timed by their samples: the same method has an efficiency of 1 within its range."""
    monkeypatch.setattr(measure, "tracing_seconds", lambda stats: 1e-5 * stats["samples"])
    again = Variant("again", {"method": "balance"})
    experiment = run_experiment(scenes.room(pixels=16), [BALANCE, again], Settings(spp=32, repeats=9))
    efficiency = summarize(experiment, "room")["methods"][1]["efficiency"]
    assert efficiency["low"] < 1.0 < efficiency["high"]
    assert efficiency["median"] == pytest.approx(1.0, abs=0.25)


def test_bias_is_told_from_noise(fake: FakeRender) -> None:
    """A fifth of the noise of a pixel of the longest run (12.5 %), but the same everywhere."""
    fake.bias = {2: -0.025}
    methods = compared(BALANCE, *swept("max-depth", [2, 8]))["methods"]
    bias = methods["auto, max-depth 2"]["bias"]["relative_error"]
    assert bias == pytest.approx(0.025, rel=0.15)
    assert [a["kind"] for a in methods["auto, max-depth 2"]["time_to"]][-3:] == ["never"] * 3
    unbiased = methods["auto, max-depth 8"]
    assert unbiased["bias"]["relative_error"] == 0.0
    assert 0.0 < unbiased["bias"]["limit"] < 0.025
    assert unbiased["time_to"][-1]["kind"] == "predicted"


def test_the_reference_is_as_deep_as_the_deepest(fake: FakeRender) -> None:
    fake.bias = {8: -0.5}
    summary = compared(BALANCE, *swept("max-depth", [12]), common={"max_depth": 8})
    assert summary["methods"]["balance"]["bias"]["relative_error"] == pytest.approx(0.5, rel=0.05)
    assert "up to 12 bounces" in summary["reference"]["source"]


def test_every_run_has_a_seed_of_its_own(fake: FakeRender) -> None:
    methods = compared(BALANCE, NEE)["methods"].values()
    seeds = [seed for method in methods for point in [*method["runs"], method["equal_time"]] for seed in point["seeds"]]
    assert len(set(seeds)) == len(seeds) == 2 * 3 * 4


def test_what_needs_more_samples_is_left_out_and_named(fake: FakeRender) -> None:
    summary = compared(BALANCE, *swept("learn-spp", [16, 512]))
    assert set(summary["methods"]) == {"balance", "murray20, learn-spp 16"}
    assert any("learn-spp 512 needs more than 64 samples" in line for line in summary["warnings"])


def test_a_machine_that_slows_down_gets_shorter_runs(fake: FakeRender) -> None:
    """2 (85/64 + 1) + 16 samples at 0.1 s for each of the longest run; then 2 (85/64 + 1) at 1.6 s: 17.9."""
    settings = {"spp": None, "repeats": 2, "seconds": 2.07 * 64 + 1.0}
    assert compared(BALANCE, **settings)["spp"] == 64
    fake.slow_after = fake.calls + 2  # the two renders that calibrate
    slow = compared(BALANCE, **settings)
    assert slow["spp"] == 16
    assert "1024 samples" in slow["reference"]["source"]


# ---- denoising ------------------------------------------------------------------------------------------------------


def test_denoising_is_measured_with_its_time(fake: FakeRender) -> None:
    """Half a second of denoising is five samples per pixel; a fourth of the noise, 16 times less squared error."""
    pytest.importorskip("pyoidn")
    summary = compared(BALANCE, NEE, *swept("max-depth", [2]), denoise=True)
    for label in ("balance", "nee"):
        method = summary["methods"][label]
        denoised = method["denoised"]
        assert [point["spp"] for point in denoised["runs"]] == [4, 16, 64]
        for point in denoised["runs"]:
            assert point["seconds"]["median"] == pytest.approx(0.1 * point["spp"] + 0.5)
            assert point["denoise_seconds"] == 0.5
            error = point["relative_error"]["median"]
            assert error == pytest.approx(0.25 * 0.985 / np.sqrt(point["spp"]), rel=0.05)
        assert denoised["equal_time"]["spp"] == 59, "what 6.4 s have room for besides denoising"
        assert denoised["equal_time"]["seconds"]["median"] == pytest.approx(6.4)
        assert denoised["efficiency"]["median"] == pytest.approx(16.0 * 59 / 64, rel=0.1)
        assert method["runs"][0]["denoise_seconds"] == method["equal_time"]["denoise_seconds"] == 0.0
        assert method["efficiency"]["median"] == pytest.approx(1.0, rel=0.1), "the noisy picture's own is as it was"
    assert summary["methods"]["auto, max-depth 2"]["denoised"] is None
    assert compared(BALANCE)["methods"]["balance"]["denoised"] is None


def test_times_to_an_error_with_denoising(fake: FakeRender) -> None:
    """0.12 after 4 samples and 0.9 s, 0.031 after 64 and 6.9 s: no prediction goes beyond."""
    pytest.importorskip("pyoidn")
    arrivals = compared(BALANCE, denoise=True)["methods"]["balance"]["denoised"]["time_to"]
    assert [arrival["kind"] for arrival in arrivals] == ["measured", "measured", "later", "later", "later"]
    assert 0.9 < arrivals[0]["seconds"]["median"] < arrivals[1]["seconds"]["median"] < 6.9
    assert arrivals[2]["seconds"]["median"] == pytest.approx(6.9)


@pytest.mark.parametrize(("left", "is_resolved"), [(0.16, True), (0.05, False)])
def test_less_error_than_the_reference_has(fake: FakeRender, left: float, is_resolved: bool) -> None:
    """The reference's own is 1 / 16 of the squared error of the longest run. What is left of it by denoising is 0.4 of
    that, which can be told, or 0.04 of it, of which the report says that it is below a fourth."""
    pytest.importorskip("pyoidn")
    fake.denoised_noise = left
    summary = compared(BALANCE, denoise=True, repeats=9)
    point = summary["methods"]["balance"]["denoised"]["runs"][-1]
    expected = left / 8.0 if is_resolved else 0.5 / 4.0 / 8.0
    assert point["relative_error"]["median"] == pytest.approx(0.985 * expected, rel=0.08)
    assert point["below_reference"] is not is_resolved
    warning = "balance, denoised: runs with less error than can be told from the reference's own noise"
    assert any(line.startswith(warning) for line in summary["warnings"]) is not is_resolved


def test_denoising_needs_samples_for_two(fake: FakeRender) -> None:
    """A method that needs 4 samples needs 8 with denoising; one that has not got them is measured without."""
    pytest.importorskip("pyoidn")
    rounds = Variant("rounds", {"method": "murray20"}, {"spp": 16, "rounds": 1})
    assert (rounds.least_spp({}), rounds.denoised().least_spp({})) == (16, 32)
    summary = compared(BALANCE, rounds, spp=16, denoise=True)
    assert summary["methods"]["rounds"]["denoised"] is None
    assert "rounds, denoised needs more than 16 samples per pixel: raise --spp" in summary["warnings"]


def test_denoising_is_part_of_the_time(fake: FakeRender) -> None:
    """2 (85/64 + 1) samples without and as many with, and 16: 2.53 s at 0.1 s; ten denoised runs, 5 s."""
    pytest.importorskip("pyoidn")
    settings = {"spp": None, "repeats": 2, "denoise": True}
    assert compared(BALANCE, **settings, seconds=2.532 * 24 + 5.5)["spp"] == 24
    assert compared(BALANCE, **settings, seconds=2.532 * 24 + 4.5)["spp"] == 16


# ---- the reference --------------------------------------------------------------------------------------------------


def exr(path: Path, image: np.ndarray, **more: np.ndarray) -> str:
    write_exr(path, {**{name: image[..., axis] for axis, name in enumerate("RGB")}, **more}, {})
    return str(path)


def test_a_given_reference(fake: FakeRender, tmp_path: Path) -> None:
    summary = compared(BALANCE, reference=exr(tmp_path / "a.exr", TRUTH))
    assert summary["reference"] == {"source": str(tmp_path / "a.exr"), "relative_error": None, "seconds": 0.0}
    assert any("its own noise is not known" in line for line in summary["warnings"])
    assert summary["methods"]["balance"]["bias"]["limit"] is None


def test_noise_of_one_of_our_renders(tmp_path: Path) -> None:
    flat = np.ones((HEIGHT, WIDTH))
    path = exr(tmp_path / "a.exr", np.ones((HEIGHT, WIDTH, 3)), **{"variance.Y": 4.0 * flat, "samples.Y": 100.0 * flat})
    reference = read_reference(path, (WIDTH, HEIGHT))
    assert reference.relative_error() == pytest.approx(np.sqrt(0.04 / 1.01))


@pytest.mark.parametrize(
    ("image", "message"),
    [
        (np.ones((3, 4, 3)), "is 4 x 3, the stage's picture 48 x 32; set --image-width 4"),
        (np.zeros((HEIGHT, WIDTH, 3)), "is black"),
        (np.full((HEIGHT, WIDTH, 3), np.nan), "not finite"),
    ],
)
def test_useless_references(tmp_path: Path, image: np.ndarray, message: str) -> None:
    with pytest.raises(WarpmisError, match=message):
        read_reference(exr(tmp_path / "a.exr", image), (WIDTH, HEIGHT))


# ---- what is written ------------------------------------------------------------------------------------------------


def test_folder(fake: FakeRender, tmp_path: Path) -> None:
    experiment = run_experiment(SCENE, [BALANCE, NEE, variant("murray20")], Settings(spp=16))
    summary = write_comparison(experiment, "fake.usda", tmp_path)
    assert json.loads((tmp_path / "report.json").read_text()) == summary
    for method in summary["methods"]:
        assert all((tmp_path / name).is_file() for name in method["files"].values())
    assert set(summary["methods"][2]["files"]) == {
        "equal_time", "equal_samples", "equal_time_png", "equal_samples_png", "efficiency", "allocation",
    }  # fmt: skip
    again = read_reference(str(tmp_path / "reference.exr"), (WIDTH, HEIGHT))
    assert again.relative_error() == pytest.approx(summary["reference"]["relative_error"], rel=1e-3)


# ---- plan and variants ----------------------------------------------------------------------------------------------


def test_plan_by_hand() -> None:
    assert ladder(64) == [4, 16, 64] and ladder(128) == [2, 8, 32, 128] and ladder(1) == [1]
    # Two methods at 1 s, two repeats: 2 (2 * 85/64 + 2) + 16 = 25.3 s for one sample per pixel of the longest run.
    assert affordable_spp(25.4 * 24, [1.0, 1.0], 2, reference=True) == 24
    assert affordable_spp(25.2 * 24, [1.0, 1.0], 2, reference=True) == 16
    assert affordable_spp(9.4 * 48, [1.0, 1.0], 2, reference=False) == 48
    assert affordable_spp(1e-9, [1.0], 3, reference=True) == 4


def test_labels() -> None:
    assert variant("murray20 light,bsdf").render == {"method": "murray20", "strategies": ("light", "bsdf")}
    assert [one.label for one in chosen_variants(["nee", "balance"])] == ["balance", "nee"]
    assert [one.label for one in default_variants()][:2] == ["balance", "nee"]
    with pytest.raises(ConfigError, match="unknown method 'magic'"):
        chosen_variants(["magic"])
    with pytest.raises(ConfigError, match="must differ"):
        chosen_variants(["nee", "nee"])


def test_rounds_of_a_swept_length_fit_the_budget() -> None:
    """As many as the budget has room for, up to the method's own number for that budget."""
    (one,) = swept("learn-spp", [64])
    assert [one.config({}, spp, 0).learn_rounds() for spp in (64, 128, 1024)] == [1, 1, 4]
    assert one.least_spp({}) == 64
    with pytest.raises(ConfigError, match="cannot sweep 'spp'"):
        swept("spp", [1])
    with pytest.raises(ConfigError, match="max depth must be from 0"):
        swept("max-depth", [-1])


@pytest.mark.parametrize("settings", [{"repeats": 1}, {"seconds": 0.0}, {"spp": 0}, {"reference_spp": 1}])
def test_settings_are_checked(settings: dict[str, Any]) -> None:
    with pytest.raises(ConfigError):
        Settings(**settings)


def test_notes_of_every_method_are_told(fake: FakeRender, monkeypatch: pytest.MonkeyPatch) -> None:
    """Such as that samples were not finite: whichever method they were of."""

    def render(scene: Any, *, config: Any, **options: Any) -> warpmis.RenderResult:
        return replace(fake(scene, config=config, **options), notes=("of all", f"of {config.method}"))

    monkeypatch.setitem(vars(warpmis), "render", render)
    assert compared(BALANCE, NEE)["notes"] == ["of all", "of balance", "of nee"]
