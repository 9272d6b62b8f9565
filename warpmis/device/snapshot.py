"""What a device holds, as host arrays, and back: for a render's state, whatever fields its structs have."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

Arrays = dict[str, NDArray[Any]]


def device_arrays(value: Any, name: str = "") -> dict[str, wp.array]:
    """All arrays of a struct, of structs within it too, under the names of their fields; of an array itself."""
    if isinstance(value, wp.array):
        return {name: value}
    fields = value._cls.vars if hasattr(value, "_cls") else ()
    found: dict[str, wp.array] = {}
    for field in fields:
        found |= device_arrays(getattr(value, field), f"{name}.{field}" if name else field)
    return found


def snapshot(value: Any, rows: slice | None = None) -> Arrays:
    """The arrays' contents, or those of some rows; on a CPU they are views of the same memory."""
    arrays = device_arrays(value)
    return {name: (array if rows is None else array[rows]).numpy() for name, array in arrays.items() if array.size}


def restore(value: Any, saved: Arrays, rows: slice | None = None) -> None:
    """Copy a snapshot back into arrays of the same shapes."""
    for name, array in device_arrays(value).items():
        if array.size:
            target = array if rows is None else array[rows]
            target.assign(np.ascontiguousarray(saved[name]))
