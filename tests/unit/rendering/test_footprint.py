"""Bytes per pixel and per triangle are those that docs/effects.md states."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scenes

import warpmis
from warpmis.config import RenderConfig
from warpmis.device.footprint import array_bytes, scene_bytes
from warpmis.device.mesh import watertight_meshes
from warpmis.device.upload import upload
from warpmis.rendering.integrator import Integrator, allocation_of
from warpmis.rendering.specialise import features_of
from warpmis.scene import Material
from warpmis.scene.geometry import Prototype
from warpmis.scene.texture import PrimvarLookup

FILM = 132
# Bytes of a pixel: films, shares, moments.
PER_PIXEL = {"nee": FILM, "balance": FILM + 2 * 4 + 5 * 8, "murray20": 2 * FILM + 2 * 4 + 5 * 8}


def picture_bytes(method: str, pixels: int) -> int:
    scene = scenes.room(pixels)
    config = RenderConfig(method=method)
    device_scene = upload(scene, "cpu")
    run = Integrator(device_scene, features_of(scene, config), config, allocation_of(config, pixels, pixels))
    size = run.bytes()["picture"]
    assert isinstance(size, int)
    return size


@pytest.mark.parametrize("method", PER_PIXEL)
def test_bytes_per_pixel(method: str) -> None:
    grown = picture_bytes(method, 24) - picture_bytes(method, 16)
    assert grown == (24**2 - 16**2) * PER_PIXEL[method]


def grid(cells: int) -> warpmis.Scene:
    """A sheet of cells x cells quads that share their corners: half a point a triangle, but for the border's."""
    x, y = np.meshgrid(np.arange(cells + 1.0), np.arange(cells + 1.0))
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).reshape(-1, 1)
    quads = corner + np.array([0, 1, cells + 2, 0, cells + 2, cells + 1])
    triangles = quads.reshape(-1, 3).astype(np.int32)
    zeros = np.zeros(len(triangles), np.int32)
    geometry = replace(
        scenes.room().geometry,
        points=np.stack([x, y, 0.0 * x], axis=-1).reshape(-1, 3).astype(np.float32),
        triangles=triangles,
        normal_indices=np.full_like(triangles, -1),
        materials=zeros,
        prims=zeros,
    )
    return replace(scenes.room(), geometry=geometry)


def test_bytes_per_triangle() -> None:
    """The corners, the record, a share of the points, and of the tree: 40 for a place in a leaf, and its boxes."""
    small, large = (scene_bytes(upload(grid(cells), "cpu"))["geometry"] for cells in (8, 24))
    triangles = 2 * (24**2 - 8**2)
    tree = (large - small) / triangles - 12 - 32 - 12 * (25**2 - 9**2) / triangles
    assert 40 < tree < 72


def test_bytes_per_triangle_of_the_tree_for_a_gpu() -> None:
    """Three rows of points, and the corners: whatever the triangles share."""
    geometry = grid(24).geometry
    (mesh,), rows = watertight_meshes(geometry.points, geometry.triangles, [0, len(geometry.triangles)], [1.0])
    assert array_bytes([mesh.indices, rows]) == (36 + 12) * 2 * 24**2


def test_bytes_per_instance() -> None:
    """A prototype's triangles once, and of each place its record and its box."""

    def placed(count: int) -> dict[str, int]:
        linear = np.tile(np.eye(3), (count, 1, 1))
        zeros = np.zeros(count, np.int32)
        prototype = Prototype(grid(8).geometry, linear, np.zeros((count, 3)), zeros, zeros)
        return scene_bytes(upload(replace(grid(8), prototypes=(prototype,)), "cpu"))

    none, few, many = scene_bytes(upload(grid(8), "cpu")), placed(3), placed(10)
    assert few["geometry"] == many["geometry"] == 2 * none["geometry"]
    assert many["instances"] - few["instances"] == (10 - 3) * (112 + 24)


def test_bytes_of_ids() -> None:
    """Prim, face and place of each triangle."""
    found = scene_bytes(upload(grid(8), "cpu", ids=True))
    assert found["prims"] + found["ids"] == 12 * len(grid(8).geometry.triangles)


def test_bytes_of_normals_and_primvars() -> None:
    """12 a normal; 12 a triangle for each number that its material reads, at each of three corners."""
    geometry = grid(8).geometry
    count = len(geometry.triangles)
    normals = np.tile(np.float32([0.0, 0.0, 1.0]), (5, 1))
    colored = Material(path="/colored", diffuse_color=PrimvarLookup(0), lambertian=True)
    varied = replace(geometry, normals=normals, primvars=np.zeros((count, 3, 3), np.float32))
    found = scene_bytes(upload(replace(grid(8), geometry=varied, materials=(colored,)), "cpu"))
    assert found["normals"] == 5 * 12
    assert found["primvars"] == 3 * 12 * count
