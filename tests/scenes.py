"""Scenes for tests, built from plain arrays: no USD needed."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from warpmis.scene import Camera, DomeLight, Light, Material, Prim, RectLight, Scene, SphereLight
from warpmis.scene.geometry import Geometry

USD_SCENES = Path(__file__).parent.parent / "usd_scenes"

WHITE = Material(path="/white", diffuse_color=(0.7, 0.7, 0.7), lambertian=True)
RED = Material(path="/red", diffuse_color=(0.6, 0.1, 0.1), lambertian=True)
METAL = Material(path="/metal", diffuse_color=(0.9, 0.8, 0.6), metallic=1.0, roughness=0.3)


def box_faces(low, high, inward: bool) -> np.ndarray:
    """The six quads of an axis-aligned box, shape (6, 4, 3)."""
    x0, y0, z0 = low
    x1, y1, z1 = high
    faces = np.array(
        [
            [(x0, y0, z1), (x1, y0, z1), (x1, y0, z0), (x0, y0, z0)],
            [(x0, y1, z0), (x1, y1, z0), (x1, y1, z1), (x0, y1, z1)],
            [(x0, y0, z0), (x1, y0, z0), (x1, y1, z0), (x0, y1, z0)],
            [(x1, y0, z1), (x0, y0, z1), (x0, y1, z1), (x1, y1, z1)],
            [(x0, y0, z1), (x0, y0, z0), (x0, y1, z0), (x0, y1, z1)],
            [(x1, y0, z0), (x1, y0, z1), (x1, y1, z1), (x1, y1, z0)],
        ],
        dtype=np.float32,
    )
    return faces if inward else faces[:, ::-1]


def quads(faces: list[tuple[np.ndarray, int]]) -> Geometry:
    """Geometry of quads, each with the index of its material; the prim's index is the material's."""
    points = np.array([face for face, _ in faces], dtype=np.float32).reshape(-1, 3)
    corner = 4 * np.arange(len(faces))[:, None, None]
    triangles = (corner + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3).astype(np.int32)
    materials = np.repeat([material for _, material in faces], 2).astype(np.int32)
    return Geometry(
        points=points,
        triangles=triangles,
        normals=np.zeros((0, 3), dtype=np.float32),
        normal_indices=np.full((len(triangles), 3), -1, dtype=np.int32),
        materials=materials,
        prims=materials.copy(),
    )


def camera(position, target, half_width: float = 0.5) -> Camera:
    """A pinhole camera with a square picture, +Y up."""
    position, target = np.asarray(position, dtype=float), np.asarray(target, dtype=float)
    forward = (target - position) / np.linalg.norm(target - position)
    side = np.cross(forward, (0.0, 1.0, 0.0) if abs(forward[1]) < 0.999 else (0.0, 0.0, -1.0))
    side /= np.linalg.norm(side)
    window = (-half_width, half_width, -half_width, half_width)
    return Camera("/camera", position, side, np.cross(side, forward), forward, window)


def scene(geometry: Geometry, materials: list[Material], lights: list[Light], view: Camera, pixels: int = 16) -> Scene:
    prims = tuple(Prim(material.path) for material in materials)
    return Scene("test", view, (pixels, pixels), geometry, tuple(materials), prims, tuple(lights))


def room(pixels: int = 16) -> Scene:
    """A closed room with a lamp under its ceiling and a metal wall."""
    walls = box_faces((-1, 0, -1), (1, 2, 1), inward=True)
    faces = list(zip(walls, [0, 0, 2, 0, 1, 0], strict=True))
    lamp = RectLight(
        "/lamp", np.array([0, 1.9, 0]), np.array([0.3, 0, 0]), np.array([0, 0, -0.3]), np.array([9.0, 8.0, 7.0])
    )
    view = camera((0, 1, 0.95), (0, 0.8, -1), half_width=0.8)
    return scene(quads(faces), [WHITE, RED, METAL], [lamp], view, pixels)


def hidden_light(pixels: int = 16) -> Scene:
    """The room with a second, stronger lamp shut in a white box: no light of it ever comes out.

    A direction towards that lamp finds the box's lit outer side: a light density without the hidden lamp is a bias.
    """
    base = room(pixels)
    walls = box_faces((-1, 0, -1), (1, 2, 1), inward=True)
    crate = box_faces((-0.5, 0.2, -0.6), (0.3, 0.9, 0.1), inward=False)
    faces = list(zip(walls, [0, 0, 2, 0, 1, 0], strict=True)) + [(face, 0) for face in crate]
    shut_in = SphereLight("/shut_in", np.array([-0.1, 0.55, -0.25]), 0.3, np.array([30.0, 30.0, 30.0]))
    return scene(quads(faces), list(base.materials), [*base.lights, shut_in], base.camera, pixels)


def lit_ceiling(pixels: int = 12, lamp: float = 20.0) -> Scene:
    """A grey room's floor, lit faintly by a small lamp (of that radiance) and strongly by the ceiling that another
    lamp shines at.

    Direct light alone is best found by sampling the lamps, but most light comes from where no lamp is. No lamp is in
    view, and all colours are alike: the variance of luminance is that of F.
    """
    grey = Material(path="/grey", diffuse_color=(0.7, 0.7, 0.7), lambertian=True)
    up = RectLight("/up", np.array([0, 1.5, 0]), np.array([0.3, 0, 0]), np.array([0, 0, 0.3]), np.full(3, 20.0))
    down = RectLight("/down", np.array([0.6, 1.9, 0]), np.array([0.1, 0, 0]), np.array([0, 0, -0.1]), np.full(3, lamp))
    faces = [(wall, 0) for wall in box_faces((-1, 0, -1), (1, 2, 1), inward=True)]
    return scene(quads(faces), [grey], [up, down], camera((0, 1.2, 0.9), (0, 0, -0.2), half_width=0.4), pixels)


def open_room(pixels: int = 16) -> Scene:
    """The room without the wall behind the camera, a dome outside: every strategy has something to find."""
    base = room(pixels)
    walls = box_faces((-1, 0, -1), (1, 2, 1), inward=True)
    geometry = quads(
        [(wall, material) for wall, material in zip(walls, [0, 0, 2, 0, 1, -1], strict=True) if material >= 0]
    )
    dome = DomeLight("/sky", np.eye(3), np.array([0.4, 0.5, 0.6]))
    return scene(geometry, list(base.materials), [*base.lights, dome], base.camera, pixels)
