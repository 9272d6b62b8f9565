"""Kernels to machine code: what Warp's cache holds already, what is compiled, and how long that takes."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import warp as wp

# Each reads Warp's headers for itself, which takes as long as half a trace kernel: of those a run has three at most.
COMPILERS = 2


@dataclass(frozen=True)
class Compilation:
    """Kernels of one run, ready to launch.

    Attributes:
        compiled, cached: number of kernels of either kind; those that the process had in use already are cached.
        seconds: time until all were ready [s].
    """

    compiled: int
    cached: int
    seconds: float


def load_kernels(
    kernels: Iterable[wp.Kernel], device: str, announce: Callable[[int], None] | None = None
) -> Compilation:
    """Compile what Warp's cache lacks and load the rest; `announce` is told beforehand how many are to be compiled."""
    start = time.perf_counter()
    modules = list({kernel.module: None for kernel in kernels})
    is_cpu = wp.get_device(device).is_cpu
    folders = [cache_folder(module, is_cpu) for module in modules]
    before = [binaries(folder, is_cpu) for folder in folders]
    absent = sum(not found for found in before)
    if absent and announce is not None:
        announce(absent)
    wp.force_load(device=device, modules=modules, max_workers=COMPILERS)
    compiled = sum(binaries(folder, is_cpu) != earlier for folder, earlier in zip(folders, before, strict=True))
    return Compilation(compiled, len(modules) - compiled, time.perf_counter() - start)


def cache_folder(module: wp.Module, is_cpu: bool) -> Path:
    """Where Warp keeps what it makes of a module: on a CPU that for blocks of one thread, as launches there have."""
    return Path(wp.config.kernel_cache_dir) / module.get_module_identifier(1 if is_cpu else None)


def binaries(folder: Path, is_cpu: bool) -> set[str]:
    endings = (".o",) if is_cpu else (".ptx", ".cubin")
    return {path.name for path in folder.glob("*") if path.suffix in endings}
