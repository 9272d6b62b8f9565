"""Write warpmis/device/albedo.npy: what a GGX lobe reflects in all, by roughness and by the angle of view.

python scripts/make_albedo_table.py
"""

import numpy as np
from numpy.typing import NDArray

from warpmis.device.albedo import ALBEDO_FILE, cosines, roughnesses

SIDE = 320


def lobe_albedo(roughness: float, cos_o: float, side: int = SIDE) -> tuple[float, float]:
    """(E, B): all that a lobe with Fresnel term 1 reflects, and what one with (1 - wo . h)^5 does.

    Mean over visible normals (Dupuy and Benyoub 2023), at side x side midpoints, of G1(wi) times the term: what
    drawing a visible normal leaves of the lobe. Mirrored at the plane of incidence, so half a turn is enough.
    """
    if roughness == 0.0:
        return 1.0, (1.0 - cos_o) ** 5
    alpha = roughness**2
    u = (np.arange(side) + 0.5) / side
    phi, v = np.meshgrid(np.pi * u, u, indexing="ij")
    wo = np.array([np.sqrt(1.0 - cos_o**2), 0.0, cos_o])
    stretched = wo * [alpha, alpha, 1.0]
    stretched /= np.linalg.norm(stretched)
    z = (1.0 - v) * (1.0 + stretched[2]) - stretched[2]
    sine = np.sqrt(1.0 - z**2)
    h = np.stack([sine * np.cos(phi), sine * np.sin(phi), z], axis=-1) + stretched
    h *= [alpha, alpha, 1.0]
    h /= np.linalg.norm(h, axis=-1, keepdims=True)
    facing = h @ wo
    cos_i = 2.0 * facing * h[..., 2] - cos_o
    tan2 = (1.0 - cos_i**2) / np.maximum(cos_i, 1e-10) ** 2
    g1 = np.where(cos_i > 0.0, 2.0 / (1.0 + np.sqrt(1.0 + alpha**2 * np.maximum(tan2, 0.0))), 0.0)
    return float(g1.mean()), float((g1 * np.clip(1.0 - facing, 0.0, 1.0) ** 5).mean())


def albedo_table() -> NDArray[np.float32]:
    rows = [[lobe_albedo(roughness, max(cos_o, 1e-5)) for cos_o in cosines()] for roughness in roughnesses()]
    return np.array(rows, dtype=np.float32)


if __name__ == "__main__":
    np.save(ALBEDO_FILE, albedo_table())
