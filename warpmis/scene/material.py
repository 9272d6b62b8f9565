"""What a surface is made of."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from warpmis.scene.texture import Lookup, TextureLookup, bounds_of, is_lookup, mean_of

Color = tuple[float, float, float]

# Below this GGX alpha a lobe is a mirror: float32 half vectors cannot resolve it (pbrt-v4's threshold).
SMOOTH_ALPHA = 1e-3
# From here on lights are chosen as if the lobe were matte: to look at it costs more than it saves.
MATTE_ALPHA = 0.5
# From here on an interface takes light samples (kernels/bsdf/dielectric.py).
ROUGH_ALPHA = 0.02


def is_smooth(roughness: float | Lookup) -> bool:
    """Whether a lobe of this roughness (alpha = roughness^2) is treated as a mirror, anywhere if it is looked up."""
    return bounds_of(roughness)[0] ** 2 < SMOOTH_ALPHA


def is_rough(roughness: float | Lookup) -> bool:
    """Whether an interface of this roughness takes light samples, anywhere if it is looked up."""
    return bounds_of(roughness)[1] ** 2 >= ROUGH_ALPHA


@dataclass(frozen=True)
class Material:
    """UsdPreviewSurface (names, ranges and defaults are the specification's), each input a constant or a lookup.

    `lambertian` is the surface of a prim with no material: diffuse alone, no specular lobe at all. `normal` is a
    vector in the frame of the shading normal and the texture coordinates' directions, None for the shading normal
    itself. `opacity_threshold`, if above 0, makes an opacity that is looked up 0 or 1; a constant one is so already.

    A share `transmission` of the surface is a dielectric interface of index `ior`, of the lobe's `roughness`, that
    reflects and refracts; the rest is all of the above. Names and meanings are OpenPBR's: with a `transmission_depth`
    [scene units] above 0 white light becomes `transmission_color` over that distance within, else it is tinted so at
    each passage. A `thin_walled` surface has the same medium on both sides, and bends no light.
    Reference: Andersson et al. (2024), "OpenPBR Surface", section "Translucent base".
    """

    path: str = ""
    diffuse_color: Color | Lookup = (0.18, 0.18, 0.18)
    emissive_color: Color | Lookup = (0.0, 0.0, 0.0)
    use_specular_workflow: bool = False
    specular_color: Color | Lookup = (0.0, 0.0, 0.0)
    metallic: float | Lookup = 0.0
    roughness: float | Lookup = 0.5
    clearcoat: float | Lookup = 0.0
    clearcoat_roughness: float | Lookup = 0.01
    opacity: float | Lookup = 1.0
    opacity_threshold: float = 0.0
    opacity_mode: str = "transparent"  # or "presence"
    ior: float = 1.5
    transmission: float = 0.0
    transmission_color: Color = (1.0, 1.0, 1.0)
    transmission_depth: float = 0.0
    thin_walled: bool = False
    normal: TextureLookup | None = None
    lambertian: bool = False

    @property
    def lookups(self) -> dict[str, Lookup]:
        """The inputs that are not constant, by name."""
        return {name: value for name, value in vars(self).items() if is_lookup(value)}

    @cached_property
    def mean(self) -> Material:
        """The material with constant inputs alone, a lookup's mean for each, and the surface's own normal."""
        means = {
            name: mean_of(value, high=np.inf if name == "emissive_color" else 1.0)
            for name, value in self.lookups.items()
            if name not in ("opacity", "normal")
        }
        for name in COLOR_INPUTS:
            if isinstance(means.get(name), float):
                means[name] = (means[name],) * 3
        opacity = mean_of(self.opacity, threshold=self.opacity_threshold)
        return replace(self, **means, opacity=opacity, normal=None)

    @property
    def is_clear_pane(self) -> bool:
        """Whether it lets light straight through: thin, and so smooth that what is behind it is seen sharply."""
        return self.transmission > 0.0 and self.thin_walled and is_smooth(self.roughness)

    @property
    def mean_emission(self) -> tuple[float, float, float]:
        """Emitted radiance [nit]: where opacity means presence, what is not there does not shine either.

        Where inputs are lookups, a mean over their texels: 0 if and only if the material emits nowhere.
        """
        constant: Any = self.mean
        share = constant.opacity if constant.opacity_mode == "presence" else 1.0
        red, green, blue = constant.emissive_color
        return (share * red, share * green, share * blue)


COLOR_INPUTS = ("diffuse_color", "emissive_color", "specular_color")
