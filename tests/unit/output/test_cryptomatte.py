"""Cryptomatte: hashes, ranks and files, read back by another's decoder where it is installed, and by this file's own.

The decoder here follows the specification, and shares no code with the writer.
"""

from __future__ import annotations

import json
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
import scenes

import warpmis
from warpmis.output.cryptomatte import RANKS, Coverage, id_of, mean_coverage, murmur3, ranked
from warpmis.scene import Material, Scene

PANE = Material(path="/pane", diffuse_color=(0.5, 0.5, 0.5), opacity=0.25, lambertian=True)


@pytest.mark.parametrize(
    ("text", "seed", "hash_"),
    [
        ("", 0, 0x00000000),
        ("", 1, 0x514E28B7),
        ("test", 0, 0xBA6BD213),
        ("Hello, world!", 0, 0xC0363E43),
        ("The quick brown fox jumps over the lazy dog", 0, 0x2E4FF723),
    ],
)
def test_hashes_are_murmur3(text: str, seed: int, hash_: int) -> None:
    assert murmur3(text.encode(), seed) == hash_


def test_ids_are_bits_of_usual_floats() -> None:
    for number in range(20_000):
        value = struct.unpack("<f", struct.pack("<I", id_of(f"/World/prim_{number}")))[0]
        assert np.isfinite(value) and abs(value) >= np.finfo(np.float32).tiny


def test_ranks_are_sums_in_order() -> None:
    ids = np.array([[7, 3, 7, 0, 9, 1, 2, 4, 5]], np.uint32)
    shares = np.array([[0.1, 0.3, 0.1, 0.0, 0.3, 0.01, 0.02, 0.04, 0.05]], np.float32)
    top, sums = ranked(ids, shares)
    assert top.tolist() == [[3, 9, 7, 5, 4, 2]]
    np.testing.assert_allclose(sums, [[0.3, 0.3, 0.2, 0.05, 0.04, 0.02]])
    assert ranked(np.zeros((1, 9), np.uint32), shares)[1].sum() == 0.0


def test_the_mean_of_two_times_has_both_names() -> None:
    def still(name: str) -> tuple[Coverage, ...]:
        ids, shares = np.zeros((1, 1, RANKS), np.uint32), np.zeros((1, 1, RANKS), np.float32)
        ids[..., 0], shares[..., 0] = id_of(name), 1.0
        return (Coverage("CryptoObject", (name,), ids, shares),)

    (mean,) = mean_coverage([still("/a"), still("/b")])
    assert mean.names == ("/a", "/b")
    assert set(mean.ids[0, 0, :2].tolist()) == {id_of("/a"), id_of("/b")}
    assert mean.shares[0, 0].tolist() == [0.5, 0.5, 0.0, 0.0, 0.0, 0.0]


def room(pixels: int = 24) -> Scene:
    """A room without a wall at the camera, a pane of opacity 0.25 in it."""
    base = scenes.open_room(pixels)
    walls = scenes.box_faces((-1, 0, -1), (1, 2, 1), inward=True)
    faces = [(wall, m) for wall, m in zip(walls, [0, 0, 2, 0, 1, -1], strict=True) if m >= 0]
    faces.append((scenes.box_faces((-0.3, 0.5, -0.5), (0.3, 1.3, -0.2), inward=False)[2], 3))
    materials = [*base.materials, PANE]
    return scenes.scene(scenes.quads(faces), materials, list(base.lights), base.camera, pixels)


def decoded(path: Path, layer: str) -> dict[str, Any]:
    """The mattes of a layer by name, shape (H, W), by the specification's section on decoding."""
    file = OpenEXR.File(str(path), separate_channels=True)
    header, channels = file.header(), file.channels()
    (key,) = {name.split("/")[1] for name, value in header.items() if name.endswith("/name") and value == layer}
    assert header[f"cryptomatte/{key}/hash"] == "MurmurHash3_32"
    assert header[f"cryptomatte/{key}/conversion"] == "uint32_to_float32"
    manifest = json.loads(header[f"cryptomatte/{key}/manifest"])
    mattes = {}
    for name, text in manifest.items():
        wanted = struct.unpack(">f", bytes.fromhex(text))[0]
        matte = 0.0
        for index in range(3):
            planes = [channels[f"{layer}{index:02}.{letter}"].pixels for letter in "RGBA"]
            matte = matte + np.where(planes[0] == wanted, planes[1], 0) + np.where(planes[2] == wanted, planes[3], 0)
        mattes[name] = matte
    return mattes


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> tuple[warpmis.RenderResult, Path]:
    path = tmp_path_factory.mktemp("cryptomatte") / "a.exr"
    result = warpmis.render(room(), method="nee", spp=16, cryptomatte=True)
    result.write(path)
    return result, path


def assert_room(mattes: dict[str, Any]) -> None:
    pane = mattes["/pane"]
    assert pane.max() == pytest.approx(0.25)  # where nothing but the pane and what is behind it is seen
    edge = (pane > 0.0) & (pane < 0.25 - 1e-6)
    assert edge.any() and edge.sum() < (pane > 0.0).sum()
    total = sum(mattes.values())
    np.testing.assert_allclose(total[:, :12], 1.0, atol=1e-6)
    assert total[:, -1].min() == 0.0 and total.max() < 1.0 + 1e-6  # one wall is missing there
    assert set(mattes) == {"/white", "/red", "/metal", "/pane"}


def test_mattes_by_the_specification(written: tuple[warpmis.RenderResult, Path]) -> None:
    for layer in ("CryptoObject", "CryptoMaterial"):
        assert_room(decoded(written[1], layer))


def test_mattes_by_an_independent_decoder(written: tuple[warpmis.RenderResult, Path]) -> None:
    library = pytest.importorskip("cryptomatte_api")
    found = library.Cryptomatte.load(str(written[1]))
    assert sorted(one.metadata().name() for one in found) == ["CryptoMaterial", "CryptoObject"]
    for one in found:
        assert one.num_levels() == RANKS
        mattes = one.masks()
        assert_room(mattes)
        mine = decoded(written[1], one.metadata().name())
        for name, matte in mattes.items():
            np.testing.assert_allclose(matte, mine[name], atol=1e-6)


def test_same_bits_for_any_threads_and_the_picture_stays(written: tuple[warpmis.RenderResult, Path]) -> None:
    one = warpmis.render(room(), method="nee", spp=16, cryptomatte=True, threads=1)
    for mine, other in zip(one.cryptomatte, written[0].cryptomatte, strict=True):
        np.testing.assert_array_equal(mine.ids, other.ids)
        np.testing.assert_array_equal(mine.shares, other.shares)
    np.testing.assert_array_equal(one.image, warpmis.render(room(), method="nee", spp=16).image)


def test_of_a_pixel_with_nothing_there_is_nothing() -> None:
    up = replace(room(), camera=scenes.camera((0, 1, 5), (0, 1, 9)))
    for one in warpmis.render(up, method="nee", spp=4, cryptomatte=True).cryptomatte:
        assert not one.ids.any() and not one.shares.any()
