"""What a reading has to say: a line for each thing, however many prims it was found on."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

# Numbers tell two lines of the same kind apart; digits within a name or a path do not count.
NUMBER = re.compile(r"(?<![\w/.])-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?(?!\.?\w)")

# So do the prims that a message names; a file is told from a prim by its ending, and which one it is does count.
PRIM_PATH = re.compile(r"(?<![\w@./])/[A-Za-z_]\w*(?:/\w+)*(?![\w./@-])")

# pxr's own lines name prims as (/Path), </Path> or @layer@</Path>.
PRIM_IN_TEXT = re.compile(r"(?<=[(<])/[\w/]*(?:\.[\w:]+)?(?=[)>])")


@dataclass(eq=False)
class _Repeated:
    """A line's text and first path, and all the paths that it was said of."""

    first: str
    paths: set[str]


@dataclass(eq=False)
class Messages:
    """Lines `path: message` in the order of their first appearance; iterating gives the lines.

    Messages that differ in numbers, or in the prims that they name, are of one kind. They are one line, the first,
    with how many more there are.
    """

    kinds: dict[str, _Repeated] = field(default_factory=dict)

    def add(self, path: object, message: str) -> None:
        """Records a message about a prim, or, with the path "", about the stage."""
        where = str(path)
        line = f"{where}: {message}" if where else message
        bare = message.replace(where, "") if where.startswith("/") else message
        self._record(NUMBER.sub("#", PRIM_PATH.sub("", bare)), line, where)

    def add_text(self, text: str) -> None:
        """Records a message of pxr's, which names its prims within the text."""
        places = PRIM_IN_TEXT.findall(text)
        self._record(NUMBER.sub("#", PRIM_IN_TEXT.sub("", text)), text, places[0] if places else text)

    def _record(self, kind: str, line: str, path: str) -> None:
        self.kinds.setdefault(kind, _Repeated(line, set())).paths.add(path)

    def __iter__(self) -> Iterator[str]:
        for repeated in self.kinds.values():
            more = len(repeated.paths) - 1
            yield f"{repeated.first} (and {more} more like it)" if more else repeated.first

    def __len__(self) -> int:
        return len(self.kinds)
