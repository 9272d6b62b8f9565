"""Arrays of structs, filled a column at a time."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

# Structs of one type in a row, a field a column.
Records = NDArray[Any]


def blank(dtype: Any, count: int) -> Records:
    """So many structs of zeros, in their own memory layout."""
    return np.zeros(count, dtype=dtype.numpy_dtype())


def records(dtype: Any, columns: dict[str, Any], count: int) -> wp.array:
    """An array of structs from one column a field."""
    table = blank(dtype, count)
    for name, column in columns.items():
        table[name] = column
    return wp.array(table, dtype=dtype)
