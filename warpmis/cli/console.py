"""What every command says, and where: results on standard output, everything else on standard error."""

from __future__ import annotations

import math
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from typing import TYPE_CHECKING, Any, TextIO, cast

from warpmis.cli.streams import Forgiving

if TYPE_CHECKING:
    from warpmis.rendering.progress import Progress


# Stands for the path of a light or camera that the stage has not.
SUPPLIED = "(supplied)"


def say(line: str) -> None:
    """One line on standard error, whatever a library put in its message."""
    print(f"warpmis: {' '.join(line.split())}", file=Forgiving(sys.stderr))


def fail(message: str, status: int) -> int:
    say(f"error: {message}")
    return status


def load_pxr() -> None:
    """Import what reads stages. Ctrl-C waits for it: pxr would swallow it, and be of no use afterwards."""
    if threading.current_thread() is not threading.main_thread():
        import_module("warpmis.usd")
        return
    pressed: list[int] = []
    handler = signal.signal(signal.SIGINT, lambda number, _frame: pressed.append(number))
    try:
        import_module("warpmis.usd")
    finally:
        signal.signal(signal.SIGINT, handler)
    if pressed and callable(handler):
        handler(signal.SIGINT, None)


def start_warp() -> None:
    """Start Warp, and say what its native half has to say."""
    from warpmis.device.start import start_warp as start

    for line in start():
        say(line)


def plain(value: Any) -> Any:
    """`value` as JSON can say it: NumPy numbers as Python's, infinite ones and NaN, which JSON lacks, as null."""
    if isinstance(value, Mapping):
        return {str(name): plain(item) for name, item in value.items()}
    if hasattr(value, "tolist"):  # NumPy arrays and scalars
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def speed_text(samples: int, seconds: float) -> str:
    return f"{samples / max(seconds, 1e-9) / 1e6:.2f} Msamples/s"


def error_text(error: float, spread: float) -> str:
    """A relative error and its standard error, such as "2.31 ± 0.05 %": two digits of the second."""
    digits = max(0, 1 - math.floor(math.log10(max(100.0 * spread, 1e-6))))
    return f"{100.0 * error:.{digits}f} ± {100.0 * spread:.{digits}f} %"


@contextmanager
def progress_bar(*, quiet: bool, label: str = "") -> Iterator[Callable[[Progress], None] | None]:
    """A bar on a terminal, which begins with `label`; elsewhere a line if kernels are compiled; None if quiet."""
    if quiet or not sys.stderr.isatty():
        yield None if quiet else compilation_line()
        return
    from rich.console import Console
    from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TextColumn("{task.fields[speed]}"),
        TimeRemainingColumn(),
    )
    with Bar(*columns, console=Console(file=cast(TextIO, Forgiving(sys.stderr))), transient=True) as bar:
        task = bar.add_task("load", total=None, speed="")

        def show(progress: Progress) -> None:
            error = ""
            if progress.relative_error is not None and progress.standard_error is not None:
                error = f"error {error_text(progress.relative_error, progress.standard_error)}"
            bar.update(
                task,
                description=" ".join(f"{label} {progress.phase} {progress.detail} {error}".split()),
                completed=progress.done,
                total=progress.total or None,  # unknown: the bar swings
                speed=speed_text(progress.samples, progress.seconds) if progress.samples else "",
            )

        yield show


def byte_text(size: float) -> str:
    for unit in ("B", "KiB", "MiB"):
        if size < 1024:
            return f"{size:.4g} {unit}"
        size /= 1024
    return f"{size:.4g} GiB"


def compilation_line() -> Callable[[Progress], None]:
    """Says once why nothing is seen for some seconds."""
    said: list[str] = []

    def show(progress: Progress) -> None:
        if progress.phase == "compile" and progress.detail and not said:
            said.append("compiling kernels, first use of these effects")
            say(said[0])

    return show
