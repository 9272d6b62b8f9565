"""A warpmis Material as Mitsuba's BSDF: `bsdf` where both define the same one, `near_bsdf` the nearest one elsewhere.

Exact, but for the compensation of multiple scattering, which Mitsuba's microfacets do not have:

- Lambertian, or the specular workflow with a black specular colour: `diffuse`. A surface is a lamina, both its sides
  reflect: `twosided`.
- Pure metal, or the specular workflow with a black diffuse colour: `principled` with metallic = 1, which is GGX with
  alpha = roughness^2, separable Smith masking and Schlick's Fresnel between the base colour and white.
- An interface that is nothing else: `dielectric`, `roughdielectric`, `thindielectric`.

Near:

- Diffuse under a lobe: `roughplastic` without nonlinear colours. Both weaken the diffuse reflection by what the lobe
  takes on the way in and on the way out, and divide by the mean of what it leaves; but Mitsuba loses what is scattered
  twice at its microfacets, so its diffuse colour is brightened until the mean over all directions is ours. Its Fresnel
  term is a dielectric's, ours Schlick's. `principled` is farther off: its diffuse part is Disney's, and not weakened.
- A coat on top: half of one such surface and half of another (`blendbsdf`), one with twice the coat's reflection, the
  other with twice the lobe's, both below what the coat leaves on average.
- Opacity 0 in the mode "transparent": `thindielectric` with the same reflectance straight on; the reflection is sharp.
  Other opacities: `mask`, which does not depend on the angle.
- A diffuse colour that is a picture, of what is no metal: `bitmap`. All other inputs that vary are their means, and
  normal maps are left out.
"""

from __future__ import annotations

import math
from contextlib import suppress
from functools import cache
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from warpmis.scene import Material
from warpmis.scene.texture import FIRST_TILE, TextureLookup, byte_values

MIN_ROUGHNESS = 0.05  # below, Mitsuba clamps alpha (at 0.001), and a mirror is not a delta lobe there


class NoCounterpartError(ValueError):
    """The scene holds something that Mitsuba has no equal of."""

    def __init__(self, path: str, what: str) -> None:
        super().__init__(f"{path or '(no path)'}: {what}")


def bsdf(material: Material) -> dict[str, Any]:
    """The material's reflection, if Mitsuba has it exactly, but for the compensation of multiple scattering."""
    if material.lookups:
        raise NoCounterpartError(material.path, f"{min(material.lookups)} varies over the surface")
    if material.lambertian:
        return matte(color(material.diffuse_color))
    if material.transmission > 0.0:
        return interface(material)
    if material.opacity < 1.0 or material.clearcoat > 0.0:
        raise NoCounterpartError(material.path, "opacity below 1, or clearcoat")
    if material.use_specular_workflow and max(material.specular_color) == 0.0:
        return matte(color(material.diffuse_color))
    if material.use_specular_workflow and max(material.diffuse_color) == 0.0:
        base = material.specular_color
    elif not material.use_specular_workflow and material.metallic == 1.0:
        base = material.diffuse_color
    else:
        raise NoCounterpartError(material.path, "a diffuse lobe under a specular one")
    if material.roughness < MIN_ROUGHNESS:
        raise NoCounterpartError(material.path, f"roughness {material.roughness:g} is below {MIN_ROUGHNESS}")
    metal = {"type": "principled", "base_color": color(base), "metallic": 1.0, "roughness": material.roughness}
    return {"type": "twosided", "coat": metal}


def interface(material: Material) -> dict[str, Any]:
    """A dielectric that is nothing else."""
    if material.transmission < 1.0 or material.opacity < 1.0 or material.transmission_depth > 0.0:
        raise NoCounterpartError(material.path, "glass that is partly something else, or absorbs")
    tint = {"int_ior": material.ior, "ext_ior": 1.0, "specular_transmittance": color(material.transmission_color)}
    if material.roughness == 0.0:
        return {"type": "thindielectric" if material.thin_walled else "dielectric", **tint}
    if material.thin_walled or material.roughness < MIN_ROUGHNESS:
        raise NoCounterpartError(material.path, "a rough pane, or glass that is nearly smooth")
    return {"type": "roughdielectric", "distribution": "ggx", "alpha": material.roughness**2, **tint}


def near_bsdf(material: Material) -> dict[str, Any]:
    """The exact BSDF where there is one, else the nearest. Glass that is partly something else is refused."""
    mean, painted = material.mean, painting(material)
    if painted is None:
        with suppress(NoCounterpartError):
            return bsdf(mean)
    if mean.transmission > 0.0:
        return interface(mean)
    if mean.opacity == 0.0 and mean.opacity_mode == "transparent" and not mean.lambertian:
        return {"type": "thindielectric", "int_ior": pane_index(max(reflectance(mean))), "ext_ior": 1.0}
    found = layered(mean, color(mean.diffuse_color) if painted is None else bitmap(painted))
    return found if mean.opacity == 1.0 else {"type": "mask", "opacity": float(mean.opacity), "base": found}


def layered(material: Material, base: dict[str, Any]) -> dict[str, Any]:
    """A diffuse surface under a lobe, and perhaps a coat; base: the diffuse colour of what is no metal."""
    if material.lambertian:
        return matte(base)
    is_metal = material.metallic == 1.0 and not material.use_specular_workflow
    diffuse = base if material.use_specular_workflow else scaled(base, 1.0 - material.metallic)
    f0 = reflectance(material)
    if material.clearcoat == 0.0 and is_metal and material.roughness < MIN_ROUGHNESS:
        return twosided({"type": "conductor", "material": "none", "specular_reflectance": color(f0)})
    if material.clearcoat == 0.0:
        return twosided(plastic(diffuse, f0, material.roughness))
    of_coat = dielectric_reflectance(material.ior)
    left = 1.0 - material.clearcoat * mean_reflectance(of_coat)
    below = scaled(diffuse, left)
    coat = plastic(below, (of_coat,) * 3, material.clearcoat_roughness, 2.0 * material.clearcoat)
    lobe = plastic(below, f0, material.roughness, 2.0 * left)
    return twosided({"type": "blendbsdf", "weight": 0.5, "coat": coat, "lobe": lobe})


def plastic(diffuse: dict[str, Any], f0: tuple[float, ...], roughness: float, factor: float = 1.0) -> dict[str, Any]:
    """A diffuse surface under a lobe of the reflectance f0 straight on, `factor` times as bright."""
    highest = max(f0)
    if highest == 0.0:
        return {"type": "diffuse", "reflectance": diffuse}
    content = {"int_ior": index(highest), "specular_reflectance": colors([factor * part / highest for part in f0])}
    if roughness < MIN_ROUGHNESS:
        return {"type": "plastic", "ext_ior": 1.0, "diffuse_reflectance": diffuse, **content}
    content |= {"type": "roughplastic", "ext_ior": 1.0, "distribution": "ggx", "alpha": roughness**2}
    kept = rough_albedo(index(highest), roughness**2)
    brighter = [(1.0 - mean_reflectance(part)) / kept for part in f0]
    return {"diffuse_reflectance": scaled(diffuse, brighter), **content}


@cache
def rough_albedo(int_ior: float, alpha: float) -> float:
    """What `roughplastic` of the diffuse colour 1 reflects diffusely, averaged over all directions.

    Its diffuse part is a product of one factor for each of both directions, which is the root of the part for twice
    the same direction.
    """
    lobe = {"int_ior": int_ior, "ext_ior": 1.0, "distribution": "ggx", "alpha": alpha, "specular_reflectance": 0.0}
    surface = mi.load_dict({"type": "roughplastic", "diffuse_reflectance": 1.0, **lobe})
    at = mi.SurfaceInteraction3f()
    nodes, weights = np.polynomial.legendre.leggauss(16)
    total = 0.0
    for cosine, weight in zip((0.5 * (nodes + 1.0)).tolist(), weights.tolist(), strict=True):
        direction = mi.Vector3f(math.sqrt(1.0 - cosine * cosine), 0.0, cosine)
        at.wi = direction
        response = np.array(surface.eval(mi.BSDFContext(), at, direction)).ravel()[0]
        total += weight * cosine * math.sqrt(math.pi * float(response) / cosine)
    return total * total


def reflectance(material: Material) -> tuple[float, ...]:
    """Of the lobe straight on."""
    if material.use_specular_workflow:
        return material.specular_color
    dielectric = dielectric_reflectance(material.ior) * (1.0 - material.metallic)
    return tuple(dielectric + material.metallic * part for part in material.diffuse_color)


def dielectric_reflectance(ior: float) -> float:
    return ((ior - 1.0) / (ior + 1.0)) ** 2


def mean_reflectance(f0: float) -> float:
    """Mean of Schlick's term over the hemisphere, weighted by the cosine."""
    return f0 + (1.0 - f0) / 21.0


def index(f0: float) -> float:
    """The index of refraction with this reflectance straight on; none is quite 1, which Mitsuba refuses."""
    root = math.sqrt(min(max(f0, 1e-6), 0.99))
    return (1.0 + root) / (1.0 - root)


def pane_index(f0: float) -> float:
    """The index of a pane, reflection within it included, with this reflectance straight on: 2 R / (1 + R) = f0."""
    return index(f0 / (2.0 - f0))


def painting(material: Material) -> TextureLookup | None:
    """The picture that the diffuse colour is, where it is one and not several tiles, and not a metal's."""
    found = material.diffuse_color
    if not isinstance(found, TextureLookup) or found.texture.is_udim or found.channels != "rgb":
        return None
    return None if material.metallic == 1.0 and not material.use_specular_workflow else found


def bitmap(painted: TextureLookup) -> dict[str, Any]:
    """The picture as a texture of linear values; the mesh has transformed coordinates, from the upper left corner.

    Beyond its borders Mitsuba has one rule for both directions, and no black.
    """
    rule = {"repeat": "repeat", "mirror": "mirror"}.get(painted.wrap_s, "clamp")
    picture = mi.Bitmap(linear_pixels(painted))
    return {"type": "bitmap", "bitmap": picture, "raw": True, "filter_type": "bilinear", "wrap_mode": rule}


def linear_pixels(painted: TextureLookup) -> NDArray[np.float32]:
    """What the lookup gives at the texels, within [0, 1], shape (rows, columns, 3)."""
    pixels = painted.texture.tiles[FIRST_TILE]
    red_green_blue = pixels[..., :3] if pixels.shape[-1] >= 3 else np.repeat(pixels[..., :1], 3, axis=-1)
    if pixels.dtype == np.uint8:
        red_green_blue = byte_values(painted.texture.is_srgb)[red_green_blue]
    values = red_green_blue * np.array(painted.scale[:3]) + np.array(painted.bias[:3])
    return np.ascontiguousarray(np.clip(values, 0.0, 1.0), dtype=np.float32)


def scaled(diffuse: dict[str, Any], factor: float | list[float]) -> dict[str, Any]:
    """A colour, or a picture, times a factor, or one of each component."""
    if "bitmap" in diffuse:
        return {**diffuse, "bitmap": mi.Bitmap(np.array(diffuse["bitmap"]) * np.array(factor, np.float32))}
    return colors(np.array(diffuse["value"]) * factor)


def colors(rgb: Any) -> dict[str, Any]:
    """Like `color`, but above 1, too, which Mitsuba allows no reflectance but that of a picture."""
    if max(rgb) <= 1.0:
        return color(rgb)
    return {"type": "bitmap", "bitmap": mi.Bitmap(np.array([[rgb]], dtype=np.float32)), "raw": True}


def matte(diffuse: dict[str, Any]) -> dict[str, Any]:
    return twosided({"type": "diffuse", "reflectance": diffuse})


def twosided(one: dict[str, Any]) -> dict[str, Any]:
    return {"type": "twosided", "side": one}


def color(rgb: Any) -> dict[str, Any]:
    """A linear Rec.709 triple as Mitsuba takes it, without any conversion to spectra."""
    return {"type": "rgb", "value": [float(c) for c in rgb]}
