"""The exceptions that warpmis raises on purpose: each message is one line that names the place and the remedy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

# So many warnings stand in an error's text.
MOST_QUOTED = 3


class WarpmisError(Exception):
    """Base of every error that warpmis raises on purpose."""


class ConfigError(WarpmisError):
    """A setting is impossible: an unknown method, too small a budget, an allocation that does not sum to 1."""


class StageError(WarpmisError):
    """A stage cannot be rendered: it is missing, unreadable or empty, or has no such camera.

    Args:
        message: what is wrong and what to do about it, in one line.
        prim_path: the prim concerned, or else the stage's file name.
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
    """Ctrl-C stopped a render that has samples: `result` is its RenderResult so far.

    It is a KeyboardInterrupt, so it ends what a plain one would end.
    """

    def __init__(self, result: Any) -> None:
        super().__init__("interrupted")
        self.result = result
