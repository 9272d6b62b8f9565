"""EXR files come back as they were written, and appear whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from warpmis.errors import WarpmisError
from warpmis.output.exr import read_exr, write_exr

HEADER: dict[str, str | int | float] = {"stage": "scène.usda", "empty": "", "spp": 64, "target_error": 0.125}


def picture(height: int = 3, width: int = 5) -> np.ndarray:
    return np.arange(height * width, dtype=np.float32).reshape(height, width)


def test_round_trip_keeps_channels_and_header(tmp_path: Path) -> None:
    channels = {"R": picture(), "N.X": -picture(), "allocation.bsdf": picture() / 7, "Z": np.full((3, 5), np.inf, "f4")}
    write_exr(tmp_path / "a.exr", channels, HEADER)
    read, header = read_exr(tmp_path / "a.exr")
    assert set(read) == set(channels)
    for name, channel in channels.items():
        assert read[name].dtype == np.float32
        np.testing.assert_array_equal(read[name], channel)
    assert header == HEADER


def test_views_are_stored_as_they_look(tmp_path: Path) -> None:
    """OpenEXR itself ignores strides and would store the memory behind a view."""
    image = np.random.default_rng(0).random((4, 6, 3), dtype=np.float32)
    write_exr(tmp_path / "a.exr", {"G": image[..., 1], "flipped": image[:, ::-1, 0]}, {})
    read, _ = read_exr(tmp_path / "a.exr")
    np.testing.assert_array_equal(read["G"], image[..., 1])
    np.testing.assert_array_equal(read["flipped"], image[:, ::-1, 0])


def test_file_has_one_zip_part_and_prefixed_attributes(tmp_path: Path) -> None:
    write_exr(tmp_path / "a.exr", {"R": picture()}, {"spp": 64})
    file = OpenEXR.File(str(tmp_path / "a.exr"))
    assert len(file.parts) == 1
    assert file.header()["compression"] == OpenEXR.ZIP_COMPRESSION
    assert file.header()["warpmis:spp"] == 64


def test_large_seed_does_not_wrap_around(tmp_path: Path) -> None:
    write_exr(tmp_path / "a.exr", {"R": picture()}, {"seed": 2**32 - 1, "small": -(2**31)})
    assert read_exr(tmp_path / "a.exr")[1] == {"seed": str(2**32 - 1), "small": -(2**31)}


@pytest.mark.parametrize("channels", [{}, {"R": picture(), "G": picture(2, 2)}, {"R": np.zeros((2, 2, 3), "f4")}])
def test_channels_must_share_one_shape(tmp_path: Path, channels: dict[str, np.ndarray]) -> None:
    with pytest.raises(ValueError, match="share one shape"):
        write_exr(tmp_path / "a.exr", channels, {})


def test_failed_write_keeps_the_old_file_and_leaves_no_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_exr(tmp_path / "a.exr", {"R": picture()}, {"spp": 1})

    def half_write(self: OpenEXR.File, path: str) -> None:
        Path(path).write_bytes(b"half")
        raise RuntimeError("No space\nleft on device")

    monkeypatch.setattr(OpenEXR.File, "write", half_write)
    with pytest.raises(WarpmisError, match=r"a\.exr: cannot be written: No space left on device"):
        write_exr(tmp_path / "a.exr", {"R": picture()}, {"spp": 2})
    assert read_exr(tmp_path / "a.exr")[1] == {"spp": 1}
    assert os.listdir(tmp_path) == ["a.exr"]


def test_link_keeps_pointing_at_the_new_file(tmp_path: Path) -> None:
    (tmp_path / "link.exr").symlink_to(tmp_path / "real.exr")
    write_exr(tmp_path / "link.exr", {"R": picture()}, {})
    assert (tmp_path / "link.exr").is_symlink()
    assert (tmp_path / "real.exr").is_file()


def test_permissions_follow_the_umask(tmp_path: Path) -> None:
    write_exr(tmp_path / "a.exr", {"R": picture()}, {})
    (tmp_path / "plain").write_bytes(b"")
    assert (tmp_path / "a.exr").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_missing_folder_is_one_clear_line(tmp_path: Path) -> None:
    with pytest.raises(WarpmisError, match=r"the folder .*nowhere does not exist; create it first$"):
        write_exr(tmp_path / "nowhere" / "a.exr", {"R": picture()}, {})


def test_folder_as_target_is_one_clear_line(tmp_path: Path) -> None:
    with pytest.raises(WarpmisError, match="is a folder; name a file"):
        write_exr(tmp_path, {"R": picture()}, {})


def test_no_permission_is_one_clear_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "access", lambda path, mode: False)  # as root, every folder is writable
    with pytest.raises(WarpmisError, match="no permission to write into the folder"):
        write_exr(tmp_path / "a.exr", {"R": picture()}, {})


def test_reading_what_is_not_there_or_not_an_exr(tmp_path: Path) -> None:
    with pytest.raises(WarpmisError, match="no such file"):
        read_exr(tmp_path / "a.exr")
    (tmp_path / "a.exr").write_bytes(b"not an EXR")
    with pytest.raises(WarpmisError, match="cannot be read as OpenEXR"):
        read_exr(tmp_path / "a.exr")
