"""Kernels launched piece by piece: from a pool of threads on a CPU, where a launch runs on one thread, else one by one.

A CPU launch releases Python's lock. Pieces of some tens of milliseconds let all threads share a round, progress move
and an interrupt end it soon.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from itertools import islice
from typing import Any

import warp as wp

from warpmis.device.cpus import available_cpus

# Pixel samples of one launch of a trace kernel: some tens of milliseconds on a CPU thread.
CPU_LAUNCH = 1 << 15
GPU_LAUNCH = 1 << 24
# Rows of one launch of another kernel on a CPU thread.
CPU_ROWS = 1 << 13
# Launches of a round shrink towards its end, to as small a part.
SMALLEST = 16

# First pixel, or other row, of a launch, and their number.
Piece = tuple[int, int]


class Launcher:
    """The threads of one render on one device."""

    def __init__(self, device: str, threads: int | None) -> None:
        """threads: None for as many as the process has CPUs; a GPU needs one alone."""
        self.device = device
        self.is_cuda = wp.get_device(device).is_cuda
        self.threads = 1 if self.is_cuda else threads or available_cpus()
        self.pool = ThreadPoolExecutor(self.threads)

    def run(self, launch: Callable[[Piece], None], pieces: Iterator[Piece]) -> None:
        """Call `launch` for all pieces, from all threads.

        A single one has a thread of its own, too: an interrupt, which reaches the main thread alone, cuts no launch
        in two.
        """
        # Few launches are queued at a time, so that an interrupt ends the round within some tens of milliseconds.
        pending = {self.pool.submit(launch, piece) for piece in islice(pieces, 2 * self.threads)}
        try:
            while pending:
                done, pending = wait(pending, return_when=FIRST_COMPLETED)
                for future in done:
                    future.result()
                pending |= {self.pool.submit(launch, piece) for piece in islice(pieces, len(done))}
        finally:
            # An interrupt's caller reads what the launches write.
            wait(pending)

    def run_over(self, kernel: wp.Kernel, rows: int, inputs: list[Any]) -> None:
        """Launch a kernel over rows that take about equally long; its first argument is the first row of a launch."""

        def launch(piece: Piece) -> None:
            wp.launch(kernel, dim=piece[1], inputs=[piece[0], *inputs], device=self.device)

        most = rows if self.is_cuda else min(CPU_ROWS, -(-rows // self.threads))
        self.run(launch, ((first, min(most, rows - first)) for first in range(0, rows, max(most, 1))))

    def pieces(self, pixels: int, samples: int) -> Iterator[Piece]:
        """Whole pixels with all their samples, so that each pixel has one thread.

        Several threads get fewer pixels towards the end, so that all end at once.

        Reference: Polychronopoulos, Kuck (1987), "Guided Self-Scheduling".
        """
        most = max(1, (GPU_LAUNCH if self.is_cuda else CPU_LAUNCH) // samples)
        least = most if self.threads == 1 else max(1, most // SMALLEST)
        first = 0
        while first < pixels:
            remaining = pixels - first
            count = min(remaining, most, max(least, remaining // (2 * self.threads)))
            yield first, count
            first += count
