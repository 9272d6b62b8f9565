"""MaterialX surfaces that a stage holds as UsdShade nodes: each as the Material that is nearest to it.

What a Material lacks is left out with a warning.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from pxr import UsdShade

from warpmis.scene import Material
from warpmis.usd.materials.bsdf_nodes import BsdfReader
from warpmis.usd.materials.layered_surface import LayeredSurface, SurfaceInputs, material_of
from warpmis.usd.materials.materialx_network import MaterialXNetwork
from warpmis.usd.materials.preview_surface import read_preview_surface
from warpmis.usd.materials.surface_shaders import gltf_pbr, open_pbr, standard_surface, unlit

PREVIEW_SURFACE = "ND_UsdPreviewSurface_surfaceshader"
SURFACES: dict[str, Callable[[SurfaceInputs], LayeredSurface]] = {
    "ND_standard_surface_surfaceshader": standard_surface,
    "ND_open_pbr_surface_surfaceshader": open_pbr,
    "ND_gltf_pbr_surfaceshader": gltf_pbr,
    "ND_surface_unlit": unlit,
}
OF_NODES = "ND_surface"


def is_materialx(kind: str) -> bool:
    """Whether `read_materialx` knows the surface shader."""
    return unversioned(kind) in (*SURFACES, PREVIEW_SURFACE, OF_NODES)


def unversioned(kind: str) -> str:
    """A node definition's name without its version, such as _100."""
    return re.sub(r"(_\d+)+$", "", kind)


def read_materialx(shader: Any, network: MaterialXNetwork) -> Material:
    """The Material nearest to a MaterialX surface shader."""
    kind = unversioned(network.kind(shader))
    if kind == PREVIEW_SURFACE:
        return read_preview_surface(shader, network)
    inner = None if is_materialx(kind) else network.graphs.output(shader, network.kind(shader), "out")
    if inner is not None:
        return read_materialx(UsdShade.Shader(inner.GetPrim()), network)
    if kind == OF_NODES:
        return material_of(BsdfReader(network).surface(shader), network)
    return material_of(SURFACES[kind](SurfaceInputs(shader, network)), network)
