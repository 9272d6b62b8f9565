"""Pictures of one size that are looked up at the same places: stored side by side, each with its own values."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from usd.pictures import grey, stage
from usd.points import seen_at
from usd.stages import load

from warpmis.device.material import material_tables
from warpmis.device.texel_views import BYTES, FLOATS, HALVES, SHORTS
from warpmis.device.upload import Uploads, upload
from warpmis.scene import Material, Scene
from warpmis.scene.texture import Texture, TextureLookup
from warpmis.usd.materials.image import srgb_to_linear

RANDOM = np.random.default_rng(3)
COLOR = RANDOM.integers(0, 256, (5, 7, 3), np.uint8)
PACKED = RANDOM.integers(0, 256, (5, 7, 4), np.uint8)
BUMPS = (RANDOM.random((5, 7, 3)) * [0.4, 0.4, 0.0] + [-0.2, -0.2, 1.0]).astype(np.float32)
COAT = RANDOM.integers(0, 256, (3, 2, 1), np.uint8)  # of another size
POINTS = RANDOM.random((40, 2))


def lookup(pixels: np.ndarray, channels: str = "rgb", is_srgb: bool = False) -> TextureLookup:
    return TextureLookup(Texture({1001: pixels}, is_srgb), channels=channels, wrap_s="repeat", wrap_t="mirror")


MATERIAL = Material(
    diffuse_color=lookup(COLOR, is_srgb=True),
    roughness=lookup(PACKED, "g"),
    opacity=lookup(PACKED, "a"),
    clearcoat=lookup(COAT, "r"),
    normal=lookup(BUMPS),
    use_specular_workflow=True,
)


def scene_of(tmp_path, *materials: Material) -> Scene:
    """A unit square in the xy plane of the first material, st being x and y."""
    return dataclasses.replace(load(stage(grey(tmp_path))), materials=materials)


def bilinear(texels: np.ndarray, st: np.ndarray) -> np.ndarray:
    """At texture coordinates within [0, 1], shape (n, 2), the columns repeated and the rows mirrored."""
    rows, columns = texels.shape[:2]
    x, y = st[:, :1] * columns - 0.5, (1.0 - st[:, 1:]) * rows - 0.5
    left, upper = np.floor(x).astype(int), np.floor(y).astype(int)

    def row(i: np.ndarray) -> np.ndarray:
        one, other = (texels[np.clip(i, 0, rows - 1), (left + k) % columns][:, 0] for k in (0, 1))
        return one + (other - one) * (x - left)

    return row(upper) + (row(upper + 1) - row(upper)) * (y - upper)


def test_each_input_has_the_values_of_its_own_picture(tmp_path):
    seen = seen_at(scene_of(tmp_path, MATERIAL), POINTS)
    bytes_of = {name: pixels / 255.0 for name, pixels in {"packed": PACKED, "coat": COAT}.items()}
    np.testing.assert_allclose(seen["diffuse"], bilinear(srgb_to_linear(COLOR / 255.0), POINTS), atol=2e-5)
    np.testing.assert_allclose(seen["alpha"], bilinear(bytes_of["packed"], POINTS)[:, 1] ** 2, atol=2e-5)
    np.testing.assert_allclose(seen["opacity"], bilinear(bytes_of["packed"], POINTS)[:, 3], atol=2e-5)
    np.testing.assert_allclose(seen["coat"], bilinear(bytes_of["coat"], POINTS)[:, 0], atol=2e-5)
    normal = bilinear(BUMPS, POINTS)
    np.testing.assert_allclose(seen["normal"], normal / np.linalg.norm(normal, axis=1, keepdims=True), atol=2e-5)


@pytest.mark.parametrize(
    ("pixels", "encoding"),
    [
        (COLOR[..., :1], BYTES),
        (RANDOM.random((5, 7, 3)).astype(np.float16).astype(np.float32), HALVES),
        ((RANDOM.integers(0, 65536, (5, 7, 3)) / 65535.0).astype(np.float32), SHORTS),
        (RANDOM.random((5, 7, 3)).astype(np.float32), FLOATS),
    ],
)
def test_each_encoding_has_the_values_of_its_picture(tmp_path, pixels, encoding):
    """Beside other pictures, so that values begin within words."""
    material = dataclasses.replace(
        MATERIAL, diffuse_color=lookup(pixels), metallic=lookup(pixels[..., -1:].copy(), "r")
    )
    scene = scene_of(tmp_path, material)
    assert encoding in {tile.encoding for tile in material_tables(scene).tiles}
    values = pixels / 255.0 if pixels.dtype == np.uint8 else pixels
    seen = seen_at(scene, POINTS)
    expected = bilinear(np.broadcast_to(values, (*values.shape[:2], 3)), POINTS)
    np.testing.assert_allclose(seen["diffuse"], expected, atol=2e-5)


def test_texels_of_one_place_stand_side_by_side(tmp_path):
    """Three words of floats, one of the colour and the packed picture's g, one of its a; the other size is apart."""
    tables = material_tables(scene_of(tmp_path, MATERIAL))
    strides = [tables.tiles[view.tile].stride for view in tables.lookups]
    assert sorted(strides) == [1, 5, 5, 5, 5]
    assert len({tables.tiles[view.tile].first for view in tables.lookups}) == 2
    assert sum(not view.reuses_footprint for view in tables.lookups) == 2  # places that are computed


def test_picture_that_stands_already_is_stored_once_and_read_where_it_is(tmp_path):
    gloss = RANDOM.integers(0, 256, (5, 7, 1), np.uint8)
    second = Material(diffuse_color=lookup(COLOR, is_srgb=True), roughness=lookup(gloss, "r"))
    both = material_tables(scene_of(tmp_path, MATERIAL, second))
    assert both.texels.words == material_tables(scene_of(tmp_path, MATERIAL)).texels.words + 8 * 8
    seen = seen_at(scene_of(tmp_path, dataclasses.replace(second, metallic=0.0), MATERIAL), POINTS)
    np.testing.assert_allclose(seen["diffuse"], bilinear(srgb_to_linear(COLOR / 255.0), POINTS), atol=2e-5)


@pytest.mark.parametrize("change", [{"wrap_s": "clamp"}, {"transform": ((2.0, 0.0, 0.0), (0.0, 1.0, 0.0))}])
def test_other_places_are_computed_anew(tmp_path, change):
    rough = dataclasses.replace(MATERIAL.roughness, **change)
    tables = material_tables(scene_of(tmp_path, dataclasses.replace(MATERIAL, roughness=rough)))
    assert sum(not view.reuses_footprint for view in tables.lookups) == 3


def test_frames_with_equal_pictures_share_their_texels_on_the_device(tmp_path):
    """A frame is read anew, other arrays with the same contents; one byte that differs is another picture."""
    uploads = Uploads()
    first = upload(scene_of(tmp_path, MATERIAL), "cpu", uploads=uploads)
    texels = uploads.texels.made
    rough = lookup(PACKED.copy(), "g")
    again = dataclasses.replace(
        MATERIAL, roughness=rough, opacity=dataclasses.replace(rough, channels="a"), metallic=0.7
    )
    second = upload(scene_of(tmp_path, again), "cpu", uploads=uploads)
    assert uploads.texels.made is texels
    assert first.owned[-1].texels.ptr == second.owned[-1].texels.ptr == texels.ptr
    changed = COLOR.copy()
    changed[2, 3, 1] ^= 1
    other = dataclasses.replace(again, diffuse_color=lookup(changed, is_srgb=True))
    upload(scene_of(tmp_path, other), "cpu", uploads=uploads)
    assert np.count_nonzero(uploads.texels.made.numpy() != texels.numpy()) == 1
