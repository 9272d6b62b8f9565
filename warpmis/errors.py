"""The exceptions that warpmis raises on purpose: each message is one line that names the place and the remedy."""

from typing import Any


class WarpmisError(Exception):
    """Base of every error that warpmis raises on purpose."""


class ConfigError(WarpmisError):
    """A setting that cannot be honoured: unknown method, impossible sample budget, allocation off the simplex."""


class StageError(WarpmisError):
    """A stage that cannot be rendered: missing, unreadable, empty, or without the camera that was asked for.

    Args:
        message: what is wrong and what to do about it, in one line.
        prim_path: the prim concerned, or the stage's file name where no prim is.
    """

    def __init__(self, message: str, prim_path: str = "") -> None:
        super().__init__(f"{prim_path}: {message}" if prim_path else message)
        self.prim_path = prim_path


class Interrupted(KeyboardInterrupt):
    """A render that was interrupted with samples taken: `result` is the RenderResult of those.

    A KeyboardInterrupt, so that it ends what a plain one would end.
    """

    def __init__(self, result: Any) -> None:
        super().__init__("interrupted")
        self.result = result
