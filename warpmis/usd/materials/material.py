"""Which material each triangle has: bindings and subsets, and displayColor where nothing is bound."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from pxr import UsdGeom, UsdShade

from warpmis.scene import Material
from warpmis.scene.texture import PrimvarLookup
from warpmis.usd.color_space import inherited_space
from warpmis.usd.materials.arnold import ArnoldNetwork, is_arnold, read_arnold
from warpmis.usd.materials.library_graphs import is_library_surface
from warpmis.usd.materials.materialx import is_materialx, read_materialx
from warpmis.usd.materials.materialx_network import MaterialXNetwork
from warpmis.usd.materials.mdl import is_mdl, mdl_name, read_mdl
from warpmis.usd.materials.omni_surface import is_omni_surface, read_omni_surface
from warpmis.usd.materials.pattern_network import PatternNetwork
from warpmis.usd.materials.preview_surface import clamped, read_preview_surface
from warpmis.usd.materials.renderman import RenderManNetwork, is_renderman, read_renderman
from warpmis.usd.materials.shading_network import ShadingNetwork
from warpmis.usd.materials.subsets import claim, material_subsets
from warpmis.usd.materials.texture import TextureReader
from warpmis.usd.reading import PxrError, Reading, one_line
from warpmis.usd.shapes.instance_primvars import Scopes, source_of_primvar
from warpmis.usd.shapes.primvar import PrimvarColumns, PrimvarRead, corner_primvars, primvar_elements
from warpmis.usd.shapes.surfaces import NO_PLACES, Shading, Surface

GREY = 0.18
# Render contexts of a material's surface, the first one for all renderers.
CONTEXTS = ("", "mtlx", "mdl", "arnold", "ri")


@dataclass(frozen=True, eq=False)
class BoundMaterial:
    """A material with the primvars that its lookups read."""

    material: Material
    columns: PrimvarColumns = field(default_factory=PrimvarColumns)


@dataclass(eq=False)
class MaterialReader:
    """Reads each material of the stage once, and numbers them as Scene.materials does.

    Attributes:
        purposes: of bindings, as Settings.material_purposes.
        materials: material -> its index, in the order of first use.
        equals: material without its path -> the index of the first that is equal to it.
        searched: paths of prims without a material whose bindings have been looked at.
        read: what the stage's materials were read as, by _key; None for one that is not supported.
    """

    reading: Reading
    purposes: tuple[str, ...] = ("full", "")
    materials: dict[Material, int] = field(default_factory=dict)
    equals: dict[Material, int] = field(default_factory=dict)
    read: dict[Any, BoundMaterial | None] = field(default_factory=dict)
    searched: set[Any] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.textures = TextureReader(self.reading)

    def index(self, material: Material) -> int:
        """The material's place in Scene.materials."""
        index = self.materials.setdefault(material, len(self.materials))
        self.equals.setdefault(replace(material, path=""), index)
        return index

    def shared_index(self, material: Material) -> int:
        """That of an equal material, whatever its path: native instances that bring one each share a surface."""
        known = self.equals.get(replace(material, path=""))
        return self.index(material) if known is None else known

    def of_surface(self, prim: Any, surface: Surface, scopes: Scopes) -> Shading:
        """Material of each triangle of a gprim, GeomSubsets of the family materialBind included, and its primvars.

        Args:
            scopes: as Placement.scopes.
        """
        found: list[BoundMaterial] = []
        count = int(surface.faces.max(initial=-1)) + 1
        if prim.IsA(UsdGeom.Mesh) and surface.carrier is not None:
            count = surface.carrier.elements["uniform"]
        by_face = np.full(count, -1)
        own = self._binding(prim)[0]
        for subset, indices in material_subsets(prim, self.reading):
            bound = self.bound(subset, "the mesh's own material")
            # A subset without a binding has that of the mesh, as any prim has that of its parent.
            if bound is not None and not (own and bound is self.read.get(_key(own, self.reading))):
                claim(by_face, indices, len(found), subset.GetPath(), self.reading)
                found.append(bound)
        by_triangle = by_face[surface.faces]
        if (by_triangle < 0).any():
            by_triangle = np.where(by_triangle < 0, len(found), by_triangle)
            found.append(self.bound(prim) or display_material(prim, surface, scopes, self.reading))
        columns = side_by_side(prim, [bound.columns for bound in found], scopes)
        index = self.shared_index if prim.IsInstanceProxy() else self.index
        shifted = [moved(bound.material, own.start) for bound, own in zip(found, columns, strict=True)]
        materials = np.array([index(material) for material in shifted], np.int64)
        if len(found) == 1:
            block, places = corner_primvars(prim, surface, found[0].columns, scopes, self.reading)
            return Shading(materials[by_triangle], block, places if scopes and np.isnan(block).any() else NO_PLACES)
        block = np.zeros((len(by_triangle), 3, max((own.stop for own in columns), default=0)), np.float32)
        places = np.zeros((len(scopes[0].instance) if scopes else 0, block.shape[-1]), np.float32)
        for number, (bound, own) in enumerate(zip(found, columns, strict=True)):
            rows = by_triangle == number
            if bound.columns.width and rows.any():
                corners, of_places = corner_primvars(prim, surface, bound.columns, scopes, self.reading)
                block[rows, :, own] = corners[rows]
                places[:, own] += of_places
        return Shading(materials[by_triangle], block, places if scopes and np.isnan(block).any() else NO_PLACES)

    def glows(self, prim: Any) -> bool:
        """Whether a material of a gprim, or of one of its subsets, emits light."""
        prims = [prim, *(subset for subset, _ in material_subsets(prim, self.reading))]
        return any(bound is not None and max(bound.material.mean_emission) > 0.0 for bound in map(self.bound, prims))

    def bound(self, prim: Any, otherwise: str = "displayColor") -> BoundMaterial | None:
        """The material bound to a gprim or GeomSubset, or None, with a warning that names what is used `otherwise`."""
        material, relationship = self._binding(prim)
        if not material:
            if relationship:
                targets = ", ".join(str(target) for target in relationship.GetTargets())
                self.reading.warn(prim.GetPath(), f"its bound material {targets} does not exist; {otherwise} is used")
            else:
                self._warn_of_other_purposes(prim, otherwise)
                self._warn_of_lost_bindings(prim)
            return None
        key = _key(material, self.reading)
        if key not in self.read:
            self.read[key] = self._read(material)
        return self.read[key]

    def _binding(self, prim: Any) -> tuple[Any, Any]:
        """Material and relationship of the first purpose that is bound; USD resolves strength and collections."""
        for purpose in self.purposes:
            material, relationship = self._resolved(prim, purpose)
            if relationship:
                return material, relationship
        return None, None

    def _resolved(self, prim: Any, purpose: str) -> tuple[Any, Any]:
        """Material and relationship of the binding for this very purpose; None of both without any."""
        try:
            material, relationship = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial(purpose)
        except PxrError as error:
            self.reading.warn(prim.GetPath(), f"its binding cannot be read: {one_line(error)}")
            return None, None
        # A purpose without a binding of its own is answered with that for all purposes.
        return (material, relationship) if relationship and _purpose_of(relationship) == purpose else (None, None)

    def _warn_of_other_purposes(self, prim: Any, otherwise: str) -> None:
        """Where a material is bound for a purpose that is not rendered, and none for one that is."""
        for purpose in sorted({"full", "preview"} - set(self.purposes)):
            if self._resolved(prim, purpose)[0]:
                message = f"its material is bound for the purpose {purpose} only, which is not rendered"
                self.reading.warn(prim.GetPath(), f"{message}; {otherwise} is used")

    def _warn_of_lost_bindings(self, prim: Any) -> None:
        """Where a prim or one above it has a binding that leads nowhere, each prim once."""
        while prim and not prim.IsPseudoRoot() and prim.GetPath() not in self.searched:
            self.searched.add(prim.GetPath())
            if prim.HasAPI(UsdShade.MaterialBindingAPI):
                names = [name for name in prim.GetAuthoredPropertyNames() if name.startswith("material:binding")]
                for relationship in filter(None, map(prim.GetRelationship, names)):
                    self.reading.targets(relationship, "it binds no material")
            prim = prim.GetParent()

    def _read(self, material: Any) -> BoundMaterial | None:
        """A UsdPreviewSurface, else MaterialX, MDL, Arnold's or RenderMan's, the first that is supported."""
        path = material.GetPath()
        shaders = {context: material.ComputeSurfaceSource(context)[0] for context in CONTEXTS}
        shaders = {context: shader for context, shader in shaders.items() if shader}
        for context, shader in shaders.items():
            bound = self._of_shader(shader, path)
            if bound is not None:
                self._warn_of_displacement(material, context, shader)
                return bound
        if not shaders:
            self.reading.warn(path, "it has no UsdPreviewSurface; displayColor is used")
        else:
            first = next(iter(shaders.values()))
            kind = mdl_name(first) or self._kind(first)
            self.reading.warn(path, f"its surface shader {kind} is not supported; displayColor is used")
        return None

    def _warn_of_displacement(self, material: Any, context: str, surface: Any) -> None:
        """Where another shader than the surface's displaces it: that one warns of its own inputs."""
        shader = material.ComputeDisplacementSource(context)[0]
        if shader and shader.GetPath() != surface.GetPath():
            kind = mdl_name(shader) or self._kind(shader)
            self.reading.warn(material.GetPath(), f"its displacement {kind} is not supported; it is not displaced")

    def _kind(self, shader: Any) -> str:
        return str(self.reading.get(shader.GetIdAttr()) or shader.GetImplementationSource())

    def _of_shader(self, shader: Any, path: Any) -> BoundMaterial | None:
        """What a surface shader describes; None for one that is not supported."""
        kind, name = self._kind(shader), mdl_name(shader)
        if kind == "UsdPreviewSurface":
            network = ShadingNetwork(path, self.reading, self.textures)
            return BoundMaterial(read_preview_surface(shader, network), network.columns)
        if is_materialx(kind) or is_library_surface(kind):
            nodes = MaterialXNetwork(path, self.reading, self.textures)
            return BoundMaterial(read_materialx(shader, nodes), nodes.columns)
        if is_mdl(name):
            network = ShadingNetwork(path, self.reading, self.textures)
            return BoundMaterial(read_mdl(shader, name, network), network.columns)
        if is_omni_surface(name):
            patterns = PatternNetwork(path, self.reading, self.textures)
            return BoundMaterial(read_omni_surface(shader, name, patterns), patterns.columns)
        if is_arnold(kind):
            of_arnold = ArnoldNetwork(path, self.reading, self.textures)
            return BoundMaterial(read_arnold(shader, of_arnold), of_arnold.columns)
        if is_renderman(kind):
            of_renderman = RenderManNetwork(path, self.reading, self.textures)
            return BoundMaterial(read_renderman(shader, of_renderman), of_renderman.columns)
        return None


def _key(material: Any, reading: Reading) -> tuple[Any, str]:
    """The same for a material in all instances of a native prototype, unless a color space comes from outside."""
    prim = material.GetPrim()
    if not prim.IsInstanceProxy():
        return prim.GetPath(), ""
    return prim.GetPrimInPrototype().GetPath(), inherited_space(prim, reading)


def _purpose_of(relationship: Any) -> str:
    """The purpose in a binding's name: material:binding[:purpose] or material:binding:collection[:purpose]:name."""
    words = str(relationship.GetName()).split(":")[2:]
    words = words[1:-1] if words[:1] == ["collection"] else words
    return words[0] if words else ""


def side_by_side(prim: Any, read: list[PrimvarColumns], scopes: Scopes) -> list[slice]:
    """The columns of each material of a gprim: all from 0 on, unless several read what a PointInstancer authors."""
    sources = [[source_of_primvar(prim, one.name, scopes) for one in columns.reads if scopes] for columns in read]
    several = sum(any(source is not None and source.scope is not None for source in one) for one in sources) > 1
    widths = [columns.width for columns in read]
    starts = np.cumsum([0, *widths[:-1]]) if several else np.zeros(len(widths), np.int64)
    return [slice(int(start), int(start) + width) for start, width in zip(starts, widths, strict=True)]


def moved(material: Material, columns: int) -> Material:
    """The material whose lookups read so many columns further on."""
    if columns == 0:
        return material
    lookups: dict[str, Any] = {n: replace(one, column=one.column + columns) for n, one in material.lookups.items()}
    return replace(material, **lookups)


def display_material(prim: Any, surface: Surface, scopes: Scopes, reading: Reading) -> BoundMaterial:
    """The Lambertian of a gprim's displayColor and displayOpacity, 0.18 and 1 where they are not authored."""
    columns = PrimvarColumns()
    color = _display_value(prim, surface, PrimvarRead("displayColor", (GREY, GREY, GREY)), columns, scopes, reading)
    opacity = _display_value(prim, surface, PrimvarRead("displayOpacity", (1.0,)), columns, scopes, reading)
    material = Material(
        diffuse_color=color if isinstance(color, PrimvarLookup) else (color[0], color[1], color[2]),
        opacity=opacity if isinstance(opacity, PrimvarLookup) else opacity[0],
        lambertian=True,
    )
    return BoundMaterial(material, columns)


def _display_value(
    prim: Any, surface: Surface, read: PrimvarRead, columns: PrimvarColumns, scopes: Scopes, reading: Reading
) -> tuple[float, ...] | PrimvarLookup:
    """A display primvar: one value where all its values are equal, else a lookup of it, clamped with a warning."""
    values = primvar_elements(prim, surface, read.name, read.width, scopes, reading).values
    if not len(values):
        return read.fallback
    if np.array_equal(values, np.broadcast_to(values[0], values.shape), equal_nan=True):
        fallback = np.array(read.fallback)
        value = clamped(prim.GetPath(), f"primvars:{read.name}", values[0], fallback, 0.0, 1.0, reading)
        return tuple(value.tolist())
    if not ((values >= 0.0) & (values <= 1.0)).all():
        reading.warn(prim.GetPath(), f"primvars:{read.name} goes beyond its range; it is clamped to 0 and 1")
    return PrimvarLookup(columns.column(read))
