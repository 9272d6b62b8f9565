"""Arrays of structs, filled a column at a time."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp


def records(dtype: Any, columns: dict[str, Any], count: int) -> wp.array:
    """An array of structs from one column a field, through the struct's own memory layout."""
    table = np.zeros(count, dtype=dtype.numpy_dtype())
    for name, column in columns.items():
        table[name] = column
    return wp.array(table, dtype=dtype)
