"""What editors and type checkers know of warpmis: a user's script under `mypy --strict`, and the wheel that says so."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent.parent

GOOD = """
import numpy as np
from numpy.typing import NDArray

import warpmis

def show(progress: warpmis.Progress) -> None:
    print(progress.phase, progress.done, progress.total)

def brightness(path: str) -> float:
    scene: warpmis.Scene = warpmis.load_stage(path, camera="/World/Cam", time=None, purposes=("render",))
    result: warpmis.RenderResult = warpmis.render(
        scene, width=640, spp=256, method="murray20", strategies=("bsdf", "light"), seed=0, device="cpu",
        learn_rounds=2, progress=show,
    )
    stats: warpmis.RenderStats = result.stats
    seconds: float = stats["seconds"]["learn"] + stats["seconds"]["render"]
    if "stopping" in stats:
        reason: str = stats["stopping"]["reason"]
        print(reason)
    image: NDArray[np.float32] = result.image
    result.write("out.exr")
    return float(image.mean()) * result.settings["spp"] / seconds

try:
    brightness("scene.usda")
    warpmis.render("scene.usda", config=warpmis.RenderConfig(spp=4, learn=warpmis.LearnConfig(rounds=1)))
except (warpmis.StageError, warpmis.ConfigError) as error:
    print(error)
"""

# Each line with a part of what mypy says of it.
BAD = {
    'warpmis.render(3)': 'Argument 1 to "render" has incompatible type "int"',
    'warpmis.render("a.usda", spp="many")': 'Argument "spp" to "render" has incompatible type "str"',
    'warpmis.render("a.usda", samples=3)': 'Unexpected keyword argument "samples"',
    'warpmis.load_stage("a.usda", camra="/A")': 'Unexpected keyword argument "camra"',
    'warpmis.rendr("a.usda")': 'Module has no attribute "rendr"',
    'warpmis.render("a.usda").stats["rayz"]': 'has no key "rayz"',
    'warpmis.render("a.usda").stats["seconds"]["loading"]': 'has no key "loading"',
    'warpmis.render("a.usda").settings["sppp"]': 'has no key "sppp"',
}  # fmt: skip


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the content of the wheel."""
    pytest.importorskip("hatchling", reason="builds the wheel; in the extra 'dev'")
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = folder.glob("warpmis-*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder / "site")
    return folder / "site"


def test_the_wheel_says_that_it_is_typed(installed: Path) -> None:
    assert (installed / "warpmis" / "py.typed").is_file()
    packed = {path.relative_to(installed).as_posix() for path in installed.glob("warpmis/**/*.py")}
    assert packed == {path.relative_to(ROOT).as_posix() for path in ROOT.glob("warpmis/**/*.py")}


def test_a_users_script_is_checked(installed: Path, tmp_path: Path) -> None:
    """mypy has nothing to say of the good script, and finds every mistake of the bad one."""
    pytest.importorskip("mypy", reason="in the extra 'dev'")
    (tmp_path / "good.py").write_text(GOOD)
    (tmp_path / "bad.py").write_text("import warpmis\n" + "\n".join(BAD) + "\n")
    command = [sys.executable, "-m", "mypy", "--strict", "--follow-imports=silent", "--no-error-summary"]
    command += ["--config-file", os.devnull, "--cache-dir", str(tmp_path / "cache"), "good.py", "bad.py"]
    environment = {**os.environ, "MYPYPATH": str(installed)}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    errors = [line for line in done.stdout.splitlines() if "error:" in line]
    assert not [line for line in errors if not line.startswith("bad.py:")], done.stdout
    for number, (line, message) in enumerate(BAD.items(), start=2):
        said = [error for error in errors if error.startswith(f"bad.py:{number}:")]
        assert said and message in said[0], f"{line}\n{done.stdout}"
    assert len(errors) == len(BAD)
