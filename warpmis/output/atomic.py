"""Files that appear whole or not at all."""

from __future__ import annotations

import os
import uuid
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from warpmis.errors import WarpmisError


def check_target(path: str | os.PathLike[str]) -> None:
    """Raise WarpmisError if a file cannot be written at `path`, so that a long render need not fail at its end."""
    target, shown = Path(path), _printable(path)
    try:
        str(target).encode()
    except UnicodeEncodeError:
        raise WarpmisError(f"{shown}: the name is not UTF-8, which image libraries ask for; choose another") from None
    try:
        _check_place(target, shown)
    except OSError as error:
        raise WarpmisError(f"{shown}: cannot be written: {error.strerror}") from error


def _check_place(target: Path, shown: str) -> None:
    if not target.parent.is_dir():
        raise WarpmisError(f"{shown}: the folder {target.parent} does not exist; create it first")
    longest = os.pathconf(target.parent, "PC_NAME_MAX") if hasattr(os, "pathconf") else 255
    if len(os.fsencode(target.name)) > longest:
        raise WarpmisError(f"{shown}: the name is too long; this folder takes {longest} bytes")
    if target.is_dir():
        raise WarpmisError(f"{shown}: is a folder; name a file")
    # A device or a pipe would be replaced by the picture.
    if target.exists() and not target.is_file():
        raise WarpmisError(f"{shown}: is no regular file; name another")
    if not os.access(target.parent, os.W_OK | os.X_OK):
        raise WarpmisError(f"{shown}: no permission to write into the folder {target.parent}")


def _printable(path: str | os.PathLike[str]) -> str:
    return os.fsencode(path).decode(errors="backslashreplace")


@contextmanager
def replacing(path: str | os.PathLike[str], *, one_writer: bool = False) -> Iterator[str]:
    """Yield a temporary name beside `path`; what was written there takes its place if the block succeeds.

    With one_writer the temporary name is always the same: what a process that was killed has left is written over.

    A crash leaves the old file as it was, or the whole new one. OSError and RuntimeError, which the image libraries
    raise for a full disk and the like, become WarpmisError.
    """
    check_target(path)
    target = Path(path).resolve()  # a link keeps pointing at the file, which is replaced
    # Not tempfile.mkstemp: its files are readable by their owner alone, whatever the umask says.
    # A name as long as a folder takes must leave room for this one: it is of one length.
    unique = f"{zlib.crc32(os.fsencode(target.name)):016x}" if one_writer else uuid.uuid4().hex[:16]
    temporary = target.with_name(f".warpmis-{unique}.tmp")
    try:
        yield str(temporary)
        _flush(temporary)
        os.replace(temporary, target)
    except (OSError, RuntimeError) as error:
        raise WarpmisError(f"{path}: cannot be written: {' '.join(str(error).split())}") from error
    finally:
        temporary.unlink(missing_ok=True)


def _flush(path: Path) -> None:
    """Until the file is on the disk: some file systems find out here alone that it is full."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
