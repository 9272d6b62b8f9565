"""What every reader of a prim needs to know: the time, the purposes, and where warnings go."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Tf, UsdUtils

# World coordinates beyond this overflow when two float32 lengths are multiplied.
MAX_COORDINATE = 1e18

# pxr's own lines about composition: "In </Prim>: what (instantiating stage on stage @file@ <address>)".
PRIM_PREFIX = re.compile(r"^In <[^>]*>: ")
SOURCE_SITE = re.compile(r" \((instantiating|recomposing) stage on stage .*\)$")


@dataclass(frozen=True)
class Reading:
    """One reading of one stage at one time.

    Attributes:
        stage: the Usd.Stage, kept alive here.
        time: the numeric Usd.TimeCode at which every attribute is read.
        purposes: the purposes that are rendered, "default" among them.
        warnings: what was found but not honoured, in order and without repeats (a dict used as an ordered set).
        notes: what was supplied because the stage has none.
    """

    stage: Any
    time: Any
    purposes: frozenset[str]
    warnings: dict[str, None] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def warn(self, path: object, message: str) -> None:
        """Records one line `path: message`; the same line twice is kept once."""
        self.warnings[f"{path}: {message}"] = None

    def get(self, attribute: Any, default: Any = None) -> Any:
        """The attribute's value at the reading's time, or `default` where it has none or is no attribute."""
        value = attribute.Get(self.time) if attribute else None
        return default if value is None else value

    def indices(self, attribute: Any) -> NDArray[np.int64]:
        """An int array attribute, shape (n,); empty where it has no value or, with a warning, another type."""
        return self._array(attribute, "iu", ()).astype(np.int64)

    def vectors(self, attribute: Any) -> NDArray[np.float64]:
        """A float3 array attribute, shape (n, 3); empty where it has no value or, with a warning, another type."""
        return self._array(attribute, "f", (3,)).astype(np.float64)

    def _array(self, attribute: Any, kinds: str, item: tuple[int, ...]) -> NDArray[Any]:
        """An array attribute whose dtype.kind is one of `kinds`, shape (n, *item)."""
        value = self.get(attribute)
        array = np.empty((0, *item)) if value is None else np.asarray(value)
        if array.ndim and not len(array):
            return np.empty((0, *item))
        if array.ndim == 1 + len(item) and array.shape[1:] == item and array.dtype.kind in kinds:
            return array
        self.warn(attribute.GetPath(), f"left out: its type {attribute.GetTypeName()} is not the schema's")
        return np.empty((0, *item))

    def number(self, prim: Any, name: str, default: float) -> float:
        """A scalar attribute of `prim` by name; NaN where its value is not a number."""
        value = self.get(prim.GetAttribute(name), default)
        return float(value) if isinstance(value, (int, float)) else float("nan")


def one_line(error: BaseException) -> str:
    """What went wrong first in a pxr exception, without the place in the C++ sources."""
    first = error.args[0] if error.args else error
    return " ".join(str(getattr(first, "commentary", first)).split())


@contextmanager
def captured_diagnostics() -> Iterator[list[str]]:
    """Keeps pxr from writing to standard error; the list holds its messages, a line each, after the block."""
    messages: list[str] = []
    delegate = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        yield messages
    finally:
        messages += [" ".join(item.commentary.split()) for item in delegate.TakeUncoalescedDiagnostics()]
        del delegate


def composition_warnings(reading: Reading) -> None:
    """One warning for each reference, payload or sublayer that could not be composed."""
    for error in reading.stage.GetCompositionErrors():
        site = getattr(error, "rootSite", None)
        reading.warn(site.path if site else reading.stage.GetRootLayer().identifier, " ".join(str(error).split()))


def unrepeated(messages: list[str], warnings: Iterable[str]) -> list[str]:
    """pxr's messages without what stands in the warnings already, and without where in the sources they arose."""
    bare = (SOURCE_SITE.sub("", PRIM_PREFIX.sub("", message)).strip() for message in messages)
    return [message for message in dict.fromkeys(bare) if not any(message in warning for warning in warnings)]


PxrError = Tf.ErrorException
