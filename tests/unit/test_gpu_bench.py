"""scripts/bench/gpu.py, as far as a machine without a GPU can tell: what it says of one, its z-tests, its packages."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import warp as wp
from programs import SCRIPTS, program


@pytest.fixture(scope="module")
def gpu() -> Any:
    return program("bench/gpu.py")


def noisy(seed: int, shift: float = 0.0) -> Any:
    """A picture of 32 x 32 pixels with a standard error of 0.1 each."""
    noise = 0.1 * np.random.default_rng(seed).standard_normal((32, 32))
    shape = np.full((32, 32), 16)
    image = np.repeat((1.0 + noise)[..., None], 3, axis=-1)
    image[:4, :4] += shift
    return SimpleNamespace(image=image.astype(np.float32), variance=np.full((32, 32), 0.16), samples=shape)


def test_scores_of_pictures_that_differ_in_their_noise_alone_are_normal(gpu: Any) -> None:
    scores = np.concatenate([gpu.block_scores(noisy(seed), noisy(seed + 500), 8) for seed in range(20)])
    assert len(scores) == 20 * 64
    assert abs(scores.mean()) < 4.0 / np.sqrt(len(scores))
    assert scores.std() == pytest.approx(1.0, abs=4.0 / np.sqrt(2.0 * len(scores)))
    worst = max(map(abs, gpu.block_scores(noisy(1), noisy(2), 8)))
    assert gpu.sidak(gpu.p_of(worst), 64) > gpu.LIMIT


def test_one_block_that_differs_is_found(gpu: Any) -> None:
    """By 0.2, of a standard error of 0.035: a z of 5.7 is beyond 4.3, the limit of 64 tests, nine times in ten."""
    found = []
    for seed in range(20):
        scores = gpu.block_scores(noisy(seed), noisy(seed + 500, shift=0.2), 8)
        worst = max(map(abs, scores))
        found.append(gpu.sidak(gpu.p_of(worst), len(scores)) < gpu.LIMIT and abs(scores[0]) == worst)
    assert np.mean(found) > 0.75


def test_pictures_without_noise_may_differ_by_rounding_alone(gpu: Any) -> None:
    exact, rounded, wrong = (
        SimpleNamespace(image=np.full((4, 4, 3), value, np.float32), variance=np.zeros((4, 4)), samples=np.ones((4, 4)))
        for value in (1.0, 1.00001, 1.001)
    )
    assert abs(gpu.block_scores(exact, rounded, 1)[0]) < 1.0
    assert abs(gpu.block_scores(exact, wrong, 1)[0]) > 5.0


def test_sidak(gpu: Any) -> None:
    assert gpu.sidak(0.01, 1) == pytest.approx(0.01)
    assert gpu.sidak(0.01, 64) == pytest.approx(1.0 - 0.99**64)
    assert gpu.p_of(1.959964) == pytest.approx(0.05, abs=1e-6)


def test_disagreement_and_samples_that_are_not_finite_are_named(gpu: Any) -> None:
    row = {"scene": "a", "method": "nee", "worst_z": 1.0, "p": 0.5, "equal": 1.0, "rejected": 0}
    report = {"agreement": [row, {**row, "method": "auto", "p": 1e-5}, {**row, "scene": "b", "rejected": 3}]}
    assert gpu.disagreements(report) == ["a auto", "b nee"]
    hard = {"cases": [{"rejected": 1}], "p": 0.5, "worst": "tiny", "worst_z": 1.0}
    assert gpu.disagreements({"agreement": [row], "hard": hard}) == ["hard stages"]
    speed = {"scene": "a", "method": "nee", "rate": 5e7, "least": 4e7, "most": 6e7,
             "launches": 4, "in_kernels": 0.98, "gap": 2e-5}  # fmt: skip
    kernels = [{"kernel": "a nee", "registers": 195, "frame": 304}]
    whole = {**report, "machine": {"device": "x"}, "hard": hard, "speed": [speed], "registers": kernels,
             "left_out": ["speed, b"], "failed": []}  # fmt: skip
    text = "\n".join(gpu.tables(whole))
    assert "| a | nee | 50.0 (40.0 to 60.0) | 98.0 % | 4 | 20.0 |" in text
    assert "| a nee | 195 | 304 |" in text and "No time for: speed, b." in text


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.skipif(wp.is_cuda_available(), reason="there is a GPU")
def test_without_a_gpu_it_ends_with_one_line() -> None:
    done = run(str(SCRIPTS / "bench" / "gpu.py"))
    assert done.returncode == 1
    assert done.stderr.startswith("gpu.py: this machine has no device 'cuda:0'") and done.stderr.count("\n") == 1


def test_missing_packages_are_named(tmp_path: Path) -> None:
    script = tmp_path / "scripts" / "bench" / "gpu.py"  # a checkout without wheels
    script.parent.mkdir(parents=True)
    script.write_text((SCRIPTS / "bench" / "gpu.py").read_text())
    done = run("-I", "-S", str(script))
    assert done.returncode == 1
    assert done.stderr.startswith("gpu.py: warp-lang, usd-core, OpenEXR") and done.stderr.count("\n") == 1
    assert "pip download -d wheels" in done.stderr


def test_missing_packages_come_from_wheels(gpu: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "wheels").mkdir()
    info = "toy_of_gpu-1.0.dist-info"
    with zipfile.ZipFile(tmp_path / "wheels" / "toy_of_gpu-1.0-py3-none-any.whl", "w") as wheel:
        wheel.writestr("toy_of_gpu.py", "VALUE = 5\n")
        wheel.writestr(f"{info}/METADATA", "Metadata-Version: 2.1\nName: toy-of-gpu\nVersion: 1.0\n")
        wheel.writestr(
            f"{info}/WHEEL", "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
        )
        wheel.writestr(f"{info}/RECORD", "")
    monkeypatch.setattr(gpu, "ROOT", tmp_path)
    monkeypatch.setattr(gpu, "PACKAGES", {"toy_of_gpu": "toy-of-gpu"})
    monkeypatch.setattr(sys, "path", list(sys.path))
    gpu.provide_packages()
    import toy_of_gpu  # type: ignore[import-not-found]

    assert toy_of_gpu.VALUE == 5
