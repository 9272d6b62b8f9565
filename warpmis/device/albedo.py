"""The directional albedo of a GGX lobe, as a table: scripts/make_albedo_table.py computes it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

ALBEDO_FILE = Path(__file__).with_name("albedo.npy")
ROWS, COLUMNS = 48, 128


def roughnesses() -> NDArray[np.float64]:
    """Of the table's rows: dense where lobes are sharp."""
    return (np.arange(ROWS) / (ROWS - 1)) ** 2


def cosines() -> NDArray[np.float64]:
    """Between the direction of view and the normal, of the table's columns: dense where they graze."""
    return (np.arange(COLUMNS) / (COLUMNS - 1)) ** 2


def albedo_table() -> NDArray[np.float32]:
    """Shape (ROWS, COLUMNS, 2): (E, B) of each roughness and cosine. With Schlick's Fresnel term a lobe reflects
    F0 (E - B) + F90 B. Reference: Karis (2013), "Real Shading in Unreal Engine 4", "Environment BRDF"."""
    table: NDArray[np.float32] = np.load(ALBEDO_FILE)
    return table
