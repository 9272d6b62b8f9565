"""What the camera sees, by camera rays alone, once the picture is there: ids, coverage, and AOVs of surfaces."""

from __future__ import annotations

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpmis.output.cryptomatte import Coverage
from warpmis.rendering.coverage import find_coverage
from warpmis.rendering.integrator import Integrator
from warpmis.rendering.kernel_choice import coverage_of, identify_of, locate_of
from warpmis.rendering.surface_aovs import places_of, surface_aovs
from warpmis.scene import Scene


def seen_ids(integrator: Integrator) -> NDArray[np.int32] | None:
    """Prim, place and face that the middle of each pixel sees, shape (H, W, 3), -1 where there is no surface; None
    where nobody asked for them."""
    found = []
    for kernel in identify_of(integrator.features, integrator.config):
        ids = wp.empty(integrator.pixels, dtype=wp.vec3i, device=integrator.config.device)
        _run(integrator, kernel, [ids])
        found.append(ids.numpy().reshape(integrator.height, integrator.width, 3).copy())
    return found[0] if found else None


def seen_coverage(integrator: Integrator, scene: Scene) -> tuple[Coverage, ...]:
    """Which prims and materials cover each pixel; empty where nobody asked for that."""
    for kernel in coverage_of(integrator.features, integrator.config):
        integrator.compiler.wait([kernel])
        return find_coverage(kernel, integrator.launcher, integrator.scene, scene, integrator.config)
    return ()


def seen_surfaces(integrator: Integrator, scene: Scene) -> dict[str, NDArray[np.float32]]:
    """The AOVs of surfaces that were asked for."""
    found: dict[str, NDArray[np.float32]] = {}
    for kernel in locate_of(integrator.features, integrator.config):
        device = integrator.config.device
        rows = wp.empty(integrator.pixels, dtype=wp.vec2i, device=device)
        weights = wp.empty(integrator.pixels, dtype=wp.vec2, device=device)
        _run(integrator, kernel, [rows, weights])
        places = places_of(scene, rows.numpy(), weights.numpy())
        found = surface_aovs(integrator.config.aov, scene, places)
    return found


def _run(integrator: Integrator, kernel: wp.Kernel, outputs: list[wp.array]) -> None:
    integrator.compiler.wait([kernel])
    inputs = [integrator.scene.view, integrator.scene.camera, *outputs]
    integrator.launcher.run_over(kernel, integrator.pixels, inputs)
