"""Plain values and arrays in one file, which appears whole or not at all: what a checkpoint is."""

from __future__ import annotations

import json
import os
import zipfile
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpmis.errors import WarpmisError
from warpmis.output.atomic import replacing

VALUES = "values.json"


def write_bundle(path: str | os.PathLike[str], value: Any) -> None:
    """Write dictionaries with names as keys, lists, tuples, numbers, text, None and arrays, nested at will.

    Raises:
        WarpmisError: the file cannot be written; the old one is as it was.
    """
    arrays: list[NDArray[Any]] = []
    skeleton = json.dumps(_packed(value, arrays))
    with (
        replacing(path, one_writer=True) as temporary,
        zipfile.ZipFile(temporary, "w", zipfile.ZIP_STORED) as archive,
    ):
        archive.writestr(VALUES, skeleton)
        for index, array in enumerate(arrays):
            with archive.open(f"{index}.npy", "w", force_zip64=True) as file:
                np.lib.format.write_array(file, array, allow_pickle=False)


def read_bundle(path: str | os.PathLike[str]) -> Any:
    """What `write_bundle` was given; every byte is checked.

    Raises:
        WarpmisError: the file cannot be read, or is not a whole one of these.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            skeleton = json.loads(archive.read(VALUES))

            def array(index: int) -> NDArray[Any]:
                with archive.open(f"{index}.npy") as file:
                    read: NDArray[Any] = np.lib.format.read_array(file, allow_pickle=False)
                    file.read(1)  # at its end the checksum is compared
                    return read

            return _unpacked(skeleton, array)
    except OSError as error:
        raise WarpmisError(f"{path}: cannot be read: {error.strerror or error}") from error
    except (zipfile.BadZipFile, KeyError, ValueError, TypeError, EOFError) as error:
        raise WarpmisError(f"{path}: is not a whole checkpoint of warpmis; remove it to begin anew") from error


def _packed(value: Any, arrays: list[NDArray[Any]]) -> Any:
    if isinstance(value, np.ndarray):
        arrays.append(value)
        return {"array": len(arrays) - 1}
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, dict):
        return {"dict": {str(name): _packed(item, arrays) for name, item in value.items()}}
    if isinstance(value, list | tuple):
        return {type(value).__name__: [_packed(item, arrays) for item in value]}
    if value is None or isinstance(value, bool | int | float | str):
        return value
    raise TypeError(f"a bundle holds no {type(value).__name__}")


def _unpacked(value: Any, array: Any) -> Any:
    if not isinstance(value, dict):
        return value
    ((kind, content),) = value.items()
    if kind == "array":
        return array(content)
    if kind == "dict":
        return {name: _unpacked(item, array) for name, item in content.items()}
    items = [_unpacked(item, array) for item in content]
    return tuple(items) if kind == "tuple" else items
