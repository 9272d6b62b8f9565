"""Which prims and which materials cover each pixel, and how much of it: what Cryptomatte stores."""

from __future__ import annotations

import numpy as np
import warp as wp

from warpmis.config import RenderConfig
from warpmis.device.upload import DeviceScene
from warpmis.device.views import RoundView
from warpmis.kernels.coverage import NO_PRIM, SLOTS
from warpmis.output.cryptomatte import RANKS, Coverage, IdArray, ShareArray, id_of, ranked
from warpmis.rendering.generating_vector import lattice_length
from warpmis.rendering.launches import Launcher
from warpmis.rendering.round_view import set_lattice
from warpmis.scene import Scene

# Rays of a pixel: more tell nothing that an edge needs.
MOST_RAYS = 256
# Pixels whose surfaces are on the device at a time, which bounds the memory.
BAND = 1 << 18


def find_coverage(
    kernel: wp.Kernel, launcher: Launcher, device_scene: DeviceScene, scene: Scene, config: RenderConfig
) -> tuple[Coverage, ...]:
    """By rays through the pixels as the picture's samples have them."""
    rays = min(config.spp, MOST_RAYS)
    view = RoundView()
    view.first_sample, view.end_sample, view.seed = 0, rays, config.seed
    set_lattice(view, 0, lattice_length(rays))
    width, height = scene.resolution
    names = {
        "CryptoObject": [prim.path for prim in scene.prims],
        "CryptoMaterial": [material.path or "none" for material in scene.materials],
    }
    ids = {layer: np.array([id_of(name) for name in of_layer] or [0], np.uint32) for layer, of_layer in names.items()}
    found: dict[str, list[tuple[IdArray, ShareArray]]] = {layer: [] for layer in names}
    for begin in range(0, width * height, BAND):
        count = min(BAND, width * height - begin)
        surfaces = wp.empty((count, int(SLOTS)), dtype=wp.vec2i, device=config.device)
        shares = wp.empty((count, int(SLOTS)), dtype=float, device=config.device)
        launcher.run_over(kernel, count, [begin, device_scene.view, device_scene.camera, view, surfaces, shares])
        rows, weights = surfaces.numpy(), shares.numpy() / np.float32(rays)
        for column, layer in enumerate(names):
            of_slots = np.where(rows[..., 0] == int(NO_PRIM), np.uint32(0), ids[layer][rows[..., column]])
            found[layer].append(ranked(of_slots, weights))
    return tuple(
        Coverage(
            layer,
            tuple(names[layer]),
            np.concatenate([band[0] for band in bands]).reshape(height, width, RANKS),
            np.concatenate([band[1] for band in bands]).reshape(height, width, RANKS),
        )
        for layer, bands in found.items()
    )
