"""Where MaterialX's image nodes look, what its ramps and checkerboards show, and its primvars."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from usd.networks import image, node, square
from usd.pictures import write
from usd.points import seen_at
from usd.stages import mentions

from warpmis.scene import Scene

CONNECTED = "color3f inputs:emission_color.connect = </M/X.outputs:out>"
PLACES = np.array([[0.3, 0.4], [0.5, 0.6], [0.7, 0.35], [0.45, 0.55]])


def seen(nodes: str, at: np.ndarray = PLACES, mesh: str = "") -> np.ndarray:
    scene: Scene = square("ND_surface_unlit", CONNECTED, nodes, mesh=mesh)
    assert scene.warnings == ()
    return seen_at(scene, at)["emission"]


def coordinates(tmp_path: Path) -> str:
    """A picture whose red is s and whose green is t, between the centres of the outer texels."""
    centres = (np.arange(64) + 0.5) / 64
    texels = np.zeros((64, 64, 3))
    texels[..., 0], texels[..., 1] = centres[None, :], centres[::-1, None]
    more = """string inputs:uaddressmode = "clamp"
        string inputs:vaddressmode = "clamp"
        float2 inputs:texcoord.connect = </M/P.outputs:out>"""
    return image("X", write(tmp_path / "st.exr", texels), more=more)


def turned(st: np.ndarray, degrees: float) -> np.ndarray:
    """Coordinates turned clockwise."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return st @ np.array([[c, s], [-s, c]]).T


def place2d(order: int) -> str:
    return node("P", "ND_place2d_vector2", f"""float2 inputs:pivot = (0.5, 0.5)
        float2 inputs:scale = (2, 1.5)
        float inputs:rotate = 30
        float2 inputs:offset = (0.1, -0.05)
        int inputs:operationorder = {order}""", "vector2")  # fmt: skip


def test_coordinates_as_they_are(tmp_path) -> None:
    nodes = coordinates(tmp_path) + node("P", "ND_texcoord_vector2", "", "vector2")
    np.testing.assert_allclose(seen(nodes)[:, :2], PLACES, atol=2e-3)


def test_place2d_scales_turns_and_moves_around_its_pivot(tmp_path) -> None:
    scale, offset = np.array([2.0, 1.5]), np.array([0.1, -0.05])
    found = seen(coordinates(tmp_path) + place2d(0))[:, :2]
    np.testing.assert_allclose(found, turned((PLACES - 0.5) / scale, 30) - offset + 0.5, atol=2e-3)
    found = seen(coordinates(tmp_path) + place2d(1))[:, :2]
    np.testing.assert_allclose(found, turned(PLACES - 0.5 - offset, 30) / scale + 0.5, atol=2e-3)


def test_place2d_is_usds_transform_the_other_way_round(tmp_path) -> None:
    """place2d moves the picture, and UsdTransform2d the coordinates."""
    st = node("R", "UsdPrimvarReader_float2", 'string inputs:varname = "st"', "vector2", "result")
    usd = node("P", "UsdTransform2d", """float2 inputs:in.connect = </M/R.outputs:result>
        float inputs:rotation = -30
        float2 inputs:scale = (0.5, 0.5)
        float2 inputs:translation = (0.2, 0.1)""", "vector2")  # fmt: skip
    own = node("P", "ND_place2d_vector2", """float2 inputs:scale = (2, 2)
        float inputs:rotate = 30
        float2 inputs:offset = (-0.2, -0.1)""", "vector2")  # fmt: skip
    np.testing.assert_allclose(seen(coordinates(tmp_path) + own), seen(coordinates(tmp_path) + usd + st), atol=1e-5)


@pytest.mark.parametrize(
    "kind, inputs, expected",
    [
        ("ND_multiply_vector2", "float2 inputs:in2 = (0.5, 0.75)", PLACES * [0.5, 0.75]),
        ("ND_multiply_vector2FA", "float inputs:in2 = 0.5", PLACES * 0.5),
        ("ND_divide_vector2", "float2 inputs:in2 = (2, 4)", PLACES / [2, 4]),
        ("ND_add_vector2", "float2 inputs:in2 = (0.1, 0.2)", PLACES + np.array([0.1, 0.2])),
        ("ND_subtract_vector2", "float2 inputs:in2 = (0.1, 0.2)", PLACES - [0.1, 0.2]),
    ],
)
def test_arithmetic_of_coordinates(tmp_path, kind: str, inputs: str, expected: np.ndarray) -> None:
    st = node("T", "ND_geompropvalue_vector2", 'string inputs:geomprop = "st"', "vector2")
    moved = node("P", kind, f"float2 inputs:in1.connect = </M/T.outputs:out>\n{inputs}", "vector2")
    np.testing.assert_allclose(seen(coordinates(tmp_path) + st + moved)[:, :2], expected, atol=2e-3)


def test_rotate2d(tmp_path) -> None:
    moved = node(
        "P", "ND_rotate2d_vector2", "float2 inputs:in.connect = </M/T.outputs:out>\nfloat inputs:amount = 10", "vector2"
    )
    st = node("T", "ND_texcoord_vector2", "", "vector2")
    np.testing.assert_allclose(seen(coordinates(tmp_path) + st + moved)[:, :2], turned(PLACES, 10), atol=2e-3)


def test_tiledimage_of_a_real_size(tmp_path) -> None:
    """st uvtiling - uvoffset, times the tile's size over the picture's."""
    tiled = """float2 inputs:uvtiling = (0.5, 0.5)
        float2 inputs:uvoffset = (0.1, 0)
        float2 inputs:realworldimagesize = (2, 2)
        float2 inputs:realworldtilesize = (3, 3)
        asset inputs:file"""
    nodes = coordinates(tmp_path).replace("ND_image", "ND_tiledimage").replace("asset inputs:file", tiled)
    nodes += node("P", "ND_texcoord_vector2", "", "vector2")
    np.testing.assert_allclose(seen(nodes)[:, :2], (PLACES * 0.5 - [0.1, 0]) * 1.5, atol=2e-3)


def test_other_coordinates_are_a_warning_and_st(tmp_path) -> None:
    nodes = coordinates(tmp_path) + node("P", "ND_noise2d_vector2", "", "vector2")
    scene = square("ND_surface_unlit", CONNECTED, nodes)
    assert mentions(scene, "/M/X", "ND_noise2d_vector2", "st is used")
    np.testing.assert_allclose(seen_at(scene, PLACES)["emission"][:, :2], PLACES, atol=2e-3)


A, B, C, D = np.array([[1, 0, 0.5], [0, 1, 0.25], [0.5, 0.5, 1], [0.25, 0, 0]])


def colors(**named: np.ndarray) -> str:
    return "\n".join(f"color3f inputs:{name} = {tuple(map(float, color))}" for name, color in named.items())


def test_ramps_are_linear() -> None:
    s, t = PLACES[:, :1], PLACES[:, 1:]
    found = seen(node("X", "ND_ramplr_color3", colors(valuel=A, valuer=B)))
    np.testing.assert_allclose(found, A * (1 - s) + B * s, atol=1e-5)
    found = seen(node("X", "ND_ramptb_color3", colors(valuet=A, valueb=B)))
    np.testing.assert_allclose(found, A * t + B * (1 - t), atol=1e-5)
    found = seen(node("X", "ND_ramp4_color3", colors(valuetl=A, valuetr=B, valuebl=C, valuebr=D)))
    expected = (A * (1 - s) + B * s) * t + (C * (1 - s) + D * s) * (1 - t)
    np.testing.assert_allclose(found, expected, atol=1e-5)


def test_splits_and_checkerboards() -> None:
    found = seen(node("X", "ND_splitlr_color3", colors(valuel=A, valuer=B) + "\nfloat inputs:center = 0.4"))
    np.testing.assert_allclose(found, np.where(PLACES[:, :1] > 0.4, B, A), atol=1e-5)
    found = seen(node("X", "ND_splittb_color3", colors(valuet=A, valueb=B) + "\nfloat inputs:center = 0.5"))
    np.testing.assert_allclose(found, np.where(PLACES[:, 1:] > 0.5, A, B), atol=1e-5)
    found = seen(node("X", "ND_checkerboard_color3", colors(color1=A, color2=B) + "\nfloat2 inputs:uvtiling = (7, 4)"))
    odd = np.floor(PLACES * [7, 4]).sum(axis=1, keepdims=True) % 2 == 1
    np.testing.assert_allclose(found, np.where(odd, A, B), atol=1e-5)


def test_coordinates_through_any_arithmetic() -> None:
    """As a picture of them, with the accuracy of its 512 texels a side."""
    nodes = node("T", "ND_texcoord_vector2", "", "vector2")
    nodes += node(
        "E", "ND_extract_vector2", "float2 inputs:in.connect = </M/T.outputs:out>\nint inputs:index = 1", "float"
    )
    nodes += node(
        "W", "ND_smoothstep_float", "float inputs:in.connect = </M/E.outputs:out>\nfloat inputs:low = 0.2", "float"
    )
    nodes += node("X", "ND_mix_color3", colors(fg=A, bg=B) + "\nfloat inputs:mix.connect = </M/W.outputs:out>")
    x = (PLACES[:, 1:] - 0.2) / 0.8
    share = x * x * (3 - 2 * x)
    np.testing.assert_allclose(seen(nodes), A * share + B * (1 - share), atol=1e-4)


def test_turned_coordinates_through_arithmetic() -> None:
    nodes = place2d(0) + node(
        "C", "ND_convert_vector2_vector3", "float2 inputs:in.connect = </M/P.outputs:out>", "vector3"
    )
    nodes += node("X", "ND_absval_vector3", "float3 inputs:in.connect = </M/C.outputs:out>")
    expected = turned((PLACES - 0.5) / np.array([2.0, 1.5]), 30) - np.array([0.1, -0.05]) + 0.5
    np.testing.assert_allclose(seen(nodes)[:, :2], np.abs(expected), atol=1e-3)


def test_a_picture_times_its_coordinates(tmp_path) -> None:
    texels = np.random.default_rng(1).uniform(0.1, 0.9, (2, 2, 3))
    nodes = image("I", write(tmp_path / "a.exr", texels)) + node("T", "ND_texcoord_vector2", "", "vector2")
    nodes += node("E", "ND_extract_vector2", "float2 inputs:in.connect = </M/T.outputs:out>", "float")
    nodes += node("X", "ND_multiply_color3FA", "color3f inputs:in1.connect = </M/I.outputs:out>\n"
                  "float inputs:in2.connect = </M/E.outputs:out>")  # fmt: skip
    at = np.array([[0.25, 0.75], [0.75, 0.75], [0.25, 0.25], [0.75, 0.25]])
    np.testing.assert_allclose(seen(nodes, at), texels.reshape(4, 3) * at[:, :1], atol=2e-3)


VARYING = 'color3f[] primvars:tint = [(0, 0, 0), (0.8, 0, 0), (0.8, 0.4, 0), (0, 0.4, 0)] ( interpolation = "vertex" )'


def test_a_primvar_goes_through_affine_arithmetic() -> None:
    nodes = node("P", "ND_geompropvalue_color3", 'string inputs:geomprop = "tint"')
    nodes += node("I", "ND_invert_color3", "color3f inputs:in.connect = </M/P.outputs:out>")
    nodes += node(
        "X", "ND_multiply_color3FA", "color3f inputs:in1.connect = </M/I.outputs:out>\nfloat inputs:in2 = 0.5"
    )
    tint = np.column_stack([PLACES * [0.8, 0.4], np.zeros(4)])
    np.testing.assert_allclose(seen(nodes, mesh=VARYING), 0.5 * (1 - tint), atol=1e-5)


def test_a_component_of_a_primvar() -> None:
    nodes = node("P", "ND_geompropvalue_color3", 'string inputs:geomprop = "tint"')
    nodes += node(
        "X", "ND_extract_color3", "color3f inputs:in.connect = </M/P.outputs:out>\nint inputs:index = 1", "float"
    )
    np.testing.assert_allclose(seen(nodes, mesh=VARYING)[:, 0], 0.4 * PLACES[:, 1], atol=1e-5)


def test_a_primvar_that_a_mesh_lacks_has_the_default() -> None:
    nodes = node(
        "X", "ND_geompropvalue_color3", 'string inputs:geomprop = "none"\ncolor3f inputs:default = (1, 0.5, 0.25)'
    )
    scene = square("ND_surface_unlit", CONNECTED, nodes)
    assert mentions(scene, "/Q", "primvars:none")
    np.testing.assert_allclose(seen_at(scene, PLACES)["emission"], np.broadcast_to([1, 0.5, 0.25], (4, 3)))


def test_a_primvar_and_a_picture_are_approximated_with_a_warning(tmp_path) -> None:
    nodes = node("P", "ND_geompropvalue_color3", 'string inputs:geomprop = "tint"\ncolor3f inputs:default = (1, 1, 1)')
    nodes += image("I", write(tmp_path / "a.exr", np.full((2, 2, 3), 0.5)))
    nodes += node("X", "ND_multiply_color3", "color3f inputs:in1.connect = </M/P.outputs:out>\n"
                  "color3f inputs:in2.connect = </M/I.outputs:out>")  # fmt: skip
    scene = square("ND_surface_unlit", CONNECTED, nodes, mesh=VARYING)
    assert mentions(scene, "/M", "multiply /M/X", "primvar") and len(scene.warnings) == 1
    np.testing.assert_allclose(seen_at(scene, PLACES)["emission"], 0.5, rtol=1e-3)
