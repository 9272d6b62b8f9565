"""Parts of which the hard scenes are put together, as text of a layer: floor, camera, lights, materials."""

from __future__ import annotations

import math
from typing import Any

from usd.stages import stage_of

RHO = 0.5  # albedo of the floor
PIXELS = 8

HEADER = f"""(
    upAxis = "Y"
    renderSettingsPrimPath = "/Render/Settings"
)
def Scope "Render" {{
    def RenderSettings "Settings" {{
        uniform int2 resolution = ({PIXELS}, {PIXELS})
    }}
}}
"""

XFORM = 'uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]'


def number(value: float) -> str:
    return repr(float(value))


def vector(values: Any) -> str:
    return "(" + ", ".join(number(value) for value in values) + ")"


def placed(at: Any = (0, 0, 0), rotate: Any = (0, 0, 0)) -> str:
    return f"double3 xformOp:translate = {vector(at)}\n    double3 xformOp:rotateXYZ = {vector(rotate)}\n    {XFORM}"


def camera(at: Any = (0, 0.5, 0.5), rotate_x: float = -45.0, half_width: float = 5e-4) -> str:
    """A pinhole; without arguments it sees the origin alone, for its window is that narrow."""
    return f"""
def Camera "Camera" {{
    float focalLength = 1
    float horizontalAperture = {number(2 * half_width)}
    float verticalAperture = {number(2 * half_width)}
    {placed(at, (rotate_x, 0, 0))}
}}
"""


def mesh(name: str, points: Any, faces: Any, color: float | None = RHO, more: str = "") -> str:
    """Polygons without a material, grey in `color`, or with one that `more` binds."""
    shown = "" if color is None else f"color3f[] primvars:displayColor = [{vector([color] * 3)}]"
    return f"""
def Mesh "{name}" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = {[len(face) for face in faces]}
    int[] faceVertexIndices = {[int(i) for face in faces for i in face]}
    point3f[] points = [{", ".join(vector(point) for point in points)}]
    {shown}
    {more}
}}
"""


def floor(
    half: float = 1.0, height: float = 0.0, name: str = "Floor", color: float | None = RHO, more: str = ""
) -> str:
    points = [(-half, height, half), (half, height, half), (half, height, -half), (-half, height, -half)]
    return mesh(name, points, [(0, 1, 2, 3)], color, more)


def box(half: float, name: str = "Box", color: float | None = RHO, more: str = "") -> str:
    """A closed cube about the origin, of six quads that share their corners."""
    points = [(x * half, y * half, z * half) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return mesh(name, points, faces, color, more)


def light(
    kind: str, name: str = "Lamp", at: Any = (0, 1, 0), rotate: Any = (0, 0, 0), more: str = "", **inputs: Any
) -> str:
    values = [f"float inputs:{key} = {number(value)}" for key, value in inputs.items() if key != "normalize"]
    values.append(f"bool inputs:normalize = {int(bool(inputs.get('normalize', False)))}")
    lines = "\n    ".join(values)
    return f"""
def {kind} "{name}" {{
    {lines}
    {more}
    {placed(at, rotate)}
}}
"""


DOWN = (-90.0, 0.0, 0.0)  # turns a flat light's -Z to -Y
UP = (90.0, 0.0, 0.0)

SKY = light("DomeLight", "Sky", intensity=1.0)


def material(name: str = "Look", **inputs: Any) -> str:
    """A UsdPreviewSurface; diffuseColor and emissiveColor are grey numbers."""
    lines = []
    for key, value in inputs.items():
        if key.endswith("Color"):
            lines.append(f"color3f inputs:{key} = {vector([value] * 3)}")
        elif isinstance(value, str):
            lines.append(f'token inputs:{key} = "{value}"')
        else:
            lines.append(f"float inputs:{key} = {number(value)}")
    body = "\n        ".join(lines)
    return f"""
def Material "{name}" {{
    token outputs:surface.connect = </{name}/Surface.outputs:surface>
    def Shader "Surface" {{
        uniform token info:id = "UsdPreviewSurface"
        {body}
        token outputs:surface
    }}
}}
"""


def bound(name: str = "Look") -> str:
    return f"rel material:binding = </{name}>"


def stage(*parts: str) -> Any:
    return stage_of(HEADER + "".join(parts))


def grey(value: float) -> tuple[float, float, float]:
    return (value, value, value)


def scattered(irradiance: float) -> tuple[float, float, float]:
    """Radiance of the floor under an irradiance."""
    return grey(RHO * irradiance / math.pi)
