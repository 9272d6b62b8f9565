"""Warp's folder of compiled kernels: what it holds, whether that is whole, and where to go if it cannot be written."""

from __future__ import annotations

import atexit
import os
import shutil
import tempfile
import threading
import zlib
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import warp as wp

from warpmis.errors import WarpmisError

# A trace kernel takes about a megabyte. The compiler ends the process if it cannot write, so there must be room [B].
ROOM = 64 << 20

_switch = threading.Lock()
_temporary: list[str] = []
_notes: list[str] = []


def folder_of(module: wp.Module, is_cpu: bool) -> Path:
    """Where Warp keeps what it makes of a module: on a CPU that for blocks of one thread, as launches there have."""
    return Path(wp.config.kernel_cache_dir) / module.get_module_identifier(1 if is_cpu else None)


def binaries(folder: Path, is_cpu: bool) -> list[Path]:
    endings = (".o",) if is_cpu else (".ptx", ".cubin")
    return sorted(path for path in folder.glob("*") if path.suffix in endings)


def seal(folder: Path, is_cpu: bool) -> None:
    """Write the checksums of what was compiled into a module's folder; where that cannot be, it is used without."""
    for path in binaries(folder, is_cpu):
        if not _checksum_file(path).exists():
            with suppress(OSError):
                _checksum_file(path).write_text(_checksum(path))


def is_torn(folder: Path, is_cpu: bool) -> bool:
    """Whether a module's folder holds something else than was compiled, as far as checksums tell."""
    try:
        return any(
            _checksum_file(path).read_text() != _checksum(path)
            for path in binaries(folder, is_cpu)
            if _checksum_file(path).exists()
        )
    except (OSError, ValueError):
        return True


def _checksum_file(binary: Path) -> Path:
    return binary.with_name(f"{binary.name}.crc32")


def _checksum(binary: Path) -> str:
    return f"{zlib.crc32(binary.read_bytes()):08x}\n"


@contextmanager
def claimed(folder: Path) -> Iterator[None]:
    """Wait until no other process compiles into a module's folder: what it has compiled need not be compiled again.

    The lock goes with the process that holds it. Where a file system has none, each process compiles for itself.
    """
    with ExitStack() as held:
        with suppress(ImportError, OSError):
            import fcntl  # not on Windows

            locks = folder.parent / "locks"
            locks.mkdir(exist_ok=True)
            lock = held.enter_context((locks / folder.name).open("w"))
            fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def discard(folder: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)


def discard_unfinished() -> None:
    """Remove what this process' compiling threads have begun and will not finish."""
    for folder in Path(wp.config.kernel_cache_dir or os.devnull).glob(f"*_p{os.getpid()}_t*"):
        discard(folder)


def obstacle() -> str:
    """Why nothing can be compiled into the cache; "" where it can."""
    folder = wp.config.kernel_cache_dir
    if not os.path.isdir(folder):
        return "no such folder"
    if not os.access(folder, os.W_OK | os.X_OK):
        return "no permission to write"
    return "no space left" if shutil.disk_usage(folder).free < ROOM else ""


def check_cache() -> None:
    """Raise WarpmisError where what is compiled now would be gone with the process."""
    if _temporary:
        raise WarpmisError(_notes[0])
    if obstacle():
        raise WarpmisError(f"{wp.config.kernel_cache_dir}: {obstacle()}; set WARP_CACHE_PATH to a folder to write into")


def move_to_temporary_folder(reason: str) -> None:
    """Let this process compile its kernels into a folder that goes with it, and note so."""
    with _switch:
        if _temporary:
            return
        asked = wp.config.kernel_cache_dir or os.environ.get("WARP_CACHE_PATH") or "the home folder"
        folder = tempfile.mkdtemp(prefix="warpmis-kernels-")
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
        _temporary.append(folder)
        wp.config.kernel_cache_dir = folder
        _notes.append(
            f"kernels are compiled into a temporary folder, anew each time, for {asked} cannot be written ({reason}): "
            "set WARP_CACHE_PATH to a folder that can"
        )


def notes() -> tuple[str, ...]:
    """What became of the cache, for those who wonder why each render compiles."""
    return tuple(_notes)
