"""Warp's start, without its chatter."""

from __future__ import annotations

import os
import tempfile
from functools import cache

import warp as wp

from warpmis.device.kernel_cache import move_to_temporary_folder

# Most machines have no use for it.
NO_DRIVER = "Could not find or load the NVIDIA CUDA driver"


@cache
def start_warp() -> tuple[str, ...]:
    """Initialise Warp, once, and return what its native half had to say.

    It tells of its devices and of every kernel it loads on standard output, and its native half warns on the process'
    standard error. Where its folder of kernels cannot be made, they go into a temporary one (kernel_cache.notes).
    """
    if wp.config.log_level == wp.LOG_INFO:  # as nobody has asked for another
        wp.config.log_level = wp.LOG_ERROR
    try:
        stderr = os.dup(2)
    except OSError:  # closed
        _initialise()
        return ()
    with tempfile.TemporaryFile() as heard:
        os.dup2(heard.fileno(), 2)
        try:
            _initialise()
        finally:
            os.dup2(stderr, 2)
            os.close(stderr)
        heard.seek(0)
        lines = heard.read().decode(errors="replace").splitlines()
    return tuple(line for line in lines if NO_DRIVER not in line)


def _initialise() -> None:
    try:
        wp.init()
    except OSError as error:
        move_to_temporary_folder(error.strerror or str(error))
        wp.init()
