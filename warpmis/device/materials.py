"""Materials, their lookups and the texels of their pictures as the records that kernels read."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpmis.device.views import (
    BLACK,
    BLOCK,
    BYTES,
    CLAMP,
    COAT,
    COAT_ROUGHNESS,
    DIFFUSE,
    EMISSIVE,
    FLOATS,
    METALLIC,
    MIRRORED,
    NORMAL,
    OPACITY,
    REPEAT,
    RGB,
    ROUGHNESS,
    SPECULAR,
    SRGB_BYTES,
    InputsView,
    LookupView,
    MaterialView,
    SceneView,
    TileView,
    VaryingView,
)
from warpmis.scene import Material, Scene
from warpmis.texture import FIRST_TILE, Lookup, PrimvarLookup, Texture, TextureLookup, byte_values, channel_of

WRAP_MODES = {"black": BLACK, "clamp": CLAMP, "repeat": REPEAT, "mirror": MIRRORED}
UDIM_COLUMNS = 10

# Field of scene.Material -> field of InputsView and the number by which a lookup knows it.
INPUTS = {
    "diffuse_color": ("diffuse", DIFFUSE),
    "emissive_color": ("emissive", EMISSIVE),
    "specular_color": ("specular", SPECULAR),
    "metallic": ("metallic", METALLIC),
    "roughness": ("roughness", ROUGHNESS),
    "clearcoat": ("coat", COAT),
    "clearcoat_roughness": ("coat_roughness", COAT_ROUGHNESS),
    "opacity": ("opacity", OPACITY),
}


@dataclass(eq=False)
class MaterialTables:
    """The materials of a scene, ready to upload; a picture's texels stand once, whoever looks them up.

    Attributes:
        inputs, lookups, tiles: records; texels: the pictures in tiles, flat, `words` in all.
        placed: first word of each picture that is in already, by the array's identity.
        first_tiles: first row in `tiles` of each texture, by its identity.
    """

    materials: list[MaterialView] = field(default_factory=list)
    inputs: list[InputsView] = field(default_factory=list)
    lookups: list[LookupView] = field(default_factory=list)
    tiles: list[TileView] = field(default_factory=list)
    texels: list[NDArray[np.uint32]] = field(default_factory=list)
    words: int = 0
    placed: dict[int, int] = field(default_factory=dict)
    first_tiles: dict[int, int] = field(default_factory=dict)

    def add(self, material: Material) -> None:
        """Two records a material: for a surface that emits from its front alone, and for a double-sided one."""
        row = -1
        if material.lookups:
            row = len(self.inputs)
            self.inputs.append(self._inputs(material))
        self.materials += [material_view(material.mean, side, row) for side in (0, 1)]

    def _inputs(self, material: Material) -> InputsView:
        view = InputsView()
        constant = material.mean
        view.first_lookup = len(self.lookups)
        for name, (attribute, _) in INPUTS.items():
            setattr(view, attribute, getattr(constant, name))
        lookups = material.lookups
        looked_up = [(lookups[name], number) for name, (_, number) in INPUTS.items() if name in lookups]
        # What looks up the same texels stands side by side, so that they are fetched once.
        kinds = [any_channel(lookup) for lookup, _ in looked_up]
        order = sorted(range(len(looked_up)), key=lambda place: kinds.index(kinds[place]))
        for before, place in zip([-1, *order], order, strict=False):
            self.lookups.append(self._lookup(*looked_up[place]))
            self.lookups[-1].repeats = int(before >= 0 and kinds[before] == kinds[place])
        view.lookup_count = len(self.lookups) - view.first_lookup
        view.normal_lookup = -1
        if material.normal is not None:
            view.normal_lookup = len(self.lookups)
            self.lookups.append(self._lookup(material.normal, NORMAL))
        view.opacity_threshold = material.opacity_threshold
        view.use_specular_workflow = int(material.use_specular_workflow)
        return view

    def _lookup(self, lookup: Lookup, number: int) -> LookupView:
        view = LookupView()
        view.input = number
        view.column = lookup.column
        view.tile = -1
        view.channel = RGB if number in (DIFFUSE, EMISSIVE, SPECULAR) else 0
        if not isinstance(lookup, PrimvarLookup):
            view.tile, view.udim_rows = self._tiles(lookup.texture)
            view.row_s, view.row_t = lookup.transform
            view.wrap_s = CLAMP if lookup.texture.is_udim else WRAP_MODES[lookup.wrap_s]
            view.wrap_t = CLAMP if lookup.texture.is_udim else WRAP_MODES[lookup.wrap_t]
            view.channel = RGB if lookup.channels == "rgb" else "rgba".index(lookup.channels)
            view.scale, view.bias, view.fallback = lookup.scale, lookup.bias, lookup.fallback
        return view

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
        view.blocks = -(-view.columns // BLOCK)
        is_byte = pixels.dtype == np.uint8
        view.encoding = (SRGB_BYTES if is_srgb else BYTES) if is_byte else FLOATS
        if id(pixels) not in self.placed:
            self.placed[id(pixels)] = self.words
            self.texels.append(in_blocks(byte_words(pixels) if is_byte else pixels.view(np.uint32)))
            self.words += len(self.texels[-1])
        view.first = self.placed[id(pixels)]
        return view


def material_tables(scene: Scene) -> MaterialTables:
    tables = MaterialTables()
    for material in scene.materials or (Material(),):
        tables.add(material)
    return tables


def byte_words(pixels: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """Texels of 1 to 4 bytes as red, green, blue and alpha in one word, red lowest, shape (rows, columns, 1)."""
    places = [channel_of(channel, pixels.shape[-1]) for channel in range(4)]
    words = np.full(pixels.shape[:2], 255 << 24 if places[3] < 0 else 0, np.uint32)
    for channel, place in enumerate(places):
        if place >= 0:
            words |= pixels[..., place].astype(np.uint32) << np.uint32(8 * channel)
    return words[..., None]


def in_blocks(texels: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Words of texels, shape (rows, columns, words), block by block, shape (n,); blocks at the edges are filled up."""
    rows, columns, words = texels.shape
    texels = np.pad(texels, ((0, -rows % BLOCK), (0, -columns % BLOCK), (0, 0)))
    blocks = texels.reshape(-1, BLOCK, texels.shape[1] // BLOCK, BLOCK, words)
    return blocks.swapaxes(1, 2).ravel()


def any_channel(lookup: Lookup) -> Lookup:
    """What is equal of lookups that read the same texels."""
    return replace(lookup, channels="rgb") if isinstance(lookup, TextureLookup) else lookup


def upload_materials(view: SceneView, tables: MaterialTables, primvars: NDArray[np.float32]) -> VaryingView | None:
    """The materials into the view; what varies over surfaces is returned, to be kept alive."""
    view.materials = wp.array(tables.materials, dtype=MaterialView)
    if not tables.inputs:
        return None
    varying = VaryingView()
    varying.inputs = wp.array(tables.inputs, dtype=InputsView)
    varying.lookups = wp.array(tables.lookups, dtype=LookupView)
    varying.tiles = wp.array(tables.tiles, dtype=TileView)
    varying.texels = wp.array(np.concatenate([np.zeros(0, np.uint32), *tables.texels]), dtype=wp.uint32)
    varying.byte_values = wp.array(np.concatenate([byte_values(False), byte_values(True)]), dtype=float)
    varying.primvars = wp.array(primvars, dtype=float)
    view.varying = wp.array([varying], dtype=VaryingView)
    return varying


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
