"""Kernels to machine code, by threads beside the run: it waits for those alone that it is about to launch."""

from __future__ import annotations

import os
import re
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from functools import cache

import warp as wp

from warpmis.device import kernel_cache
from warpmis.device.cpus import available_cpus
from warpmis.device.start import start_warp
from warpmis.errors import WarpmisError

# Each thread reads Warp's headers for itself, which takes as long as half a trace kernel: of those a run has three at
# most.
COMPILERS = 2

# So often a run that waits says what for [s].
TICK = 0.1


@dataclass(frozen=True)
class Compilation:
    """Kernels of one run, ready to launch.

    Attributes:
        compiled, cached: number of kernels of either kind; those that the process had in use already are cached.
        seconds: time that the run waited for them [s].
    """

    compiled: int
    cached: int
    seconds: float


@dataclass(frozen=True)
class Load:
    """A module on its way: `found` tells whether it was in the cache, the future whether it had to be compiled."""

    name: str
    found: bool
    future: Future[bool]


class Compiler:
    """The kernels of one run.

    Args:
        device: a Warp device.
        tell: while the run waits, called every tenth of a second with what it waits for, and with "" once it goes on.
    """

    def __init__(self, device: str, tell: Callable[[str], None] | None = None) -> None:
        start_warp()
        self.device = device
        self.is_cpu = wp.get_device(device).is_cpu
        self.tell = tell or (lambda _: None)
        self.loads: dict[wp.Module, Load] = {}
        self.seconds = 0.0

    @property
    def absent(self) -> int:
        """How many of those begun were not in the cache."""
        return sum(not load.found for load in self.loads.values())

    def begin(self, kernels: Sequence[wp.Kernel]) -> list[Future[bool]]:
        """Compile or load kernels beside the run, the first ones first."""
        for kernel in kernels:
            load = self.loads.get(kernel.module)
            if load is None or load.future.cancelled():  # by another run that waited for it
                self.loads[kernel.module] = _load_of(kernel, self.device, self.is_cpu)
        return [self.loads[kernel.module].future for kernel in kernels]

    def wait(self, kernels: Sequence[wp.Kernel]) -> None:
        """Until the kernels can be launched. Ctrl-C ends the wait, not the compiler.

        Raises:
            WarpmisError: there is no room to compile them.
        """
        start = time.perf_counter()
        futures = self.begin(kernels)
        try:
            while wait(futures, TICK).not_done:
                self.tell(self._state(self.seconds + time.perf_counter() - start))
                futures = self.begin(kernels)
        except BaseException:
            self.cancel()
            raise
        self.tell("")
        self.seconds += time.perf_counter() - start
        for future in futures:
            future.result()

    def _state(self, seconds: float) -> str:
        """What is ready after how long a wait, and what is being compiled: "2 of 7 kernels, 3.1 s: trace, pool"."""
        loads = [load for load in self.loads.values() if not load.found]
        ready = sum(load.future.done() for load in loads)
        at_work = ", ".join(load.name for load in loads if load.future.running())
        return f"{ready} of {len(loads)} kernels, {seconds:.1f} s{': ' if at_work else ''}{at_work}"

    def __enter__(self) -> Compiler:
        return self

    def __exit__(self, *_: object) -> None:
        self.cancel()

    def cancel(self) -> None:
        """Compile nothing more for this run but what is being compiled."""
        for load in self.loads.values():
            load.future.cancel()

    def outcome(self) -> Compilation:
        """What has become of those begun, but for what failed and nobody waited for; and how long the run waited."""
        done = [load.future for load in self.loads.values() if load.future.done() and not load.future.cancelled()]
        ready = [future for future in done if future.exception() is None]
        compiled = sum(future.result() for future in ready)
        return Compilation(compiled, len(ready) - compiled, self.seconds)


def load_kernels(
    kernels: Iterable[wp.Kernel], device: str, announce: Callable[[int], None] | None = None
) -> Compilation:
    """Compile what Warp's cache lacks and load the rest; `announce` is told beforehand how many are to be compiled."""
    compiler = Compiler(device)
    kernels = list(kernels)
    compiler.begin(kernels)
    if compiler.absent and announce is not None:
        announce(compiler.absent)
    compiler.wait(kernels)
    return compiler.outcome()


# ---- the process' compiling threads ---------------------------------------------------------------------------------

_lock = threading.Lock()
_in_flight: dict[tuple[wp.Module, str], Load] = {}


@cache
def _threads() -> ThreadPoolExecutor:
    """For the process, as each has read Warp's headers once it has compiled something."""
    return ThreadPoolExecutor(min(COMPILERS, available_cpus()), "compile")


def _forget_threads() -> None:
    """A forked process has none of its parent's threads."""
    _in_flight.clear()
    _threads.cache_clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_threads)


def is_compiling() -> bool:
    """Whether a thread is still at work, which a process that ends would wait for."""
    return any(load.future.running() for load in _in_flight.values())


def _plain_name(kernel: wp.Kernel) -> str:
    """The function's name, without where it stands and what it is specialised to."""
    return re.sub(r"^.*__|_[0-9a-f]{16}$", "", kernel.key)


def _load_of(kernel: wp.Kernel, device: str, is_cpu: bool) -> Load:
    """A load of the kernel's module: one that is on its way, maybe for another run, or a new one."""
    module = kernel.module
    with _lock:
        load = _in_flight.get((module, device))
        for key in [key for key, other in _in_flight.items() if other.future.done()]:
            del _in_flight[key]
        if load is None or load.future.done():
            found = bool(kernel_cache.binaries(kernel_cache.folder_of(module, is_cpu), is_cpu))
            load = Load(_plain_name(kernel), found, _threads().submit(_make_ready, kernel, device, is_cpu))
            _in_flight[module, device] = load
        return load


def _make_ready(kernel: wp.Kernel, device: str, is_cpu: bool) -> bool:
    """Load a kernel's module, compiled if the cache lacks it or holds it torn. Whether it was compiled."""
    folder = kernel_cache.folder_of(kernel.module, is_cpu)
    if kernel_cache.is_torn(folder, is_cpu):
        kernel_cache.discard(folder)
    if kernel_cache.binaries(folder, is_cpu):
        return _load_or_compile(kernel, device, is_cpu)
    with kernel_cache.claimed(folder):
        return _load_or_compile(kernel, device, is_cpu)


def _load_or_compile(kernel: wp.Kernel, device: str, is_cpu: bool) -> bool:
    """Link what the cache holds, or compile it. Whether it was compiled."""
    module = kernel.module
    folder = kernel_cache.folder_of(module, is_cpu)
    found = set(kernel_cache.binaries(folder, is_cpu))
    if not found and (reason := kernel_cache.obstacle()):
        kernel_cache.move_to_temporary_folder(reason)
    try:
        _link(kernel, device, is_cpu)
    except Exception as error:
        if found:  # torn, without a checksum that tells
            kernel_cache.discard(folder)
        if kernel_cache.obstacle():
            kernel_cache.move_to_temporary_folder(kernel_cache.obstacle())
        elif not found:
            raise _explained(error) from error
        module.unload()  # forget the failure
        _link(kernel, device, is_cpu)
        found = set()
    folder = kernel_cache.folder_of(module, is_cpu)
    if set(kernel_cache.binaries(folder, is_cpu)) == found:
        return False
    kernel_cache.seal(folder, is_cpu)
    return True


def _link(kernel: wp.Kernel, device: str, is_cpu: bool) -> None:
    """Load the module and look the kernel up in it: an object file full of zeros is an object file, too."""
    found = kernel.module.load(wp.get_device(device), 1 if is_cpu else None)
    if not found.get_kernel_hooks(kernel).forward:
        raise RuntimeError(f"{kernel.key} is not in its module")


def _explained(error: Exception) -> Exception:
    if not isinstance(error, OSError):
        return error
    folder, reason = wp.config.kernel_cache_dir, error.strerror or str(error)
    return WarpmisError(f"no kernel can be compiled into {folder} ({reason}): set WARP_CACHE_PATH to another folder")
