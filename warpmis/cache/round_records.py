"""What the paths of one round record at their vertices, on the device and as plain arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpmis.device.cache_views import CacheView, VertexRecord

# Most vertices that a round records, at 64 bytes each, and most of one path.
MOST_VERTICES = 1_000_000
RECORDED_VERTICES = 8


class RoundRecords:
    """The vertices of a round's paths, `vertices` a path, in some of the pixels.

    Attributes:
        stride: the first pixel of each cell of so many by so many is recorded.
        records: VertexRecord of each vertex, used or not; ratios: p_s / p_a of each strategy, `strategies` a record.
    """

    def __init__(self, stride: int, vertices: int, paths: int, strategies: int, device: str) -> None:
        self.stride, self.vertices, self.strategies = stride, vertices, strategies
        self.records = wp.zeros(paths * vertices, dtype=VertexRecord, device=device)
        self.ratios = wp.zeros(paths * vertices * strategies, dtype=wp.float32, device=device)

    def show_to(self, view: CacheView) -> None:
        """Let kernels record into these."""
        view.records, view.ratios = self.records, self.ratios
        view.record_stride, view.vertices = self.stride, self.vertices

    def table(self) -> NDArray[Any]:
        """A row a record, a field a column; on a CPU the device's own memory."""
        table: NDArray[Any] = self.records.numpy()
        return table

    def rows_of_ratios(self) -> NDArray[np.float32]:
        """A row a record; on a CPU the device's own memory."""
        rows: NDArray[np.float32] = self.ratios.numpy().reshape(-1, self.strategies)
        return rows

    def take(self) -> tuple[NDArray[Any], ...]:
        """Places, bytes and ratios of what is recorded; it is then forgotten."""
        table = self.table()
        places = np.flatnonzero(table["used"] != 0)
        taken = places, table[places].view(np.uint8), self.rows_of_ratios()[places]
        self.records.zero_()
        self.ratios.zero_()
        return taken

    def put(self, taken: tuple[NDArray[Any], ...]) -> None:
        """What `take` has brought from another process."""
        places, content, ratios = taken
        table, rows = self.table(), self.rows_of_ratios()
        table[places] = content.view(table.dtype).reshape(places.shape)
        rows[places] = ratios
        if self.records.device.is_cuda:
            self.records.assign(table)
            self.ratios.assign(rows.ravel())

    def state(self) -> dict[str, NDArray[Any]]:
        """As plain arrays."""
        return {"records": self.table().view(np.uint8), "ratios": self.ratios.numpy()}

    def resume(self, state: dict[str, NDArray[Any]]) -> None:
        self.records.assign(state["records"].view(self.table().dtype).reshape(self.records.shape))
        self.ratios.assign(state["ratios"])
