"""MaterialX networks that a stage holds as UsdShade nodes: their surface as a UsdPreviewSurface, their image nodes.

A lobe of standard_surface or OpenPBR that a UsdPreviewSurface lacks is left out with a warning.
References: Georgiev et al. (2019), "Autodesk Standard Surface"; Andersson et al. (2024), "OpenPBR Surface".
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from warpmis.scene import Material
from warpmis.scene.texture import Lookup, PrimvarLookup, TextureLookup, is_lookup
from warpmis.usd.color_space import RAW, space_of
from warpmis.usd.materials.preview_surface import clamped, constant_if_uniform, read_preview_surface
from warpmis.usd.materials.shading_network import IDENTITY, ShadingNetwork, Transform, is_input
from warpmis.usd.shapes.primvar import PrimvarRead

WRAP_MODES = {"constant": "black", "clamp": "clamp", "periodic": "repeat", "mirror": "mirror"}
TEXCOORD_SETS = ("st", "st1", "st2", "st3")


@dataclass(frozen=True)
class SurfaceModel:
    """Names of a shader's inputs with their defaults, and what else it has that must be 0 to be left out silently."""

    base: tuple[str, float]
    color: tuple[str, float]
    metalness: str
    specular: str
    roughness: tuple[str, float]
    ior: str
    coat: str
    coat_roughness: tuple[str, float]
    emission: str
    emission_color: str
    opacity: tuple[str, int]
    normal: str
    transmission: str
    thin_walled: str
    left_out: tuple[str, ...]


MODELS = {
    "ND_standard_surface_surfaceshader": SurfaceModel(
        base=("base", 1.0),
        color=("base_color", 0.8),
        metalness="metalness",
        specular="specular",
        roughness=("specular_roughness", 0.2),
        ior="specular_IOR",
        coat="coat",
        coat_roughness=("coat_roughness", 0.1),
        emission="emission",
        emission_color="emission_color",
        opacity=("opacity", 3),
        normal="normal",
        transmission="transmission",
        thin_walled="thin_walled",
        left_out=(
            "subsurface", "sheen", "thin_film_thickness", "specular_anisotropy", "transmission_dispersion",
            "transmission_extra_roughness",
        ),
    ),
    "ND_open_pbr_surface_surfaceshader": SurfaceModel(
        base=("base_weight", 1.0),
        color=("base_color", 0.8),
        metalness="base_metalness",
        specular="specular_weight",
        roughness=("specular_roughness", 0.3),
        ior="specular_ior",
        coat="coat_weight",
        coat_roughness=("coat_roughness", 0.0),
        emission="emission_luminance",
        emission_color="emission_color",
        opacity=("geometry_opacity", 1),
        normal="geometry_normal",
        transmission="transmission_weight",
        thin_walled="geometry_thin_walled",
        left_out=(
            "subsurface_weight", "fuzz_weight", "thin_film_weight", "specular_roughness_anisotropy",
            "transmission_dispersion_scale",
        ),
    ),
}  # fmt: skip
PREVIEW_SURFACE = "ND_UsdPreviewSurface_surfaceshader"


def is_materialx(kind: str) -> bool:
    """Whether `read_materialx` knows the surface shader."""
    return kind in MODELS or kind == PREVIEW_SURFACE


def read_materialx(shader: Any, network: MaterialXNetwork) -> Material:
    """The nearest UsdPreviewSurface of a MaterialX surface shader."""
    kind = network.kind(shader)
    if kind == PREVIEW_SURFACE:
        return read_preview_surface(shader, network)
    model = MODELS[kind]
    for name in model.left_out:
        if is_lookup(value := network.value(shader, name, 1)) or value:
            network.reading.warn(network.path, f"inputs:{name} is not supported; it is left out")
    opacity_name, opacity_width = model.opacity
    return Material(
        path=str(network.path),
        diffuse_color=_weighted(shader, network, model.color, model.base, 1.0),
        emissive_color=_weighted(shader, network, (model.emission_color, 1.0), (model.emission, 0.0), np.inf),
        metallic=_input(shader, network, model.metalness, 0.0, 1),
        roughness=_input(shader, network, *model.roughness, 1),
        clearcoat=_input(shader, network, model.coat, 0.0, 1),
        clearcoat_roughness=_input(shader, network, *model.coat_roughness, 1),
        opacity=_as_number(_input(shader, network, opacity_name, 1.0, opacity_width)),
        opacity_mode="presence",
        normal=_normal(network.value(shader, model.normal, 3)),
        **(_transmission(shader, network, model) or {"ior": _effective_ior(shader, network, model)}),
    )


def _transmission(shader: Any, network: MaterialXNetwork, model: SurfaceModel) -> dict[str, Any]:
    """The dielectric share of the surface, whose inputs must be constant; nothing where light is not refracted."""
    weight = _weight(shader, network, model.transmission, 0.0, 1.0)
    if weight == 0.0:
        return {}
    color = _input(shader, network, "transmission_color", 1.0, 3)
    if is_lookup(color):
        network.reading.warn(network.path, "inputs:transmission_color must be constant; white is used")
        color = (1.0, 1.0, 1.0)
    if any(network.vector(shader, "transmission_scatter", 3, (0.0, 0.0, 0.0))):
        network.reading.warn(network.path, "inputs:transmission_scatter is not supported; it is left out")
    return {
        "transmission": weight,
        "transmission_color": color,
        "transmission_depth": _weight(shader, network, "transmission_depth", 0.0, np.inf),
        "thin_walled": network.constant(shader, model.thin_walled, False),
        # Facets reflect by the same index as they refract by: a specular weight would change both.
        "ior": max(_weight(shader, network, model.ior, 1.5, np.inf), 1e-3),
    }


def _weighted(
    shader: Any, network: MaterialXNetwork, color: tuple[str, float], weight: tuple[str, float], high: float
) -> Any:
    """A colour input times a number input, both within [0, high]."""
    value = _input(shader, network, *color, 3, high)
    return _scaled(color[0], value, _weight(shader, network, *weight, high), network)


def _input(shader: Any, network: MaterialXNetwork, name: str, default: float, width: int, high: float = 1.0) -> Any:
    """A lookup, a number, or a colour within [0, high]."""
    value = network.value(shader, name, width)
    fallback = np.full(width, default)
    if is_lookup(value):
        return value
    number = fallback if value is None else np.broadcast_to(np.asarray(value, np.float64), width)
    inside = clamped(network.path, f"inputs:{name}", number, fallback, 0.0, high, network.reading)
    return tuple(inside.tolist()) if width == 3 else float(inside[0])


def _weight(shader: Any, network: MaterialXNetwork, name: str, default: float, high: float) -> float:
    """A factor that must be constant."""
    value = _input(shader, network, name, default, 1, high)
    if isinstance(value, float):
        return value
    network.reading.warn(network.path, f"inputs:{name} must be constant; {default:g} is used")
    return default


def _scaled(shader_name: str, color: Any, factor: float, network: MaterialXNetwork) -> Any:
    if factor == 0.0:
        return (0.0, 0.0, 0.0)
    if isinstance(color, TextureLookup):
        return color.scaled(factor)
    if isinstance(color, PrimvarLookup):
        if factor != 1.0:
            network.reading.warn(network.path, f"a weight of inputs:{shader_name}, a primvar, is not supported")
        return color
    return tuple(factor * x for x in color)


def _as_number(value: Any) -> float | Lookup:
    """The red of a coloured opacity."""
    if isinstance(value, TextureLookup):
        return constant_if_uniform(replace(value, channels="r" if value.channels == "rgb" else value.channels))
    return value[0] if isinstance(value, tuple) else value


def _effective_ior(shader: Any, network: MaterialXNetwork, model: SurfaceModel) -> float:
    """The index of refraction whose normal reflectance is the specular weight times that of the authored one."""
    ior = max(_weight(shader, network, model.ior, 1.5, np.inf), 1e-3)
    root = abs(ior - 1.0) / (ior + 1.0) * np.sqrt(_weight(shader, network, model.specular, 1.0, 1.0))
    return float((1.0 + root) / (1.0 - root))


def _normal(value: Any) -> TextureLookup | None:
    return value if isinstance(value, TextureLookup) and value.channels == "rgb" else None


class MaterialXNetwork(ShadingNetwork):
    """A network whose nodes may be MaterialX's as well as UsdPreviewSurface's."""

    def node_value(self, node: Any, kind: str, output: str, width: int) -> tuple[bool, Any]:
        if kind.startswith(("ND_image_", "ND_tiledimage_")):
            return True, self._image(node, kind, width)
        if kind.startswith("ND_normalmap"):
            return True, self._normal_map(node)
        if kind.startswith(("ND_separate", "ND_extract_")):
            return True, self._channel(node, kind, output)
        if kind.startswith("ND_convert_"):
            return True, self.value(node, "in", width)
        if kind.startswith("ND_geompropvalue_") and kind.endswith(("_float", "_color3", "_vector3")):
            name = str(self.constant(node, "geomprop", ""))
            fallback = (0.0,) if width == 1 else (0.0, 0.0, 0.0)
            return True, PrimvarLookup(self.columns.column(PrimvarRead(name, fallback)))
        return super().node_value(node, kind, output, width)

    def _image(self, node: Any, kind: str, width: int) -> Any:
        """A lookup of an image node; its `default` where the picture cannot be read."""
        file = self.source(node, "file")
        texture = None
        if file is not None and is_input(file):
            # Colours alone have a space in MaterialX.
            space = space_of(file, RAW, self.reading) if "_color" in kind else RAW
            texture = self.textures.read(file, space)
        if texture is None:
            return self.vector(node, "default", width, None)
        column, transform = self._texcoord(node, kind)
        return TextureLookup(
            texture=texture,
            column=column,
            channels="rgb" if width == 3 else "r",
            transform=transform,
            wrap_s=WRAP_MODES.get(str(self.constant(node, "uaddressmode", "periodic")), "repeat"),
            wrap_t=WRAP_MODES.get(str(self.constant(node, "vaddressmode", "periodic")), "repeat"),
        )

    def _texcoord(self, node: Any, kind: str) -> tuple[int, Transform]:
        """Column of an image node's coordinates, and the map of a tiled one: st * uvtiling - uvoffset."""
        name, source = "st", self.node(node, "texcoord")
        if source is not None:
            source_kind = self.kind(source)
            if source_kind == "ND_geompropvalue_vector2":
                name = str(self.constant(source, "geomprop", "st"))
            elif source_kind == "ND_texcoord_vector2":
                name = TEXCOORD_SETS[min(self._index(source), len(TEXCOORD_SETS) - 1)]
            else:
                self.reading.warn(node.GetPath(), f"its texcoord node {source_kind} is not supported; st is used")
        transform = IDENTITY
        if kind.startswith("ND_tiledimage_"):
            tiling, offset = self.vector(node, "uvtiling", 2, (1.0, 1.0)), self.vector(node, "uvoffset", 2, (0.0, 0.0))
            transform = ((tiling[0], 0.0, -offset[0]), (0.0, tiling[1], -offset[1]))
        return self.columns.column(PrimvarRead(name, (0.0, 0.0))), transform

    def _index(self, node: Any) -> int:
        return max(int(self.vector(node, "index", 1, (0.0,))[0]), 0)

    def _normal_map(self, node: Any) -> Any:
        """A tangent-space map's texels in [0, 1] as vectors, x and y times the node's scale."""
        lookup = self.value(node, "in", 3)
        if not isinstance(lookup, TextureLookup):
            return None
        scale = self.vector(node, "scale", 1, (1.0,))[0]
        return replace(lookup, scale=(2.0 * scale, 2.0 * scale, 2.0, 1.0), bias=(-scale, -scale, -1.0, 0.0))

    def _channel(self, node: Any, kind: str, output: str) -> Any:
        """One channel of an image, of a separate node by its output's name, of an extract node by its index."""
        is_extract = kind.startswith("ND_extract_")
        channel = "rgba"[min(self._index(node), 3)] if is_extract else output.removeprefix("out")
        channel = {"x": "r", "y": "g", "z": "b", "w": "a"}.get(channel, channel)
        lookup = self.value(node, "in", 3)
        if isinstance(lookup, TextureLookup) and channel in ("r", "g", "b", "a"):
            return replace(lookup, channels=channel)
        self.reading.warn(self.path, f"{kind} {node.GetPath()} is not fed by an image; it is not used")
        return None
