"""The picture so far, for those who watch a render."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from warpmis.errors import ConfigError

# Called with the picture so far, linear Rec.709, shape (H, W, 3) float32, row 0 on top.
PreviewCallback = Callable[[NDArray[np.float32]], None]

INTERVAL = 2.0


class Preview:
    """Hands the picture out between two passes over it, at most once in `interval` seconds."""

    def __init__(self, show: PreviewCallback, interval: float = INTERVAL) -> None:
        if not 0.0 <= interval < float("inf"):
            raise ConfigError(f"the preview interval must be finite and not negative, got {interval:g} s")
        self.show = show
        self.interval = interval
        self.shown = float("-inf")

    def offer(self, image: Callable[[], NDArray[np.float32]]) -> None:
        """Show the picture that `image` makes, if it is time."""
        if time.monotonic() - self.shown >= self.interval:
            self.show(image())
            self.shown = time.monotonic()
