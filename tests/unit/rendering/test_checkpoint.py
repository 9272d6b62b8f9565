"""Checkpoints: the bits of an undisturbed render, however often it is interrupted; and what is refused."""

from __future__ import annotations

import errno
import itertools
import signal
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scenes

import warpmis
from warpmis.cache import gate, training
from warpmis.output import bundle
from warpmis.rendering import checkpoint, guided, run
from warpmis.rendering.fingerprint import scene_fingerprint
from warpmis.rendering.integrator import Integrator
from warpmis.rendering.kinds import integrator_of
from warpmis.rendering.stopping import Watch

SIZE = 16


class Impatient:
    """A progress function that interrupts after so many reports of samples."""

    def __init__(self, reports: int) -> None:
        self.left = reports
        self.done = 0

    def __call__(self, progress: warpmis.Progress) -> None:
        self.left -= progress.done > self.done
        self.done = progress.done
        if self.left <= 0 and progress.done:
            raise KeyboardInterrupt


@pytest.fixture(autouse=True)
def many_reports(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("warpmis.rendering.reporter.REPORT_SECONDS", 0.0)
    monkeypatch.setattr("warpmis.rendering.launches.CPU_LAUNCH", 1 << 10)
    monkeypatch.setattr(training, "FIRST_PATHS", 1024)
    # `auto` has two pilots, and trials.
    monkeypatch.setattr(guided, "FEWEST_SAMPLES", 0)
    monkeypatch.setattr(gate, "QUIET_PIXELS", 64)
    monkeypatch.setattr(gate, "QUIET", 0.0)
    monkeypatch.setattr(gate, "PILOT_SHARE", 1.0)


def resumed(render: Callable[..., warpmis.RenderResult], file: Path, seed: int = 0) -> tuple[warpmis.RenderResult, int]:
    """A render that is interrupted at random reports until it comes through, and how often it was."""
    rng = np.random.default_rng(seed)
    for interrupts in range(500):
        try:
            patience = Impatient(int(rng.integers(1, 12)))
            return render(checkpoint=file, resume=True, progress=patience, threads=1 + interrupts % 3), interrupts
        except warpmis.Interrupted as stop:
            result = stop.result
            assert (result.samples > 0).all() and result.settings["interrupted"].startswith(("after", "with"))
            assert file.exists()
        except KeyboardInterrupt:
            pass
    raise AssertionError("it comes to no end")


def assert_same(found: warpmis.RenderResult, expected: warpmis.RenderResult) -> None:
    """All pictures bit for bit, and all counts."""
    for name, picture in expected.channels().items():
        np.testing.assert_array_equal(found.channels()[name], picture, err_msg=name)
    for name in ("samples", "rays", "rejected_samples"):
        assert found.stats[name] == expected.stats[name], name
    assert {**found.settings, "threads": None} == {**expected.settings, "threads": None}
    assert found.stats.get("stopping") == expected.stats.get("stopping")


METHODS: dict[str, dict[str, Any]] = {
    "nee": {"method": "nee"},
    "auto": {"method": "auto"},
    "pooled": {"method": "pooled", "learn_rounds": 2, "learn_spp": 8},
    "counts": {"method": "counts"},
    "variance_aware": {"method": "variance_aware"},
    "optimal": {"method": "optimal"},
    "guided": {"method": "guided"},
    "cells": {"method": "cells", "strategies": ("bsdf", "light", "guide")},
    "guided to a target": {"method": "guided", "target_error": 0.05, "spp": 512},
    "guided with AOVs": {"method": "guided", "aov": ("diffuse", "emission"), "cryptomatte": True},
    "auto to a target": {"method": "auto", "target_error": 0.05, "spp": 512},
}


@pytest.mark.parametrize("settings", METHODS.values(), ids=list(METHODS))
def test_same_bits_however_often_it_is_interrupted(tmp_path: Path, settings: dict[str, Any]) -> None:
    settings = {"spp": 64, "max_depth": 3, **settings}

    def render(**more: Any) -> warpmis.RenderResult:
        return warpmis.render(scenes.room(SIZE), **settings, **more)

    file = tmp_path / "a.ckpt"
    found, interrupts = resumed(render, file)
    assert interrupts >= 2
    assert_same(found, render())
    assert list(tmp_path.iterdir()) == [], "what served is removed"


def kind_of(method: str) -> type[Integrator]:
    return integrator_of(warpmis.RenderConfig(method=method))


# What belongs together: the render, and the function that does it.
WHOLES: dict[str, tuple[str, type, str]] = {
    "a step of learning by the cache": ("guided", kind_of("guided"), "solve"),
    "a step of learning by pixels": ("pooled", kind_of("pooled"), "solve"),
    "a round that begins": ("guided", kind_of("guided"), "begin_round"),
    "a pilot of counts that ends": ("counts", kind_of("counts"), "end_pass"),
    "a part of the estimate of the error": ("guided to a target", Watch, "add"),
    "an estimate of the error": ("guided to a target", Watch, "_look"),
}


@pytest.mark.parametrize(("method", "owner", "name"), WHOLES.values(), ids=list(WHOLES))
def test_an_interrupt_in_what_belongs_together_comes_after_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, method: str, owner: type, name: str
) -> None:
    settings, file = {"spp": 64, "max_depth": 3, **METHODS[method]}, tmp_path / "a.ckpt"
    expected = warpmis.render(scenes.room(SIZE), **settings)
    whole, calls = getattr(owner, name), itertools.count()

    def interrupted(*arguments: Any) -> None:
        call = next(calls) % 3
        if call == 0:
            signal.raise_signal(signal.SIGINT)
        whole(*arguments)
        if call == 1:
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(owner, name, interrupted)
    interrupts = 0
    while True:
        try:
            found = warpmis.render(scenes.room(SIZE), checkpoint=file, resume=True, **settings)
            break
        except KeyboardInterrupt:
            interrupts += 1
            assert file.exists()
            assert interrupts < 200, "what is halved would be begun anew for ever"
    assert interrupts >= 2
    assert_same(found, expected)


SKY = """#usda 1.0
(
    startTimeCode = 5
)
def DomeLight "Sky" {
    float inputs:intensity.timeSamples = { 0: 0, 100: 100 }
}
def Camera "Camera" {
    double shutter:open = 0
    double shutter:close = 2
}
"""


def test_times_within_the_shutter(tmp_path: Path) -> None:
    stage, settings = (
        tmp_path / "sky.usda",
        {"width": 8, "spp": 90, "method": "nee", "shutter_samples": 3, "cryptomatte": True},
    )
    stage.write_text(SKY)
    file = tmp_path / "a.ckpt"
    found, interrupts = resumed(lambda **more: warpmis.render(stage, **settings, **more), file)
    assert interrupts >= 1
    assert_same(found, warpmis.render(stage, **settings))
    assert not file.exists()


def test_a_denoised_picture(tmp_path: Path) -> None:
    pytest.importorskip("pyoidn")
    settings: dict[str, Any] = {"method": "nee", "max_depth": 3, "spp": 32, "denoise": True}
    found, _ = resumed(lambda **more: warpmis.render(scenes.room(SIZE), **settings, **more), tmp_path / "a.ckpt")
    assert_same(found, warpmis.render(scenes.room(SIZE), **settings))


def interrupted_at(file: Path, reports: int = 5, **settings: Any) -> None:
    with pytest.raises(warpmis.Interrupted):
        warpmis.render(scenes.room(SIZE), checkpoint=file, progress=Impatient(reports), threads=1, **settings)


NEE: dict[str, Any] = {"method": "nee", "max_depth": 3, "spp": 64}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"seed": 1}, "seed was 0 when this was written, and is 1"),
        ({"spp": 32}, "spp was 64 when this was written, and is 32"),
        ({"max_depth": 2}, "max depth was 3"),
        ({"resume": False}, "there is a checkpoint"),
    ],
)
def test_another_render_is_refused(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    file = tmp_path / "a.ckpt"
    interrupted_at(file, **NEE)
    before = file.read_bytes()
    with pytest.raises(warpmis.ConfigError, match=message) as refusal:
        warpmis.render(scenes.room(SIZE), **{**NEE, "checkpoint": file, "resume": True, **change})
    assert "\n" not in str(refusal.value)
    assert file.read_bytes() == before


def test_another_stage_and_another_program_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "a.ckpt"
    interrupted_at(file, **NEE)
    with pytest.raises(warpmis.ConfigError, match="the stage was another one"):
        warpmis.render(scenes.open_room(SIZE), **NEE, checkpoint=file, resume=True)
    monkeypatch.setattr(checkpoint, "program_fingerprint", lambda: "another")
    with pytest.raises(warpmis.ConfigError, match="another version"):
        warpmis.render(scenes.room(SIZE), **NEE, checkpoint=file, resume=True)


def test_a_torn_file_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "a.ckpt"
    interrupted_at(file, **NEE)
    whole = bytearray(file.read_bytes())
    place = zipfile.ZipFile(file).getinfo("3.npy").header_offset + 200
    for torn in (bytes(whole[:-100]), bytes(whole[:place]) + b"?" + bytes(whole[place + 1 :]), b"", b"text"):
        file.write_bytes(torn)
        with pytest.raises(warpmis.WarpmisError, match="not a whole checkpoint"):
            warpmis.render(scenes.room(SIZE), **NEE, checkpoint=file, resume=True)


def test_more_samples_than_first_asked_for(tmp_path: Path) -> None:
    """The method does not learn, so that the first 64 samples are those of any longer render."""
    file = tmp_path / "a.ckpt"
    interrupted_at(file, **NEE)
    more = warpmis.render(scenes.room(SIZE), **{**NEE, "spp": 128}, checkpoint=file, resume=True)
    assert (more.samples == 128).all()
    whole = warpmis.render(scenes.room(SIZE), **{**NEE, "spp": 128})
    assert float(np.abs(more.image - whole.image).mean() / whole.image.mean()) < 0.1


def test_what_is_learned_for_a_budget_is_not_for_a_larger_one(tmp_path: Path) -> None:
    file = tmp_path / "a.ckpt"
    settings: dict[str, Any] = {"method": "auto", "max_depth": 3}
    interrupted_at(file, spp=64, **settings)
    with pytest.raises(warpmis.ConfigError, match="spp was 64"):
        warpmis.render(scenes.room(SIZE), spp=1024, checkpoint=file, resume=True, **settings)


def test_a_full_disk_costs_the_checkpoint_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """And one line; the file that was there stays."""
    file = tmp_path / "a.ckpt"
    interrupted_at(file, **NEE)
    before = file.read_bytes()

    def full(*_: Any, **__: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(bundle.np.lib.format, "write_array", full)
    said: list[str] = []
    kept = checkpoint.Checkpoint(file, interval=1e-6, resume=True, tell=said.append)
    result = warpmis.render(scenes.room(SIZE), **NEE, checkpoint=kept)
    assert_same(result, warpmis.render(scenes.room(SIZE), **NEE))
    assert len(said) == 1 and "No space left on device" in said[0]
    assert "No space left on device" in result.notes[-1]
    assert file.read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["a.ckpt"]


def test_it_is_written_at_intervals(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run, "PASS_SECONDS", 1e-6)
    writes: list[Path] = []
    write = checkpoint.write_bundle
    monkeypatch.setattr(checkpoint, "write_bundle", lambda path, value: writes.append(path) or write(path, value))
    for interval, least, most in ((1e-6, 5, 64), (1000.0, 0, 0)):
        writes.clear()
        warpmis.render(scenes.room(SIZE), **NEE, checkpoint=tmp_path / "a.ckpt", checkpoint_interval=interval)
        assert least <= len(writes) <= most


def test_impossible_arguments() -> None:
    with pytest.raises(warpmis.ConfigError, match="name the checkpoint"):
        warpmis.render(scenes.room(SIZE), resume=True)
    with pytest.raises(warpmis.ConfigError, match="interval"):
        warpmis.render(scenes.room(SIZE), checkpoint="a.ckpt", checkpoint_interval=-1.0)
    with pytest.raises(warpmis.WarpmisError, match="folder"):
        warpmis.render(scenes.room(SIZE), checkpoint="/nowhere/a.ckpt")


def test_fingerprints_tell_scenes_apart() -> None:
    assert scene_fingerprint(scenes.room(8)) == scene_fingerprint(scenes.room(8))
    others = [scenes.room(9), scenes.open_room(8), scenes.hidden_light(8)]
    assert len({scene_fingerprint(one) for one in (scenes.room(8), *others)}) == 4


def test_a_preview_has_the_whole_picture_and_ends_with_the_result() -> None:
    seen: list[Any] = []
    settings: dict[str, Any] = {"method": "nee", "max_depth": 3, "spp": 64}
    result = warpmis.render(scenes.room(SIZE), **settings, preview=seen.append, preview_interval=0.0)
    assert len(seen) > 4
    errors = [float(np.abs(image - result.image).mean()) for image in seen]
    assert errors[0] > 2.0 * errors[-2] and errors[-1] == 0.0
    assert all(image.shape == (SIZE, SIZE, 3) and (image.sum(axis=-1) > 0.0).mean() > 0.9 for image in seen)
