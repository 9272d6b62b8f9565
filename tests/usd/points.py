"""The material and the shading normal at points of a loaded scene, as a ray that falls on them finds them."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpmis.device.upload import upload
from warpmis.device.views import MaterialView, SceneView
from warpmis.kernels.intersect import make_intersect
from warpmis.kernels.material import make_material
from warpmis.scene import Scene
from warpmis.scene.features import Features

materials = make_material(Features.all())
intersect = make_intersect(Features.all())


@wp.kernel(enable_backward=False)
def look(
    scene: SceneView,
    origins: wp.array(dtype=wp.vec3),
    wi: wp.vec3,
    found: wp.array(dtype=MaterialView),
    normals: wp.array(dtype=wp.vec3),
):
    i = wp.tid()
    hit = intersect.closest_hit(scene, origins[i], wi)
    found[i] = materials.at(scene, hit.triangle, hit.instance, hit.u, hit.v)
    normals[i] = intersect.shading_frame(scene, hit, found[i], wi).n


def seen_at(scene: Scene, xy: Any, wi: tuple[float, float, float] = (0.0, 0.0, -1.0)) -> dict[str, NDArray[Any]]:
    """MaterialView's fields and the shading `normal` where rays along `wi` meet z = 0 in (x, y), shape (n, 2)."""
    targets = np.column_stack([np.asarray(xy, np.float64).reshape(-1, 2), np.zeros(np.asarray(xy).size // 2)])
    uploaded = upload(scene, "cpu")
    found = wp.zeros(len(targets), dtype=MaterialView, device="cpu")
    normals = wp.zeros(len(targets), dtype=wp.vec3, device="cpu")
    origins = wp.array(targets - np.array(wi), dtype=wp.vec3, device="cpu")
    wp.launch(look, dim=len(targets), inputs=[uploaded.view, origins, wi, found, normals], device="cpu")
    records = found.numpy()
    return {name: records[name].copy() for name in records.dtype.names} | {"normal": normals.numpy().copy()}
