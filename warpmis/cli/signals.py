"""Signals that end a process, so that they end a render as Ctrl-C does: with what it has on the disk."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

# SIGTERM: a queue takes the machine back; SIGHUP: the terminal is gone. Windows has no SIGHUP.
ENDING = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))


@contextmanager
def as_interrupts() -> Iterator[list[int]]:
    """Make the signals raise KeyboardInterrupt in the main thread; yields the list of those that came.

    One that the caller ignores, as nohup does SIGHUP, stays ignored.
    """
    caught: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield caught
        return

    def interrupt(number: int, _frame: Any) -> None:
        caught.append(number)
        raise KeyboardInterrupt

    before = {number: signal.getsignal(number) for number in ENDING}
    try:
        for number, handler in before.items():
            if handler != signal.SIG_IGN:
                signal.signal(number, interrupt)
        yield caught
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def status_of(caught: list[int]) -> int:
    """The exit status as a shell reports it."""
    return 128 + (caught[0] if caught else signal.SIGINT)


def name_of(caught: list[int]) -> str:
    """Such as " by SIGTERM"; nothing for Ctrl-C."""
    return f" by {signal.Signals(caught[0]).name}" if caught else ""
