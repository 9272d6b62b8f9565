"""The pictures that materials look up: each file decoded once, plain or as UDIM tiles, in its colour space."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, UsdShade

from warpmis.scene.texture import FIRST_TILE, Texture
from warpmis.usd.materials.image import Picture, PictureError, read_stored, srgb_to_linear
from warpmis.usd.reading import Reading

# Texels are indexed with int32 on the device: a word for each of bytes, and for each float.
MAX_TEXEL_WORDS = 2**31 - 1


@dataclass(eq=False)
class TextureReader:
    """Reads the textures of one stage.

    Attributes:
        pictures: decoded files by resolved path; None for one that cannot be read.
        textures: by the paths of their tiles and their colour space.
        words: how many the pictures take so far.
    """

    reading: Reading
    pictures: dict[str, Picture | None] = field(default_factory=dict)
    textures: dict[Any, Texture | None] = field(default_factory=dict)
    words: int = 0

    def read(self, attribute: Any, color_space: str) -> Texture | None:
        """The texture of an asset attribute; None, with a warning, where no picture of it can be read.

        Args:
            color_space: UsdUVTexture's sourceColorSpace; "auto" is sRGB where the file says so, and for bytes of three
                or four channels.
        """
        paths = self._tile_paths(attribute)
        key = (tuple(sorted(paths.items())), color_space)
        if key not in self.textures:
            self.textures[key] = self._texture(attribute, paths, color_space)
        return self.textures[key]

    def _tile_paths(self, attribute: Any) -> dict[int, str]:
        """Resolved path of each tile that there is, by UDIM number; a picture without tiles is FIRST_TILE."""
        asset = self.reading.get(attribute, like=Sdf.AssetPath())
        if asset is None or not asset.path:
            self.reading.warn(attribute.GetPath(), "the texture names no file; its fallback is used")
            return {}
        if not UsdShade.UdimUtils.IsUdimIdentifier(asset.path):
            return {FIRST_TILE: asset.resolvedPath or asset.path}
        specs = attribute.GetPropertyStack(self.reading.time)
        found = UsdShade.UdimUtils.ResolveUdimTilePaths(asset.path, specs[0].layer)
        if not found:
            self.reading.warn(attribute.GetPath(), f"{asset.path} has no tiles; its fallback is used")
        return {int(number): str(path) for path, number in found}

    def _texture(self, attribute: Any, paths: dict[int, str], color_space: str) -> Texture | None:
        read = {number: self._picture(attribute.GetPath(), path) for number, path in paths.items()}
        pictures = {number: picture for number, picture in read.items() if picture is not None}
        if not pictures:
            return None
        is_srgb = color_space == "sRGB" or (color_space == "auto" and all(map(_is_srgb, pictures.values())))
        tiles = {number: picture.pixels for number, picture in pictures.items()}
        if is_srgb:
            tiles = {number: _linear_floats(pixels) for number, pixels in tiles.items()}
        is_udim = UsdShade.UdimUtils.IsUdimIdentifier(self.reading.get(attribute).path)
        return Texture(tiles, is_srgb, is_udim)

    def _picture(self, prim_path: Any, path: str) -> Picture | None:
        if path not in self.pictures:
            self.pictures[path] = self._decoded(prim_path, path)
        return self.pictures[path]

    def _decoded(self, prim_path: Any, path: str) -> Picture | None:
        try:
            picture = read_stored(path)
        except PictureError as error:
            reason = str(error) if path in str(error) else f"{path}: {error}"
            self.reading.warn(prim_path, f"the texture cannot be read: {reason}; its fallback is used")
            return None
        pixels = picture.pixels
        invalid = ~np.isfinite(pixels).all(axis=-1) if pixels.dtype == np.float32 else np.zeros(1, bool)
        if invalid.any():
            self.reading.warn(prim_path, f"{invalid.sum()} texels of {path} are not finite; they are black")
            pixels = np.where(invalid[..., None], np.float32(0.0), pixels)
        words = pixels.size if pixels.dtype == np.float32 else pixels[..., 0].size
        if self.words + words > MAX_TEXEL_WORDS:
            self.reading.warn(prim_path, f"{path} is left out: the stage's textures have too many texels")
            return None
        self.words += words
        return Picture(pixels, picture.says_srgb)


def _is_srgb(picture: Picture) -> bool:
    """What sourceColorSpace "auto" finds."""
    return picture.says_srgb or (picture.pixels.dtype == np.uint8 and picture.pixels.shape[-1] >= 3)


def _linear_floats(pixels: NDArray[Any]) -> NDArray[Any]:
    """Floats with their sRGB colours made linear, alpha as it is; bytes are decoded where they are looked up."""
    if pixels.dtype == np.uint8:
        return pixels
    colors = 3 if pixels.shape[-1] >= 3 else 1
    return np.concatenate([srgb_to_linear(pixels[..., :colors]), pixels[..., colors:]], axis=-1)
