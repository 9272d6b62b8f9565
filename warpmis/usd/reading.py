"""What every reader of a prim needs to know: the time, the purposes, and where warnings go."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Tf, UsdUtils

from warpmis.usd.messages import Messages

# World coordinates beyond this overflow when two float32 lengths are multiplied.
MAX_COORDINATE = 1e18

# pxr's own lines about composition: "In </Prim>: what (instantiating stage on stage @file@ <address>)".
PRIM_PREFIX = re.compile(r"^In <[^>]*>: ")
SOURCE_SITE = re.compile(r" \((instantiating|recomposing) stage on stage .*\)$")

# pxr's line about a MaterialX file, for which it has no reader; and what it calls a layer without a file.
MTLX_ERROR = re.compile(r"Could not (?:open asset|load sublayer) @([^@]*\.mtlx\]?)@", re.IGNORECASE)
ANONYMOUS = re.compile(r"\banon:0x[0-9a-f]+:")

# pxr's line about a binding without its schema.
UNAPPLIED = re.compile(r"material bindings on prim at path \(([^)]*)\) but MaterialBindingAPI is not applied")


@dataclass(frozen=True)
class Reading:
    """One reading of one stage at one time.

    Attributes:
        stage: the Usd.Stage, kept alive here.
        time: the numeric Usd.TimeCode at which every attribute is read.
        purposes: the purposes that are rendered, "default" among them.
        levels: how many times subdivision surfaces are refined.
        sight: how large things look (a sight.Sight); None where all that is asked for is refined.
        extent: how large the stage is (an extent.StageExtent); None until its prims have been placed.
        warnings: what was found but is not supported.
        notes: what was supplied because the stage has none.
    """

    stage: Any
    time: Any
    purposes: frozenset[str]
    levels: int
    sight: Any = None
    extent: Any = None
    warnings: Messages = field(default_factory=Messages)
    notes: Messages = field(default_factory=Messages)

    def warn(self, path: object, message: str) -> None:
        """Records what of a prim is not supported; lines of one kind are kept as one."""
        self.warnings.add(path, message)

    def note(self, message: str, path: object = "") -> None:
        """Records what was supplied, of a prim or of the whole stage."""
        self.notes.add(path, message)

    def get(self, attribute: Any, default: Any = None, like: Any = None) -> Any:
        """The attribute's value at the reading's time; `default` where it has none.

        USD lets a value be of another type than its attribute. Such a value is left out with a warning; numbers of
        another precision are not.

        Args:
            like: a value of the type that is wanted, for attributes whose type no schema fixes, such as a shader's
                inputs: "" for a string or token, False, 0.0, Sdf.AssetPath(), an array of the shape.
        """
        value = self.value(attribute)
        if value is None:
            return default
        if like is None and type(value) is type(default):  # to ask USD for the attribute's type takes long
            return value
        if not is_alike(value, attribute.GetTypeName().defaultValue if like is None else like):
            name = attribute.GetTypeName() if like is None else type_name(like)
            self.warn(attribute.GetPath(), f"left out: its value is not of type {name}")
            return default
        return value

    def value(self, attribute: Any) -> Any:
        """The attribute's value at the reading's time, of whatever type; None without any."""
        try:
            return attribute.Get(self.time) if attribute else None
        except PxrError as error:
            self.warn(attribute.GetPath(), f"left out: {one_line(error)}")
            return None

    def targets(self, relationship: Any, otherwise: str = "") -> list[Any]:
        """The paths that a relationship leads to, in order, with a warning for each that does not exist if `otherwise`
        says what happens then."""
        if not relationship:
            return []
        try:
            paths = list(relationship.GetForwardedTargets())
        except PxrError as error:
            self.warn(relationship.GetPath(), f"left out: {one_line(error)}")
            return []
        for path in paths:
            if otherwise and not self.stage.GetObjectAtPath(path):
                self.warn(relationship.GetPath(), f"its target {path} does not exist; {otherwise}")
        return paths

    def indices(self, attribute: Any) -> NDArray[np.int64]:
        """An int array attribute, shape (n,); empty where it has no value."""
        return self._array(attribute, np.empty(0, np.int64))

    def vectors(self, attribute: Any) -> NDArray[np.float64]:
        """A float3 array attribute, shape (n, 3); empty where it has no value."""
        return self._array(attribute, np.empty((0, 3)))

    def numbers(self, attribute: Any) -> NDArray[np.float64]:
        """A float array attribute, shape (n,); empty where it has no value."""
        return self._array(attribute, np.empty(0))

    def _array(self, attribute: Any, empty: NDArray[Any]) -> NDArray[Any]:
        """An array attribute as `empty` is: also of a primvar, whose type no schema fixes."""
        value = np.asarray(self.get(attribute, empty))
        if _is_convertible(value, empty):
            return value.astype(empty.dtype)
        if value.size:
            self.warn(attribute.GetPath(), f"left out: {attribute.GetTypeName()} is not its type")
        return empty

    def number(self, prim: Any, name: str, default: float) -> float:
        """A scalar attribute of `prim` by name; NaN or infinite where it is authored so."""
        return float(self.get(prim.GetAttribute(name), default))


def is_alike(value: Any, expected: Any) -> bool:
    """Whether a value is of the expected one's type, or numbers of its kind and shape, whatever their precision."""
    if type(value) is type(expected):
        return True
    if is_array(value) != is_array(expected) or _is_quaternion(value) != _is_quaternion(expected):
        return False
    return _is_convertible(np.asarray(value), np.asarray(expected))


def _is_quaternion(value: Any) -> bool:
    """Whether it is one or an array of them, which look like vectors of four."""
    return type(value).__name__.startswith("Quat")


def is_array(value: Any) -> bool:
    """Whether it is one of pxr's arrays: a matrix is none, though it looks like four rows."""
    return type(value).__name__.endswith("Array")


def _is_convertible(value: NDArray[Any], expected: NDArray[Any]) -> bool:
    """Whether a value is numbers of the expected kind and shape; an expected array is empty, shape (0, ...)."""
    kinds = "iub" if expected.dtype.kind in "iub" else "iubf"
    if value.dtype.kind not in kinds or expected.dtype.kind not in "iubf":
        return False
    if expected.ndim and len(expected) == 0:
        return value.ndim == expected.ndim and value.shape[1:] == expected.shape[1:]
    return value.shape == expected.shape


def type_name(like: Any) -> str:
    """What a value such as `like` is called in a stage."""
    if isinstance(like, np.ndarray):
        return f"float{len(like)}"
    return {str: "token or string", bool: "bool", float: "float", Sdf.AssetPath: "asset"}[type(like)]


def consistent_counts(
    counts: NDArray[np.int64], elements: int, names: tuple[str, str, str], path: object, reading: Reading
) -> NDArray[np.int64]:
    """The longest run of counts from the start that are not negative and have all their elements.

    Args:
        names: of the counts, of the elements, and of what is counted, for the warning.
    """
    consistent = np.logical_and.accumulate(counts >= 0) & (np.cumsum(counts) <= elements)
    number = int(np.logical_and.accumulate(consistent).sum()) if len(counts) else 0
    if number < len(counts) or counts.sum() != elements:
        reading.warn(
            path,
            f"{names[0]} add up to {counts.sum()} but there are {elements} {names[1]}; "
            f"the first {number} {names[2]} are used",
        )
    return counts[:number]


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


def composition_warnings(reading: Reading, unread: Mapping[str, str]) -> None:
    """One warning for each reference, payload or sublayer that could not be composed.

    Args:
        unread: why MaterialX files cannot be read, by their identifier.
    """
    found = []
    for error in reading.stage.GetCompositionErrors():
        site = getattr(error, "rootSite", None)
        path = site.path if site else reading.stage.GetRootLayer().identifier
        message = ANONYMOUS.sub("", " ".join(str(error).split()))
        if file := MTLX_ERROR.search(message):
            if file[1] not in unread and "sublayer" in file[0]:  # it stands in another place
                continue
            message = f"the MaterialX file {file[1]} is left out: {unread.get(file[1], 'it cannot be opened')}"
        found.append((str(path), message))
    for path, message in sorted(found):  # pxr composes in threads, which find errors in any order
        reading.warn(path, message)


def add_diagnostics(messages: Iterable[str], warnings: Messages) -> None:
    """Adds pxr's messages, without where in the sources they arose, but those that a warning quotes already."""
    known = list(warnings)
    for message in messages:
        if MTLX_ERROR.search(message):
            continue
        bare = ANONYMOUS.sub("", SOURCE_SITE.sub("", PRIM_PREFIX.sub("", message))).strip()
        unapplied = UNAPPLIED.search(bare)
        if unapplied:
            warnings.add(unapplied[1], "MaterialBindingAPI is not applied; its binding counts all the same")
        elif not any(bare in line for line in known):
            warnings.add_text(bare)


PxrError = Tf.ErrorException
