"""The pictures that materials look up: each file decoded once, plain or as UDIM tiles, in its colour space."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpmis.scene.texture import FIRST_TILE, Texture
from warpmis.usd.asset_path import AssetFiles, read_asset
from warpmis.usd.color_space import AUTO, LINEAR, RAW, SRGB
from warpmis.usd.materials.image import Picture, PictureError, linear_floats, read_stored, without_infinities
from warpmis.usd.reading import Reading

# Texels are indexed with int32 on the device: a word for each of bytes, and for each float.
MAX_TEXEL_WORDS = 2**31 - 1
# Spaces whose bytes the device decodes.
BYTES = (LINEAR, RAW, SRGB)


@dataclass(eq=False)
class TextureReader:
    """Reads the textures of one stage.

    Attributes:
        pictures: decoded files by resolved path; None for one that cannot be read.
        textures: by the paths of their tiles and their colour space.
        admitted: tiles that have been counted, by their identities.
        words: how many the pictures take so far.
    """

    reading: Reading
    pictures: dict[str, Picture | None] = field(default_factory=dict)
    textures: dict[Any, Texture | None] = field(default_factory=dict)
    admitted: dict[int, NDArray[Any]] = field(default_factory=dict)
    words: int = 0

    def admits(self, texture: Texture) -> bool:
        """Whether a picture has room, one that was made of others included, which is counted the first time."""
        for pixels in texture.tiles.values():
            if id(pixels) not in self.admitted:
                if self.words + pixels.size > MAX_TEXEL_WORDS:
                    return False
                self.admitted[id(pixels)] = pixels
                self.words += pixels.size
        return True

    def read(self, attribute: Any, space: str) -> Texture | None:
        """The texture of an asset attribute; None, with a warning, where no picture of it can be read.

        Args:
            space: as `known_space` has it; AUTO is sRGB where the file says so, and for bytes of three or four
                channels.
        """
        asset = read_asset(attribute, self.reading)
        if asset is None:
            return None
        if not asset.files:
            reason = f"{asset.path} has no tiles" if asset.is_udim else f"{asset.path} does not exist"
            reason = reason if asset.path else "it names no file"
            self.reading.warn(attribute.GetPath(), f"the texture cannot be read: {reason}; its fallback is used")
            return None
        key = (tuple(sorted(asset.files.items())), space)
        if key not in self.textures:
            self.textures[key] = self._texture(attribute, asset, space)
        return self.textures[key]

    def _texture(self, attribute: Any, asset: AssetFiles, space: str) -> Texture | None:
        read = {number or FIRST_TILE: self._picture(attribute.GetPath(), path) for number, path in asset.files.items()}
        pictures = {number: picture for number, picture in read.items() if picture is not None}
        if not pictures:
            return None
        if space == AUTO:
            space = SRGB if all(map(_is_srgb, pictures.values())) else LINEAR
        tiles = {number: _decoded_here(picture.pixels, space) for number, picture in pictures.items()}
        self.admitted |= {id(pixels): pixels for pixels in tiles.values()}
        return Texture(tiles, space == SRGB, asset.is_udim)

    def _picture(self, prim_path: Any, path: str) -> Picture | None:
        if path not in self.pictures:
            self.pictures[path] = self._decoded(prim_path, path)
        return self.pictures[path]

    def _decoded(self, prim_path: Any, path: str) -> Picture | None:
        try:
            picture = read_stored(path)
        except PictureError as error:
            self.reading.warn(prim_path, f"the texture cannot be read: {error}; its fallback is used")
            return None
        pixels, infinite = picture.pixels, 0
        if pixels.dtype == np.float32:
            pixels, infinite = without_infinities(pixels)
        if infinite:
            note = f"{infinite} texels of {path} are infinite; its largest finite value is used there"
            self.reading.warn(prim_path, note)
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


def _decoded_here(pixels: NDArray[Any], space: str) -> NDArray[Any]:
    """Linear floats; bytes of a space that the device decodes stay bytes."""
    return pixels if pixels.dtype == np.uint8 and space in BYTES else linear_floats(pixels, space)


def _is_srgb(picture: Picture) -> bool:
    """What sourceColorSpace "auto" finds."""
    return picture.says_srgb or (picture.pixels.dtype == np.uint8 and picture.pixels.shape[-1] >= 3)
