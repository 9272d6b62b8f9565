"""Materials, their lookups and the texels of their pictures as the records that kernels read."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpmis.device.albedo import albedo_table
from warpmis.device.texel_views import BLACK, CLAMP, MIRRORED, REPEAT, TileView
from warpmis.device.texels import TexelTable, needed_channels, tiles_of
from warpmis.device.views import (
    COAT,
    COAT_ROUGHNESS,
    CONSTANT,
    DIFFUSE,
    EMISSIVE,
    METALLIC,
    NO_TILE,
    NORMAL,
    OPACITY,
    RGB,
    ROUGHNESS,
    SPECULAR,
    InputsView,
    LookupView,
    MaterialView,
    SceneView,
    VaryingView,
)
from warpmis.scene import Material, Scene
from warpmis.scene.texture import FIRST_TILE, Lookup, PrimvarLookup, Texture, TextureLookup, byte_values

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
        texels: where pictures stand; inputs, lookups, tiles: records.
        first_tiles: first row in `tiles` of each texture, by its identity.
    """

    texels: TexelTable
    materials: list[MaterialView] = field(default_factory=list)
    inputs: list[InputsView] = field(default_factory=list)
    lookups: list[LookupView] = field(default_factory=list)
    tiles: list[TileView] = field(default_factory=list)
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
            textures = [lookup.texture for name in names if isinstance(lookup := lookups[name], TextureLookup)]
            for pictures in tiles_of(textures):
                self.texels.add(pictures)
            for name in names:
                if name == "normal":
                    view.normal_lookup = len(self.lookups)
                self.lookups.append(self._lookup(lookups[name], INPUTS[name][1]))
                self.lookups[-1].reuses_footprint = name != names[0]
        view.lookup_count = len(self.lookups) - view.first_lookup
        view.opacity_threshold = material.opacity_threshold
        view.use_specular_workflow = material.use_specular_workflow
        return view

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
                self.tiles.append(TileView() if pixels is None else self.texels.view(pixels, texture.is_srgb))
        return self.first_tiles[id(texture)], rows


def material_tables(scene: Scene) -> MaterialTables:
    materials = scene.materials or (Material(),)
    lookups = [lookup for material in materials for lookup in material.lookups.values()]
    needed = needed_channels(lookup for lookup in lookups if isinstance(lookup, TextureLookup))
    tables = MaterialTables(TexelTable(needed))
    for material in materials:
        tables.add(material)
    return tables


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
        texels: those of tables.texels, on the device.
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
