"""Where an image node of MaterialX looks: a primvar of texture coordinates, and the affine map that they go through."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import UsdShade

from warpmis.usd.materials.pattern import Pattern, constant, coordinates, evaluated
from warpmis.usd.materials.pattern_network import PatternNetwork
from warpmis.usd.materials.shading_network import MAX_TRANSFORMS, Transform, is_input
from warpmis.usd.shapes.primvar import PrimvarRead

TEXCOORD_SETS = ("st", "st1", "st2", "st3")
Matrix = NDArray[np.float64]


def texture_coordinates(network: PatternNetwork, node: Any, tiled: bool) -> tuple[int, Transform]:
    """Column of an image node's coordinates, and their map.

    Args:
        tiled: whether the node is a tiledimage, which looks at (st uvtiling - uvoffset) tile size / image size.
    """
    read, matrix = _coordinates(network, node, "texcoord", 0)
    if tiled:
        size = _pair(network, node, "realworldtilesize", 1.0) / _pair(network, node, "realworldimagesize", 1.0)
        tiling, offset = _pair(network, node, "uvtiling", 1.0), _pair(network, node, "uvoffset", 0.0)
        matrix = _scaled(*size) @ _moved(*-offset) @ _scaled(*tiling) @ matrix
    return network.columns.column(read), transform_of(matrix)


def coordinate_pattern(network: PatternNetwork, node: Any, kind: str) -> Pattern | None:
    """What a node of coordinates gives, of two components; None for one that is not known."""
    found = _known(network, node, kind, 0)
    if found is None:
        return None
    read, matrix = found
    if not read.name:
        return constant((matrix @ np.array([*read.fallback, 1.0]))[:2])
    plain = coordinates(network.columns.column(read))
    scale, offset = matrix[:2, :2], matrix[:2, 2]
    if scale[0, 1] == scale[1, 0] == 0.0:
        return plain * constant(np.diag(scale)) + constant(offset)
    return evaluated(lambda st: st @ scale.T.astype(np.float32) + offset.astype(np.float32), [plain])


def transform_of(matrix: Matrix) -> Transform:
    """The two rows of a map, 0 where they are not finite."""
    (a, b, c), (d, e, f) = np.nan_to_num(matrix[:2], nan=0.0, posinf=0.0, neginf=0.0).tolist()
    return (a, b, c), (d, e, f)


def _coordinates(network: PatternNetwork, node: Any, name: str, depth: int) -> tuple[PrimvarRead, Matrix]:
    """The primvar that an input comes from, and its map as a matrix of homogeneous columns, shape (3, 3)."""
    attribute = network.source(node, name)
    if attribute is None:
        return PrimvarRead("st", (0.0, 0.0)), np.eye(3)
    if is_input(attribute):
        u, v = network.vector(node, name, 2, (0.0, 0.0))
        return PrimvarRead("", (u, v)), np.eye(3)
    source = UsdShade.Shader(attribute.GetPrim())
    kind = network.kind(source) if source else ""
    found = _known(network, source, kind, depth) if depth < MAX_TRANSFORMS else None
    if found is None:
        network.reading.warn(node.GetPath(), f"its {name} node {kind} is not supported; st is used")
        return PrimvarRead("st", (0.0, 0.0)), np.eye(3)
    return found


def _known(network: PatternNetwork, source: Any, kind: str, depth: int) -> tuple[PrimvarRead, Matrix] | None:
    if kind == "ND_texcoord_vector2":
        index = min(max(int(network.vector(source, "index", 1, (0.0,))[0]), 0), len(TEXCOORD_SETS) - 1)
        return PrimvarRead(TEXCOORD_SETS[index], (0.0, 0.0)), np.eye(3)
    if kind == "ND_geompropvalue_vector2":
        name = str(network.constant(source, "geomprop", "st"))
        u, v = network.vector(source, "default", 2, (0.0, 0.0))
        return PrimvarRead(name, (u, v)), np.eye(3)
    if kind in ("UsdPrimvarReader_float2", "ND_UsdPrimvarReader_vector2"):
        u, v = network.vector(source, "fallback", 2, (0.0, 0.0))
        return PrimvarRead(str(network.constant(source, "varname", "st")), (u, v)), np.eye(3)
    maps = {name: which for name, which in MAPS.items() if kind.startswith(f"ND_{name}_")}
    maps |= {"UsdTransform2d": _preview_transform} if "UsdTransform2d" in kind else {}
    if not maps:
        return None
    (which,) = maps.values()
    entrance = "texcoord" if kind.startswith("ND_place2d") else "in"
    if kind.startswith(ARITHMETIC):
        entrance = "in1" if network.node(source, "in1") is not None else "in2"
        if entrance == "in2" and kind.startswith(("ND_divide", "ND_subtract")):
            return None
    read, before = _coordinates(network, source, entrance, depth + 1)
    return read, which(network, source) @ before


def _pair(network: PatternNetwork, node: Any, name: str, default: float) -> NDArray[np.float64]:
    """Two numbers, or one for both."""
    return np.array(network.vector(node, name, 2, (default, default)))


def _other(network: PatternNetwork, node: Any, default: float) -> NDArray[np.float64]:
    """The numbers that a node of arithmetic has beside the coordinates."""
    return _pair(network, node, "in2" if network.node(node, "in1") is not None else "in1", default)


def _scaled(s: float, t: float) -> Matrix:
    return np.diag([s, t, 1.0])


def _moved(s: float, t: float) -> Matrix:
    return np.array([[1.0, 0.0, s], [0.0, 1.0, t], [0.0, 0.0, 1.0]])


def _turned(degrees: float) -> Matrix:
    """Coordinates turned clockwise, which turns the picture counter-clockwise."""
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def _place2d(network: PatternNetwork, node: Any) -> Matrix:
    """Around a pivot: scaled, turned, moved; or, by operationorder 1, moved, turned, scaled."""
    pivot, offset = _pair(network, node, "pivot", 0.0), _pair(network, node, "offset", 0.0)
    with np.errstate(divide="ignore"):
        scale = _scaled(*(1.0 / _pair(network, node, "scale", 1.0)))
    turned, moved = _turned(network.vector(node, "rotate", 1, (0.0,))[0]), _moved(*-offset)
    order = network.vector(node, "operationorder", 1, (0.0,))[0]
    inner = scale @ turned @ moved if order == 1.0 else moved @ turned @ scale
    return _moved(*pivot) @ inner @ _moved(*-pivot)


def _preview_transform(network: PatternNetwork, node: Any) -> Matrix:
    angle = network.vector(node, "rotation", 1, (0.0,))[0]
    moved = _moved(*_pair(network, node, "translation", 0.0))
    return moved @ _turned(-angle) @ _scaled(*_pair(network, node, "scale", 1.0))


ARITHMETIC = ("ND_multiply_", "ND_divide_", "ND_add_", "ND_subtract_")
MAPS: dict[str, Callable[[PatternNetwork, Any], Matrix]] = {
    "place2d": _place2d,
    "rotate2d": lambda network, node: _turned(network.vector(node, "amount", 1, (0.0,))[0]),
    "dot": lambda network, node: np.eye(3),
    "multiply": lambda network, node: _scaled(*_other(network, node, 1.0)),
    "divide": lambda network, node: _scaled(*(1.0 / _other(network, node, 1.0))),
    "add": lambda network, node: _moved(*_other(network, node, 0.0)),
    "subtract": lambda network, node: _moved(*-_other(network, node, 0.0)),
}
