"""Materials, their lookups and the texels of their pictures as the records that kernels read."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpmis.device.views import (
    BLACK,
    BYTES,
    CLAMP,
    FLOATS,
    MIRRORED,
    REPEAT,
    RGB,
    SRGB_BYTES,
    InputsView,
    LookupView,
    MaterialView,
    SceneView,
    TileView,
)
from warpmis.scene import Material, Scene
from warpmis.texture import FIRST_TILE, Lookup, PrimvarLookup, Texture, byte_values

WRAP_MODES = {"black": BLACK, "clamp": CLAMP, "repeat": REPEAT, "mirror": MIRRORED}
UDIM_COLUMNS = 10

# Field of scene.Material -> field of InputsView, whose lookup is the field `<name>_lookup`.
INPUTS = {
    "diffuse_color": "diffuse",
    "emissive_color": "emissive",
    "specular_color": "specular",
    "metallic": "metallic",
    "roughness": "roughness",
    "clearcoat": "coat",
    "clearcoat_roughness": "coat_roughness",
    "opacity": "opacity",
}


@dataclass(eq=False)
class MaterialTables:
    """The materials of a scene, ready to upload; a picture's texels stand once, whoever looks them up.

    Attributes:
        inputs, lookups, tiles: records; byte_texels, float_texels: the pictures in tiles, flat.
        placed: first and encoding of each picture's texels that are in already, by the array's identity.
        first_tiles: first row in `tiles` of each texture, by its identity.
    """

    materials: list[MaterialView] = field(default_factory=list)
    inputs: list[InputsView] = field(default_factory=list)
    lookups: list[LookupView] = field(default_factory=list)
    tiles: list[TileView] = field(default_factory=list)
    byte_texels: list[NDArray[np.uint8]] = field(default_factory=list)
    float_texels: list[NDArray[np.float32]] = field(default_factory=list)
    placed: dict[int, int] = field(default_factory=dict)
    first_tiles: dict[int, int] = field(default_factory=dict)

    def add(self, material: Material) -> None:
        """Two records a material: for a surface that emits from its front alone, and for a double-sided one."""
        row = -1
        if material.lookups:
            row = len(self.inputs)
            self.inputs.append(self._inputs(material))
        self.materials += [material_view(material.mean(), side, row) for side in (0, 1)]

    def _inputs(self, material: Material) -> InputsView:
        view = InputsView()
        constant = material.mean()
        for name, attribute in INPUTS.items():
            setattr(view, attribute, getattr(constant, name))
            setattr(view, f"{attribute}_lookup", self._lookup(material.lookups.get(name)))
        view.normal_lookup = self._lookup(material.normal)
        view.opacity_threshold = material.opacity_threshold
        view.use_specular_workflow = int(material.use_specular_workflow)
        return view

    def _lookup(self, lookup: Lookup | None) -> int:
        if lookup is None:
            return -1
        view = LookupView()
        view.column = lookup.column
        view.tile = -1
        if not isinstance(lookup, PrimvarLookup):
            view.tile, view.udim_rows = self._tiles(lookup.texture)
            view.row_s, view.row_t = lookup.transform
            view.wrap_s = CLAMP if lookup.texture.is_udim else WRAP_MODES[lookup.wrap_s]
            view.wrap_t = CLAMP if lookup.texture.is_udim else WRAP_MODES[lookup.wrap_t]
            view.channel = RGB if lookup.channels == "rgb" else "rgba".index(lookup.channels)
            view.scale, view.bias, view.fallback = lookup.scale, lookup.bias, lookup.fallback
        self.lookups.append(view)
        return len(self.lookups) - 1

    def _tiles(self, texture: Texture) -> tuple[int, int]:
        """First tile of a texture, and its rows of ten tiles, 0 for a picture that is no UDIM one."""
        rows = (max(texture.tiles) - FIRST_TILE) // UDIM_COLUMNS + 1 if texture.is_udim else 0
        if id(texture) not in self.first_tiles:
            self.first_tiles[id(texture)] = len(self.tiles)
            for number in range(FIRST_TILE, FIRST_TILE + (rows * UDIM_COLUMNS or 1)):
                pixels = texture.tiles.get(number)
                self.tiles.append(TileView() if pixels is None else self._tile(pixels, texture.is_srgb))
        return self.first_tiles[id(texture)], rows

    def _tile(self, pixels: NDArray[Any], is_srgb: bool) -> TileView:
        view = TileView()
        view.rows, view.columns, view.channels = pixels.shape
        is_byte = pixels.dtype == np.uint8
        view.encoding = (SRGB_BYTES if is_srgb else BYTES) if is_byte else FLOATS
        if id(pixels) not in self.placed:
            texels: list[Any] = self.byte_texels if is_byte else self.float_texels
            self.placed[id(pixels)] = sum(len(flat) for flat in texels)
            texels.append(pixels.ravel())
        view.first = self.placed[id(pixels)]
        return view


def material_tables(scene: Scene) -> MaterialTables:
    tables = MaterialTables()
    for material in scene.materials or (Material(),):
        tables.add(material)
    return tables


def upload_materials(view: SceneView, tables: MaterialTables) -> None:
    view.materials = wp.array(tables.materials, dtype=MaterialView)
    if not tables.inputs:
        return
    view.inputs = wp.array(tables.inputs, dtype=InputsView)
    view.lookups = wp.array(tables.lookups, dtype=LookupView)
    view.tiles = wp.array(tables.tiles, dtype=TileView)
    view.byte_values = wp.array(np.concatenate([byte_values(False), byte_values(True)]), dtype=float)
    view.bytes = wp.array(np.concatenate([np.zeros(0, np.uint8), *tables.byte_texels]), dtype=wp.uint8)
    view.floats = wp.array(np.concatenate([np.zeros(0, np.float32), *tables.float_texels]), dtype=float)


def material_view(material: Any, double_sided: int, inputs: int) -> MaterialView:
    """Resolve the workflow of a Material of constant inputs, as kernels/material.py does of others.

    Reference: UsdPreviewSurface specification, "Specular and metallic workflows".
    """
    view = MaterialView()
    diffuse = np.array(material.diffuse_color)
    reflectance = ((1.0 - material.ior) / (1.0 + material.ior)) ** 2
    f0 = np.zeros(3)
    if not material.lambertian:
        if material.use_specular_workflow:
            f0 = np.array(material.specular_color)
        else:
            f0 = reflectance * (1.0 - material.metallic) + diffuse * material.metallic
            diffuse = diffuse * (1.0 - material.metallic)
        view.coat = material.clearcoat
    view.has_specular = int(not material.lambertian)
    view.diffuse, view.specular_f0, view.emission = tuple(diffuse), tuple(f0), material.mean_emission
    # Alpha 0 would divide by 0; below features.SMOOTH_ALPHA a lobe is a mirror whatever its alpha.
    view.alpha = max(material.roughness**2, 1e-6)
    view.coat_f0, view.coat_alpha = reflectance, max(material.clearcoat_roughness**2, 1e-6)
    view.opacity = material.opacity
    view.presence = int(material.lambertian or material.opacity_mode == "presence")
    view.double_sided = double_sided
    view.inputs = inputs
    return view
