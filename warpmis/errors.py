"""The exceptions that warpmis raises on purpose: each message is one line that names the place and the remedy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

# So many warnings stand in an error's text.
MOST_QUOTED = 3


class WarpmisError(Exception):
    """Base of every error that warpmis raises on purpose."""


class ConfigError(WarpmisError):
    """A setting that cannot be honoured: unknown method, impossible sample budget, allocation off the simplex."""


class StageError(WarpmisError):
    """A stage that cannot be rendered: missing, unreadable, empty, or without the camera that was asked for.

    Args:
        message: what is wrong and what to do about it, in one line.
        prim_path: the prim concerned, or the stage's file name where no prim is.
        warnings: what was found before, which may explain it; the error's text quotes the first of them.
    """

    def __init__(self, message: str, prim_path: str = "", warnings: Sequence[str] = ()) -> None:
        self.message = message
        self.prim_path = prim_path
        self.warnings = tuple(warnings)
        quoted = list(self.warnings[:MOST_QUOTED])
        if len(self.warnings) > MOST_QUOTED:
            quoted.append(f"and {len(self.warnings) - MOST_QUOTED} more warnings")
        text = "; ".join([message, *quoted])
        super().__init__(f"{prim_path}: {text}" if prim_path else text)

    def explained_by(self, warnings: Sequence[str]) -> StageError:
        """The same error with the warnings that came before it."""
        return StageError(self.message, self.prim_path, warnings)


class Interrupted(KeyboardInterrupt):
    """A render that was interrupted with samples taken: `result` is the RenderResult of those.

    A KeyboardInterrupt, so that it ends what a plain one would end.
    """

    def __init__(self, result: Any) -> None:
        super().__init__("interrupted")
        self.result = result
