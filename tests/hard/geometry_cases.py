"""Hard geometry: broken, degenerate, very small, very large and far away. A floor is lit to E = 1 at the origin."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from hard.case import HardCase
from hard.closed_meshes import cube
from hard.parts import camera, floor, grey, light, mesh, placed, scattered, stage

VIEW = camera()
# At no angle to the axes at which both roundings are alike.
AT_EDGE = camera((0, 0.37, 0.61), -math.degrees(math.atan2(0.37, 0.61)), 1e-6)
LAMP = light("SphereLight", radius=0.1, intensity=4.0, normalize=True)
SQUARE = [(-1, 0, 1), (1, 0, 1), (1, 0, -1), (-1, 0, -1)]


def lit(*parts: str) -> Callable[[], Any]:
    return lambda: stage(VIEW, LAMP, *parts)


def within(transform: str, *parts: str) -> Callable[[], Any]:
    """Everything below one transform, the camera and the lamp too."""
    return lambda: stage(f'def Xform "All" {{\n{transform}\n' + "".join(parts) + "}\n")


def moved(by: float) -> Callable[[], Any]:
    return within(placed((by, -2.0 * by, by / 3.0)), floor(), VIEW, LAMP)


def scaled(by: float, *parts: str, view: str = VIEW) -> Callable[[], Any]:
    """The lamp's intensity grows as its distance squared."""
    lamp = light("SphereLight", radius=0.1, intensity=4.0 * by**2, normalize=True)
    transform = f'double3 xformOp:scale = ({by!r}, {by!r}, {by!r})\nuniform token[] xformOpOrder = ["xformOp:scale"]'
    return within(transform, *(parts or (floor(),)), view, lamp)


def transformed(rows: Any, *parts: str, name: str = "Turned") -> str:
    """An Xform by the 3 x 3 matrix of a row-vector convention."""
    matrix = np.eye(4)
    matrix[:3, :3] = rows
    text = ", ".join("(" + ", ".join(repr(float(x)) for x in row) + ")" for row in matrix)
    order = 'uniform token[] xformOpOrder = ["xformOp:transform"]'
    return f'def Xform "{name}" {{\nmatrix4d xformOp:transform = ({text})\n{order}\n' + "".join(parts) + "}\n"


def edge_seen_from_inside() -> str:
    """A closed white box of which the camera, within it, sees a piece of an edge alone."""
    points, triangles = cube(8)
    return mesh("Box", np.add(points, (0.0, 1.0, 1.0)), triangles, 1.0)


def needles(count: int = 2000, width: float = 1e-7) -> str:
    """Strips 2 long and 1e-7 wide about the origin, with the rest of the floor beside them."""
    edges = np.concatenate([[-1.0], (np.arange(count + 1) - count / 2) * width, [1.0]])
    points = [(x, 0.0, z) for z in edges for x in (-1.0, 1.0)]
    faces = [(2 * k, 2 * k + 2, 2 * k + 3, 2 * k + 1) for k in range(len(edges) - 1)]
    return mesh("Needles", points, faces)


def fan(count: int = 10_000) -> str:
    """The floor as a fan of triangles about the one vertex that the camera sees."""
    angle = 2.0 * math.pi * np.arange(count) / count
    points = [(0.0, 0.0, 0.0), *zip(np.cos(angle), np.zeros(count), -np.sin(angle), strict=True)]
    return mesh("Fan", points, [(0, 1 + k, 1 + (k + 1) % count) for k in range(count)])


def patchwork(side: int = 128, cell: float = 1e-6) -> str:
    """A floor little larger than the camera sees, of cells so small that, scaled by 1e-6, edges are 1e-12 long."""
    steps = (np.arange(side + 1) - side / 2) * cell
    points = [(x, 0.0, z) for z in steps for x in steps]
    row = side + 1
    corners = [row * j + i for j in range(side) for i in range(side)]
    faces = [(k, k + row, k + row + 1, k + 1) for k in corners]
    return mesh("Patchwork", points, faces)


FAR = (
    "at 1e6 of a scene's size float32 keeps four digits of a position",
    "everything is moved to the origin in float64 at load (usd/origin.py; pbrt-v4, section 5.1.1)",
)
LEFT_OUT = "refused with a warning: the faces are left out, the rest is rendered (usd/mesh.py)"
FAN_OF_BAD = [*SQUARE, (math.nan, 0.5, 0.0), (math.inf, 0.5, 0.2), (0.3, 0.5, -math.inf)]

GEOMETRY_CASES = [
    HardCase(
        "zero-area-triangles",
        trouble="their normal is 0 / 0",
        remedy="left out when they are placed (usd/geometry.py: GeometryBuilder)",
        build=lit(mesh("Floor", [*SQUARE, (0, 0, 0)], [(0, 1, 2, 3), (0, 4, 2), (4, 4, 1), (4, 4, 4)])),
        mean=scattered(1.0),
    ),
    HardCase(
        "needles",
        trouble="edge tests in float32 leave gaps between triangles 1e-7 wide",
        remedy="a watertight triangle test (Woop, Benthin, Wald 2013), in boxes grown by rounding (device/mesh.py)",
        build=lit(needles()),
        mean=scattered(1.0),
    ),
    HardCase(
        "duplicated-faces",
        trouble="a ray that leaves one copy meets the other; splits of the tree separate nothing",
        remedy="rays start off the surface by more than rounding (kernels/hit.py: OFFSET; Waechter, Binder 2019)",
        build=lit(mesh("Floor", SQUARE, [(0, 1, 2, 3)] * 1000)),
        mean=scattered(1.0),
    ),
    HardCase(
        "coplanar-surfaces",
        trouble="each is in the other's shadow at random",
        remedy="the same offset",
        build=lit(floor(), floor(0.7, name="Carpet"), floor(0.31, name="Rug")),
        mean=scattered(1.0),
    ),
    HardCase(
        "vertex-of-10000-faces",
        trouble="a ray through the vertex misses all its faces",
        remedy="a watertight triangle test, in boxes grown by rounding",
        build=lit(fan()),
        mean=scattered(1.0),
    ),
    HardCase(
        "dark-box-under-a-bright-sky",
        trouble="one in a hundred of the rays at a closed box's edges gets out, and brings in the sky",
        remedy="boxes grown by rounding (device/mesh.py; Ize 2013); points on an edge keep off the neighbour's plane",
        build=lambda: stage(AT_EDGE, edge_seen_from_inside(), light("DomeLight", "Sky", intensity=1e9)),
        mean=grey(0.0),
        settings={"max_depth": 8},
        learns=False,
    ),
    HardCase(
        "nan-and-infinite-points",
        trouble="one NaN spoils the tree's boxes, and all rays miss",
        remedy=LEFT_OUT,
        build=lit(mesh("Floor", FAN_OF_BAD, [(0, 1, 2, 3), (0, 1, 4), (1, 5, 2), (2, 3, 6)])),
        mean=scattered(1.0),
    ),
    HardCase(
        "indices-out-of-range",
        trouble="reads beyond the points' array",
        remedy=LEFT_OUT,
        build=lit(mesh("Floor", SQUARE, [(0, 1, 2, 3), (0, 1, 77), (-1, 1, 2), (2**31 - 1, 0, 1)])),
        mean=scattered(1.0),
    ),
    HardCase(
        "empty-meshes",
        trouble="a tree of nothing",
        remedy="faces without points are refused with a warning; a tree of nothing gets a triangle far away",
        build=lit(mesh("Empty", [], []), mesh("Points", SQUARE, []), mesh("Faces", [], [(0, 1, 2)])),
        mean=grey(0.0),
        learns=False,
    ),
    HardCase(
        "zero-scale",
        trouble="a singular matrix has no inverse to carry normals with",
        remedy="cofactors instead (usd/geometry.py); what has no area left is left out",
        build=lit(
            transformed(np.diag([1.0, 0.0, 1.0]), floor(), 'def Cube "Gone" {\n    float size = 1e-9\n}\n'),
            transformed(np.zeros((3, 3)), 'def Sphere "Gone" {\n}\n', name="Nothing"),
        ),
        mean=scattered(1.0),
    ),
    HardCase(
        "negative-scale",
        trouble="the winding turns and the normals point inwards",
        remedy="a mirrored surface is wound the other way (usd/geometry.py)",
        build=lit(transformed(np.diag([-1.0, -1.0, 1.0]), floor())),
        mean=scattered(1.0),
    ),
    HardCase(
        "shear",
        trouble="normals carried as points are leave the surface",
        remedy="cofactors (usd/geometry.py)",
        build=lit(transformed([[1.0, 0.0, 3.0], [40.0, 1.0, -70.0], [0.0, 0.0, 1.0]], floor())),
        mean=scattered(1.0),
    ),
    *(
        HardCase(f"scene-moved-by-{by:g}", trouble=FAR[0], remedy=FAR[1], build=moved(by), mean=scattered(1.0))
        for by in (1e3, 1e6, 1e9)
    ),
    *(
        HardCase(
            f"scene-scaled-by-{by:g}",
            trouble="thresholds with a unit of length",
            remedy="there are none: lengths are compared with lengths of the scene",
            build=scaled(by),
            mean=scattered(1.0),
        )
        for by in (1e-6, 1e6)
    ),
    HardCase(
        "scene-scaled-by-1e-6-of-fine-triangles",
        trouble="the cross product of edges 1e-12 long, squared, underflows: no normal, a black surface",
        remedy="normals are computed once, in double (device/mesh.py: front_normals)",
        build=scaled(1e-6, patchwork(), floor(1e-4, -1e-3, "Below", 0.0), view=camera(half_width=2e-5)),
        mean=scattered(1.0),
    ),
]
