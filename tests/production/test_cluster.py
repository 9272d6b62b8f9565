"""Pictures by several processes: the bits of one, whatever becomes of the processes."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scenes

import warpmis
from warpmis.cache import gate, training
from warpmis.cli import main
from warpmis.output.exr import read_exr
from warpmis.rendering import cluster, guided
from warpmis.rendering.cluster import Farm, farm_of

pytest.importorskip("distributed")

STAGE = scenes.USD_SCENES / "cornell_box" / "scene.usda"
SIZE = 16


@pytest.fixture(autouse=True)
def small_tasks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "TASK_SECONDS", 0.2)
    monkeypatch.setattr(cluster, "FIRST_PASS", 2)
    monkeypatch.setattr(training, "FIRST_PATHS", 1024)
    # `auto` has a pilot, and trials.
    monkeypatch.setattr(guided, "FEWEST_SAMPLES", 0)
    monkeypatch.setattr(gate, "PILOT_SHARE", 1.0)
    monkeypatch.setattr(gate, "QUIET", 0.0)


@pytest.fixture(scope="module")
def said() -> list[str]:
    return []


@pytest.fixture(scope="module")
def farm(said: list[str]) -> Iterator[Farm]:
    with farm_of("local:2", warpmis.RenderConfig(threads=2), tell=said.append) as found:
        assert found is not None
        yield found


def assert_same(found: warpmis.RenderResult, expected: warpmis.RenderResult) -> None:
    for name, picture in expected.channels().items():
        np.testing.assert_array_equal(found.channels()[name], picture, err_msg=name)
    for name in ("samples", "rays", "rejected_samples"):
        assert found.stats[name] == expected.stats[name], name


METHODS: dict[str, dict[str, Any]] = {
    "nee": {"method": "nee"},
    "auto": {"method": "auto"},
    "pooled": {"method": "pooled", "learn_rounds": 2, "learn_spp": 8},
    "counts": {"method": "counts"},
    "variance_aware": {"method": "variance_aware"},
    "optimal": {"method": "optimal"},
    "guided": {"method": "guided"},
    "cells": {"method": "cells", "strategies": ("bsdf", "light", "guide")},
    "guided with AOVs": {"method": "guided", "aov": ("diffuse", "emission"), "cryptomatte": True},
    "auto to a target": {"method": "auto", "target_error": 0.1, "spp": 128},
}


@pytest.mark.parametrize("settings", METHODS.values(), ids=list(METHODS))
def test_the_bits_of_one_machine(farm: Farm, settings: dict[str, Any]) -> None:
    settings = {"spp": 64, "max_depth": 3, **settings}
    found = warpmis.render(scenes.room(SIZE), cluster=farm, **settings)
    assert_same(found, warpmis.render(scenes.room(SIZE), **settings))


def pids(farm: Farm) -> list[int]:
    """Of the workers' processes; one that is being started anew is waited for."""
    until = time.monotonic() + 60.0
    farm.look_for_lost()
    while len(farm.known) < 2:
        assert time.monotonic() < until
        time.sleep(0.2)
        farm.look_for_lost()
    return list(farm.client.run(os.getpid).values())


def killing(farm: Farm, moments: list[float]) -> Any:
    """A progress function that kills one worker's process after the other as the samples pass shares of all."""
    left = dict(zip(moments, pids(farm), strict=False))

    def show(progress: warpmis.Progress) -> None:
        for moment in [one for one in left if progress.total and progress.done >= one * progress.total]:
            os.kill(left.pop(moment), signal.SIGKILL)

    return show


def test_a_worker_that_is_killed_costs_a_line(farm: Farm, said: list[str]) -> None:
    settings: dict[str, Any] = {"method": "auto", "max_depth": 3, "spp": 256}
    expected = warpmis.render(scenes.room(SIZE), **settings)
    said.clear()
    reports: list[warpmis.Progress] = []
    kill = killing(farm, [0.2])

    def show(progress: warpmis.Progress) -> None:
        reports.append(progress)
        kill(progress)

    found = warpmis.render(scenes.room(SIZE), cluster=farm, progress=show, **settings)
    assert_same(found, expected)
    farm.look_for_lost()
    assert said and all("a worker is lost" in line for line in said)
    done = [one.done for one in reports]
    assert done == sorted(done) and reports[-1].done == reports[-1].total


@pytest.mark.slow
@pytest.mark.parametrize("run", range(10))
def test_every_worker_killed_once_at_random(farm: Farm, run: int) -> None:
    settings: dict[str, Any] = {"method": "guided" if run % 2 else "auto", "max_depth": 3, "spp": 256}
    kill = killing(farm, np.random.default_rng(run).uniform(0.0, 0.9, size=2).tolist())
    found = warpmis.render(scenes.room(SIZE), cluster=farm, progress=kill, **settings)
    assert_same(found, warpmis.render(scenes.room(SIZE), **settings))


def test_a_checkpoint_and_a_cluster_go_together(farm: Farm, tmp_path: Path) -> None:
    """Begun here, gone on with there: the state is the same."""
    settings: dict[str, Any] = {"method": "auto", "max_depth": 3, "spp": 64, "checkpoint": tmp_path / "a.ckpt"}
    whole = warpmis.render(scenes.room(SIZE), **{**settings, "checkpoint": None})

    def impatient(progress: warpmis.Progress) -> None:
        if progress.total and progress.done >= 0.4 * progress.total:
            raise KeyboardInterrupt

    with pytest.raises(warpmis.Interrupted) as stop:
        warpmis.render(scenes.room(SIZE), progress=impatient, cluster=farm, **settings)
    assert (stop.value.result.samples > 0).all()
    assert_same(warpmis.render(scenes.room(SIZE), resume=True, **settings), whole)


def test_workers_read_the_stage_by_its_path_or_get_it(farm: Farm, monkeypatch: pytest.MonkeyPatch) -> None:
    settings: dict[str, Any] = {"width": 16, "spp": 4, "method": "nee", "max_depth": 2}
    expected = warpmis.render(STAGE, **settings)
    assert_same(warpmis.render(STAGE, cluster=farm, **settings), expected)
    monkeypatch.setattr(farm, "ships", True)
    assert_same(warpmis.render(STAGE, cluster=farm, **settings), expected)
    monkeypatch.setattr(farm, "ships", False)
    monkeypatch.setattr(cluster, "scene_fingerprint", lambda scene: "another")
    with pytest.raises(warpmis.StageError, match=r"finds another stage there: .* --ship-stage"):
        warpmis.render(STAGE, cluster=farm, **settings)


def test_another_version_is_refused(farm: Farm, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "program_fingerprint", lambda: "another")
    with pytest.raises(warpmis.WarpmisError, match="another version"):
        Farm(farm.client, ships=False, tell=lambda line: None)


def test_frames_are_tasks_and_leave_no_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    started: list[int] = []
    original = Farm._check_versions

    def check(self: Farm) -> None:
        original(self)
        started.extend(pids(self))

    monkeypatch.setattr(Farm, "_check_versions", check)
    command = ["render", str(STAGE), "--frames", "1:3", "--image-width", "16", "--spp", "4", "--method", "nee"]
    assert main([*command, "a.#.exr", "--quiet"]) == 0
    assert main([*command, "b.#.exr", "--quiet", "--cluster", "local:2"]) == 0
    for frame in (1, 2, 3):
        expected, found = read_exr(f"a.{frame}.exr")[0], read_exr(f"b.{frame}.exr")[0]
        np.testing.assert_array_equal(found["R"], expected["R"])
    assert len(started) == 2
    until = time.monotonic() + 10.0
    while any(is_alive(pid) for pid in started):
        assert time.monotonic() < until, "a worker outlives the command"
        time.sleep(0.1)


@pytest.mark.parametrize(
    "ending", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.slow), signal.SIGKILL]
)
def test_no_process_outlives_the_command(tmp_path: Path, ending: signal.Signals) -> None:
    """Ctrl-C reaches all processes of a terminal; of the others the workers learn by their parent's end."""
    out, preview = tmp_path / "a.exr", tmp_path / "look.png"
    line = [sys.executable, "-m", "warpmis", "render", str(STAGE), str(out), "--image-width", "32", "--method", "nee"]
    line += ["--spp", "1000000", "--cluster", "local:2", "--preview", str(preview)]
    environment = {**os.environ, "PYTHONPATH": str(Path(warpmis.__file__).parent.parent)}
    process = subprocess.Popen(line, stderr=subprocess.PIPE, text=True, env=environment, start_new_session=True)
    until = time.monotonic() + 120.0
    while not preview.exists():
        assert time.monotonic() < until and process.poll() is None
        time.sleep(0.1)
    children = children_of(process.pid)
    assert len(children) >= 2
    if ending == signal.SIGINT:
        os.killpg(process.pid, ending)
    else:
        process.send_signal(ending)
    _, said = process.communicate(timeout=60)
    until = time.monotonic() + 30.0
    while any(is_alive(pid) for pid in children):
        assert time.monotonic() < until, "a process outlives the command"
        time.sleep(0.1)
    assert "Traceback" not in said
    if ending != signal.SIGKILL:
        assert said.splitlines()[-1].startswith("warpmis: error: interrupted")
        assert read_exr(out)[0]["samples.Y"].min() > 0.0


def children_of(pid: int) -> list[int]:
    """All processes that a process has started, and those that these have."""
    listing = subprocess.run(["ps", "-eo", "pid=,ppid="], capture_output=True, text=True, check=True).stdout
    pairs = [tuple(map(int, line.split())) for line in listing.splitlines()]
    found = [pid]
    for parent in found:
        found += [child for child, its_parent in pairs if its_parent == parent]
    return found[1:]


def is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_no_cluster_is_one_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    monkeypatch.setattr(cluster, "CONNECT_SECONDS", 1)
    cases = [("local:x", "local:x"), ("local:0", "local:0"), (address, "there is no scheduler at")]
    for where, message in cases:
        assert main(["render", str(STAGE), "/tmp/a.exr", "--cluster", where]) == 2
        said = capsys.readouterr().err
        assert message in said and said.count("\n") == 1
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert main(["render", str(STAGE), "/tmp/a.exr", "--cluster", "local:2"]) == 2
    assert "pip install warpmis[distributed]" in capsys.readouterr().err
