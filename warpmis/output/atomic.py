"""Files that appear whole or not at all."""

from __future__ import annotations

import os
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from warpmis.errors import WarpmisError


def check_target(path: str | os.PathLike[str]) -> None:
    """Raise WarpmisError if a file cannot be written at `path`, so that a long render need not fail at its end."""
    target = Path(path)
    if not target.parent.is_dir():
        raise WarpmisError(f"{path}: the folder {target.parent} does not exist; create it first")
    if target.is_dir():
        raise WarpmisError(f"{path}: is a folder; name a file")
    if not os.access(target.parent, os.W_OK | os.X_OK):
        raise WarpmisError(f"{path}: no permission to write into the folder {target.parent}")


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[str]:
    """Yield a temporary name beside `path`; what was written there takes its place if the block succeeds.

    A crash leaves the old file as it was. OSError and RuntimeError, which the image libraries raise for a full disk
    and the like, become WarpmisError.
    """
    check_target(path)
    target = Path(path).resolve()  # a link keeps pointing at the file, which is replaced
    # Not tempfile.mkstemp: its files are readable by their owner alone, whatever the umask says.
    temporary = target.with_name(f".{target.name}.{uuid.uuid4().hex[:8]}.tmp")
    try:
        yield str(temporary)
        os.replace(temporary, target)
    except (OSError, RuntimeError) as error:
        raise WarpmisError(f"{path}: cannot be written: {' '.join(str(error).split())}") from error
    finally:
        temporary.unlink(missing_ok=True)
