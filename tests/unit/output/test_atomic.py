"""Files appear whole or not at all, also on a full disk, and a name that cannot be is found out before the render."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from warpmis.errors import WarpmisError
from warpmis.output import png
from warpmis.output.atomic import check_target, replacing
from warpmis.output.bundle import write_bundle
from warpmis.output.exr import write_exr
from warpmis.output.png import write_display_png

NOISE = np.random.default_rng(0).integers(0, 256, (200, 200, 3), dtype=np.uint8)


def write_all(path: Path) -> None:
    if path.suffix == ".png":
        write_display_png(path, NOISE)
    elif path.suffix == ".ckpt":
        write_bundle(path, {"numbers": [1, 2.0], "pictures": [NOISE, NOISE[:50]]})
    else:
        write_exr(path, {"R": NOISE[..., 0].astype(np.float32)}, {})


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 64 KiB, where one can be mounted."""
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", tmp_path], capture_output=True, check=False
    )
    if mounted.returncode != 0:
        pytest.skip("nothing can be mounted here")
    yield tmp_path
    subprocess.run(["umount", tmp_path], check=True)


LIMITED = """
import resource, sys
from pathlib import Path
sys.path.insert(0, {tests!r})
from test_atomic import write_all
from warpmis.errors import WarpmisError
write_all(Path({path!r}).with_stem("before"))
import signal
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
for length in (0, 100, 30_000):
    resource.setrlimit(resource.RLIMIT_FSIZE, (length, resource.RLIM_INFINITY))
    try:
        write_all(Path({path!r}))
    except WarpmisError as error:
        print(error)
"""


@pytest.mark.parametrize("name", ["a.png", "a.exr", "a.ckpt"])
def test_a_file_that_the_system_cuts_off_is_an_error_and_leaves_the_old_one(name: str, tmp_path: Path) -> None:
    """A limit of a file's length stands for a full disk, which not every machine lets a test have."""
    (tmp_path / name).write_text("old")
    code = LIMITED.format(tests=str(Path(__file__).parent), path=str(tmp_path / name))
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    lines = done.stdout.splitlines()
    assert len(lines) == 3 and all(line.startswith(f"{tmp_path / name}: cannot be written: ") for line in lines)
    assert (tmp_path / name).read_text() == "old"
    assert sorted(path.name for path in tmp_path.iterdir()) == [name, f"before{Path(name).suffix}"]


@pytest.mark.parametrize("name", ["a.png", "a.exr", "a.ckpt"])
def test_a_full_disk_is_an_error_and_leaves_nothing(name: str, small_disk: Path) -> None:
    with pytest.raises(WarpmisError, match=r"cannot be written: .*No space left on device"):
        write_all(small_disk / name)
    assert not list(small_disk.iterdir())


def test_a_png_without_its_end_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(png, "PNG_END", b"another end ")
    with pytest.raises(WarpmisError, match="No space left"):
        write_display_png(tmp_path / "a.png", NOISE)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["a.png", "a.exr"])
def test_names_as_long_as_the_folder_takes(name: str, tmp_path: Path) -> None:
    longest = os.pathconf(tmp_path, "PC_NAME_MAX")
    path = tmp_path / name.rjust(longest, "x")
    check_target(path)
    write_all(path)
    assert path.is_file()
    with pytest.raises(WarpmisError, match=f"the name is too long; this folder takes {longest} bytes"):
        check_target(tmp_path / name.rjust(longest + 1, "x"))
    with pytest.raises(WarpmisError, match="too long"):  # by bytes, not by characters
        check_target(tmp_path / f"{'ä' * (longest // 2)}{name}")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("\udcff.exr", r"\\xff.exr: the name is not UTF-8"),
        ("\udcff/a.exr", "is not UTF-8"),
        (f"{'folder' * 60}/a.exr", "File name too long"),
        ("nowhere/a.exr", "does not exist; create it first"),
    ],
)
def test_names_that_cannot_be(name: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(WarpmisError, match=message):
        check_target(f"{tmp_path}/{name}")


def test_a_pipe_is_not_replaced(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.exr")
    with pytest.raises(WarpmisError, match="is no regular file"), replacing(tmp_path / "a.exr"):
        pass
    with pytest.raises(WarpmisError, match="is no regular file"):
        check_target("/dev/full")
    assert (tmp_path / "a.exr").is_fifo()
