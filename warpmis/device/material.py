"""Materials, their lookups and the texels of their pictures as the records that kernels read."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpmis.device.albedo import albedo_table
from warpmis.device.views import (
    BLACK,
    BLOCK,
    BYTES,
    CLAMP,
    COAT,
    COAT_ROUGHNESS,
    CONSTANT,
    DIFFUSE,
    EMISSIVE,
    FLOATS,
    METALLIC,
    MIRRORED,
    NO_TILE,
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
from warpmis.scene.texture import FIRST_TILE, Lookup, PrimvarLookup, Texture, TextureLookup, byte_values, channel_of

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
    "normal": ("normal", NORMAL),
}


@dataclass(eq=False)
class MaterialTables:
    """The materials of a scene, ready to upload; a picture's texels stand once, whoever looks them up.

    Attributes:
        inputs, lookups, tiles: records; stacks: the pictures in tiles, those together that stand texel by texel
            side by side; words: how many words all of these take.
        placed: first word of each picture that is in already, and words from texel to texel, by the array's identity.
        first_tiles: first row in `tiles` of each texture, by its identity.
    """

    materials: list[MaterialView] = field(default_factory=list)
    inputs: list[InputsView] = field(default_factory=list)
    lookups: list[LookupView] = field(default_factory=list)
    tiles: list[TileView] = field(default_factory=list)
    stacks: list[list[NDArray[Any]]] = field(default_factory=list)
    words: int = 0
    placed: dict[int, tuple[int, int]] = field(default_factory=dict)
    first_tiles: dict[int, int] = field(default_factory=dict)

    def add(self, material: Material) -> None:
        """Two records a material: for a surface that emits from its front alone, and for a double-sided one."""
        row = CONSTANT
        if material.lookups:
            row = len(self.inputs)
            self.inputs.append(self._inputs(material))
        self.materials += [material_view(material.mean, side, row) for side in (False, True)]

    def _inputs(self, material: Material) -> InputsView:
        view = InputsView()
        view.first_lookup = len(self.lookups)
        lookups = material.lookups
        groups: dict[Any, list[str]] = {}
        for name, (attribute, _) in INPUTS.items():
            if name in lookups:
                groups.setdefault(place_of(lookups[name]), []).append(name)
            elif name != "normal":
                setattr(view, attribute, getattr(material, name))
        for names in groups.values():
            self._stack([lookup.texture for name in names if isinstance(lookup := lookups[name], TextureLookup)])
            for name in names:
                if name == "normal":
                    view.normal_lookup = len(self.lookups)
                self.lookups.append(self._lookup(lookups[name], INPUTS[name][1]))
                self.lookups[-1].reuses_footprint = name != names[0]
        view.lookup_count = len(self.lookups) - view.first_lookup
        view.opacity_threshold = material.opacity_threshold
        view.use_specular_workflow = material.use_specular_workflow
        return view

    def _stack(self, textures: list[Texture]) -> None:
        """Pictures of the same size, looked up at the same places, into the texels: all words of a texel side by side.

        What one hit reads is then in a few lines of the cache. A picture that is in already stays where it is.
        """
        for number in textures[0].tiles if textures else ():
            pictures = {id(texture.tiles[number]): texture.tiles[number] for texture in textures}
            stack = [pixels for key, pixels in pictures.items() if key not in self.placed]
            stride = sum(map(words_in_texel, stack))
            first = self.words
            for pixels in stack:
                self.placed[id(pixels)] = first, stride
                first += words_in_texel(pixels)
            if stack:
                rows, columns = (-(-side // BLOCK) * BLOCK for side in stack[0].shape[:2])
                self.stacks.append(stack)
                self.words += rows * columns * stride

    def _lookup(self, lookup: Lookup, number: int) -> LookupView:
        view = LookupView()
        view.input = number
        view.column = lookup.column
        view.tile = NO_TILE
        view.channel = RGB if number in (DIFFUSE, EMISSIVE, SPECULAR, NORMAL) else 0
        if not isinstance(lookup, PrimvarLookup):
            view.tile, view.udim_rows = self._tiles(lookup.texture)
            view.row_s, view.row_t = lookup.transform
            view.wrap_s = CLAMP if lookup.texture.is_udim else WRAP_MODES[lookup.wrap_s]
            view.wrap_t = CLAMP if lookup.texture.is_udim else WRAP_MODES[lookup.wrap_t]
            view.channel = RGB if lookup.channels == "rgb" else "rgba".index(lookup.channels)
            components = slice(3) if view.channel == RGB else [view.channel] * 3
            for name in ("scale", "bias", "fallback"):
                setattr(view, name, tuple(np.array(getattr(lookup, name))[components]))
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
        view.encoding = (SRGB_BYTES if is_srgb else BYTES) if pixels.dtype == np.uint8 else FLOATS
        view.first, view.stride = self.placed[id(pixels)]
        return view


def material_tables(scene: Scene) -> MaterialTables:
    tables = MaterialTables()
    for material in scene.materials or (Material(),):
        tables.add(material)
    return tables


def words_in_texel(pixels: NDArray[Any]) -> int:
    return 1 if pixels.dtype == np.uint8 else pixels.shape[-1]


def texels_of(stacks: list[list[NDArray[Any]]]) -> NDArray[np.uint32]:
    """The words of all pictures as the kernels read them, shape (n,)."""
    words = [in_blocks(np.concatenate([words_of(pixels) for pixels in stack], axis=-1)) for stack in stacks]
    return np.concatenate([np.zeros(0, np.uint32), *words])


def words_of(pixels: NDArray[Any]) -> NDArray[np.uint32]:
    """A picture's texels, shape (rows, columns, words)."""
    return byte_words(pixels) if pixels.dtype == np.uint8 else pixels.view(np.uint32)


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


def place_of(lookup: Lookup) -> Any:
    """What is equal of lookups that look at the same place in pictures of the same size."""
    if isinstance(lookup, PrimvarLookup):
        return lookup
    sizes = tuple(sorted((number, pixels.shape[:2]) for number, pixels in lookup.texture.tiles.items()))
    return lookup.column, lookup.transform, lookup.wrap_s, lookup.wrap_t, sizes, lookup.texture.is_udim


def upload_materials(
    view: SceneView,
    tables: MaterialTables,
    texels: Any,
    primvars: NDArray[np.float32],
    places: NDArray[np.float32],
) -> VaryingView | None:
    """The materials into the view; what varies over surfaces is returned, to be kept alive.

    Args:
        texels: those of tables.stacks, on the device.
        primvars: of the triangles, shape (F, 3, P); places: of the instances, shape (K, P), or (0, P) for none.
    """
    view.materials = wp.array(tables.materials, dtype=MaterialView)
    view.albedos = wp.array(albedo_table(), dtype=wp.vec2)
    if not tables.inputs:
        return None
    varying = VaryingView()
    varying.inputs = wp.array(tables.inputs, dtype=InputsView)
    varying.lookups = wp.array(tables.lookups, dtype=LookupView)
    varying.tiles = wp.array(tables.tiles, dtype=TileView)
    varying.texels = texels
    varying.byte_values = wp.array(np.concatenate([byte_values(False), byte_values(True)]), dtype=float)
    of_places = np.repeat(places[:, None], 3, axis=1)
    varying.primvars = wp.array(np.concatenate([primvars, of_places]) if len(places) else primvars, dtype=float)
    varying.first_place = len(primvars)
    view.varying = wp.array([varying], dtype=VaryingView)
    return varying


def material_view(material: Any, double_sided: bool, inputs: int) -> MaterialView:
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
    view.has_specular = not material.lambertian
    view.diffuse, view.specular_f0, view.emission = tuple(diffuse), tuple(f0), material.mean_emission
    # Alpha 0 would divide by 0; below SMOOTH_ALPHA a lobe is a mirror whatever its alpha.
    view.alpha = max(material.roughness**2, 1e-6)
    view.coat_f0, view.coat_alpha = reflectance, max(material.clearcoat_roughness**2, 1e-6)
    view.opacity = material.opacity
    view.opacity_is_presence = material.lambertian or material.opacity_mode == "presence"
    view.transmission, view.ior, view.thin_walled = material.transmission, material.ior, material.thin_walled
    has_depth = material.transmission_depth > 0.0 and not material.thin_walled
    view.tint = (1.0, 1.0, 1.0) if has_depth else material.transmission_color
    if has_depth:
        view.absorption = tuple(-np.log(np.maximum(material.transmission_color, 1e-6)) / material.transmission_depth)
    view.double_sided = double_sided
    view.inputs = inputs
    return view
