"""Fingerprints: whether two scenes are the same to the last bit, and whether two programs are."""

from __future__ import annotations

import dataclasses
import hashlib
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

import warpmis
from warpmis.scene import Scene

# What of a scene no sample depends on.
LEFT_OUT = ("name", "warnings", "notes")


def scene_fingerprint(scene: Scene) -> str:
    """The same of scenes of the same content."""
    return _fingerprint(scene, {}).hex()


@cache
def program_fingerprint() -> str:
    """The same of programs that render the same bits on one machine: of warpmis' sources and Warp's version."""
    found = hashlib.sha256(f"{warpmis.__version__} {wp.__version__}".encode())
    package = Path(warpmis.__file__).parent
    for path in sorted(package.rglob("*.py")):
        found.update(path.relative_to(package).as_posix().encode() + path.read_bytes())
    return found.hexdigest()


def file_fingerprint(path: str) -> str:
    """Of a file's bytes; "" where there is none."""
    try:
        with open(path, "rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return ""


def array_fingerprint(array: np.ndarray[Any, Any]) -> str:
    return _fingerprint(array, {}).hex()


def _fingerprint(value: Any, known: dict[int, bytes]) -> bytes:
    """known: those of objects that were met before, as a picture may be in many materials."""
    if id(value) in known:
        return known[id(value)]
    found = hashlib.sha256(type(value).__name__.encode())
    if isinstance(value, np.ndarray):
        found.update(f"{value.dtype} {value.shape}".encode())
        found.update(np.ascontiguousarray(value).data)
    elif dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            if field.name not in LEFT_OUT:
                found.update(field.name.encode() + _fingerprint(getattr(value, field.name), known))
    elif isinstance(value, dict):
        for name, item in value.items():
            found.update(repr(name).encode() + _fingerprint(item, known))
    elif isinstance(value, tuple | list):
        for item in value:
            found.update(_fingerprint(item, known))
    else:
        found.update(repr(value).encode())
        return found.digest()
    known[id(value)] = found.digest()
    return known[id(value)]
