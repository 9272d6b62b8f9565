"""Standard streams that are closed, full or gone: what cannot be said must not cost what was rendered."""

from __future__ import annotations

import errno
import os
import sys
from contextlib import suppress
from typing import Any

from warpmis.errors import WarpmisError

_closed: set[int] = set()


def open_closed_streams() -> None:
    """Put the null device where standard input, output or error is closed.

    Else the next file that is opened takes its number, and what native libraries have to say goes into a picture.
    """
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free
            setattr(sys, name, os.fdopen(number, mode, closefd=False))
            _closed.add(number)


def output_is_closed() -> bool:
    return 1 in _closed


def print_result(text: str) -> None:
    """Print on standard output.

    Raises:
        WarpmisError: it cannot be written.
    """
    try:
        print(text, flush=True)
    except OSError as error:
        drop_output()
        if error.errno == errno.EPIPE:  # such as `| head`, which has read enough
            return
        raise WarpmisError(f"standard output cannot be written: {error.strerror}") from error


def drop_output() -> None:
    """Write nothing more to standard output, not even what Python keeps for its end."""
    with suppress(OSError):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, 1)
        os.close(null)


class Forgiving:
    """A stream that drops what it cannot write, as a terminal that has gone."""

    def __init__(self, stream: Any) -> None:
        self.stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)

    def write(self, text: str) -> int:
        with suppress(OSError, ValueError):
            self.stream.write(text)
        return len(text)

    def flush(self) -> None:
        with suppress(OSError, ValueError):
            self.stream.flush()
