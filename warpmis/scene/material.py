"""What a surface is made of."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from warpmis.scene.texture import Lookup, TextureLookup, is_lookup, mean_of

Color = tuple[float, float, float]


@dataclass(frozen=True)
class Material:
    """UsdPreviewSurface (names, ranges and defaults are the specification's), each input a constant or a lookup.

    `lambertian` is the surface of a prim with no material: diffuse alone, no specular lobe at all. `normal` is a
    vector in the frame of the shading normal and the texture coordinates' directions, None for the shading normal
    itself. `opacity_threshold`, if above 0, makes an opacity that is looked up 0 or 1; a constant one is so already.
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
    def mean_emission(self) -> tuple[float, float, float]:
        """Emitted radiance [nit]: where opacity means presence, what is not there does not shine either.

        Where inputs are lookups, a mean over their texels: 0 if and only if the material emits nowhere.
        """
        constant: Any = self.mean
        share = constant.opacity if constant.opacity_mode == "presence" else 1.0
        red, green, blue = constant.emissive_color
        return (share * red, share * green, share * blue)


COLOR_INPUTS = ("diffuse_color", "emissive_color", "specular_color")
