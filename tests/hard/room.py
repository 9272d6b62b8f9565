"""A room with a light of every kind: what must look the same wherever it stands, however large it is."""

from __future__ import annotations

from typing import Any

from hard.parts import XFORM, box, light, mesh, number, placed, stage, vector

LAMPS: list[dict[str, Any]] = [
    {"kind": "RectLight", "at": (-0.4, 0.9, 0.1), "rotate": (-90, 20, 0), "width": 0.4, "height": 0.3, "strength": 3.0},
    {"kind": "DiskLight", "at": (0.5, 0.8, -0.3), "rotate": (-70, 0, 10), "radius": 0.15, "strength": 1.0},
    {"kind": "SphereLight", "at": (0.3, 0.2, 0.5), "rotate": (0, 0, 0), "radius": 0.05, "strength": 0.5},
    {
        "kind": "CylinderLight",
        "at": (-0.2, 0.7, -0.6),
        "rotate": (0, 30, 0),
        "radius": 0.02,
        "length": 0.7,
        "strength": 1.0,
    },
]


def lamps(size: float, order: Any) -> str:
    """Normalised, and so much stronger as the room is larger that it is as bright."""
    text = ""
    for k in order:
        lamp = LAMPS[k]
        sizes = {key: lamp[key] * size for key in ("width", "height", "radius", "length") if key in lamp}
        place = [value * size for value in lamp["at"]]
        strength = lamp["strength"] * size**2
        text += light(lamp["kind"], f"Lamp{k}", place, lamp["rotate"], intensity=strength, normalize=True, **sizes)
    return text


def room(
    size: float = 1.0,
    at: Any = (0.0, 0.0, 0.0),
    mirror: float = 1.0,
    order: Any = (0, 1, 2, 3),
    faces_reversed: bool = False,
) -> Any:
    """Walls, a block, two cards that cross, and the lamps.

    Args:
        size: half its width; all of it is authored at that size, without a transform.
        at: where it stands.
        mirror: -1 for its mirror image, which a mirrored camera sees.
        order: of the lamps.
        faces_reversed: the faces of the block in the opposite order.
    """
    cards = [(-0.6, -0.9, 0.3), (-0.1, -0.9, 0.5), (-0.1, 0.1, 0.5), (-0.6, 0.1, 0.3)]
    cards += [(-0.3, -0.9, 0.1), (-0.4, -0.9, 0.7), (-0.4, 0.0, 0.7), (-0.3, 0.0, 0.1)]
    corners = [(0.2 + 0.5 * x, -0.95 + 0.8 * y, -0.5 + 0.4 * z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    block = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    camera = f"""
def Camera "Camera" {{
    float focalLength = 1
    float horizontalAperture = 1.6
    float verticalAperture = 1.6
    {placed((0.1 * size, 0.1 * size, 0.95 * size), (-8, 3, 0))}
}}
"""
    parts = [
        box(size, color=0.5),
        mesh("Cards", [[value * size for value in point] for point in cards], [(0, 1, 2, 3), (4, 5, 6, 7)], 0.7),
        mesh(
            "Block",
            [[value * size for value in point] for point in corners],
            block[:: -1 if faces_reversed else 1],
            0.3,
        ),
        lamps(size, order),
        camera,
    ]
    move = f"double3 xformOp:translate = {vector(at)}\n    double3 xformOp:scale = ({number(mirror)}, 1, 1)"
    order_text = XFORM.replace("xformOp:rotateXYZ", "xformOp:scale")
    return stage(f'def Xform "All" {{\n    {move}\n    {order_text}\n' + "".join(parts) + "}\n")
