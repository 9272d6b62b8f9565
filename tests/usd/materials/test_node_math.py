"""MaterialX's nodes of arithmetic on numbers, beside what their specification says, and on pictures texel by texel."""

from __future__ import annotations

import colorsys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from usd.networks import image, node, square
from usd.pictures import CENTRES, write
from usd.points import seen_at
from usd.stages import mentions

from warpmis.scene import Scene
from warpmis.usd.materials.node_math import LUMA, MATH, hsv_to_rgb, rgb_to_hsv

CONNECTED = "color3f inputs:emission_color.connect = </M/X.outputs:out>"
A, B, C = np.array([0.2, 0.5, 0.8]), np.array([0.6, 0.25, 0.4]), np.array([0.1, 0.3, 0.9])


def shown(scene: Scene, at: Any = ((0.5, 0.5),)) -> np.ndarray:
    """What a surface without light emits at points, shape (n, 3)."""
    assert scene.warnings == ()
    return seen_at(scene, at)["emission"]


def written(values: dict[str, Any]) -> str:
    """Inputs of a node: numbers and colours."""

    def one(name: str, value: Any) -> str:
        number = np.ndim(value) == 0
        return f"{'float' if number else 'color3f'} inputs:{name} = {value if number else tuple(value.tolist())}"

    return "\n".join(one(name, value) for name, value in values.items())


def luminance(color: np.ndarray) -> np.ndarray:
    return np.full(3, np.dot(color, LUMA))


def overlay(fg: np.ndarray, bg: np.ndarray) -> np.ndarray:
    return np.where(bg < 0.5, 2 * fg * bg, 1 - 2 * (1 - fg) * (1 - bg))


CASES: dict[str, tuple[str, dict[str, Any], np.ndarray]] = {
    "constant": ("ND_constant_color3", {"value": A}, A),
    "dot": ("ND_dot_color3", {"in": A}, A),
    "add": ("ND_add_color3", {"in1": A, "in2": B}, A + B),
    "add a number": ("ND_add_color3FA", {"in1": A, "in2": 0.25}, A + 0.25),
    "subtract": ("ND_subtract_color3", {"in1": A + 1, "in2": B}, A + 1 - B),
    "multiply": ("ND_multiply_color3", {"in1": A, "in2": B}, A * B),
    "multiply by a number": ("ND_multiply_color3FA", {"in1": A, "in2": 3.0}, A * 3),
    "multiply by nothing": ("ND_multiply_color3", {"in1": A}, A),
    "divide": ("ND_divide_color3", {"in1": A, "in2": B}, A / B),
    "modulo": ("ND_modulo_color3FA", {"in1": A, "in2": 0.3}, A % 0.3),
    "power": ("ND_power_color3FA", {"in1": A, "in2": 2.2}, A**2.2),
    "safepower": ("ND_safepower_color3FA", {"in1": A, "in2": 2.2}, A**2.2),
    "min": ("ND_min_color3", {"in1": A, "in2": B}, np.minimum(A, B)),
    "max": ("ND_max_color3", {"in1": A, "in2": B}, np.maximum(A, B)),
    "invert": ("ND_invert_color3", {"in": A}, 1 - A),
    "invert from 2": ("ND_invert_color3FA", {"in": A, "amount": 2.0}, 2 - A),
    "absval": ("ND_absval_color3", {"in": -A}, A),
    "fract": ("ND_fract_color3", {"in": A + 2}, A),
    "floor": ("ND_floor_color3", {"in": A + 2}, np.full(3, 2.0)),
    "ceil": ("ND_ceil_color3", {"in": A + 2}, np.full(3, 3.0)),
    "round": ("ND_round_color3", {"in": np.array([0.2, 1.7, 2.2])}, np.array([0.0, 2.0, 2.0])),
    "clamp": ("ND_clamp_color3FA", {"in": A, "low": 0.3, "high": 0.6}, np.clip(A, 0.3, 0.6)),
    "remap": ("ND_remap_color3FA", {"in": A, "inlow": 0.1, "inhigh": 0.9, "outlow": 1.0, "outhigh": 3.0},
              1 + (A - 0.1) / 0.8 * 2),
    "range": ("ND_range_color3FA", {"in": A, "inlow": 0.1, "inhigh": 0.9, "gamma": 2.0, "outhigh": 2.0},
              2 * ((A - 0.1) / 0.8) ** 0.5),
    "smoothstep": ("ND_smoothstep_color3FA", {"in": A, "low": 0.1, "high": 0.6},
                   np.where(A >= 0.6, 1, ((A - 0.1) / 0.5) ** 2 * (3 - 2 * (A - 0.1) / 0.5))),
    "contrast": ("ND_contrast_color3FA", {"in": A, "amount": 0.5, "pivot": 0.4}, (A - 0.4) * 0.5 + 0.4),
    "luminance": ("ND_luminance_color3", {"in": A}, luminance(A)),
    "saturate": ("ND_saturate_color3", {"in": A, "amount": 0.25}, luminance(A) * 0.75 + A * 0.25),
    "rgbtohsv": ("ND_rgbtohsv_color3", {"in": A}, np.array(colorsys.rgb_to_hsv(*A))),
    "hsvtorgb": ("ND_hsvtorgb_color3", {"in": A}, np.array(colorsys.hsv_to_rgb(*A))),
    "hsvadjust": ("ND_hsvadjust_color3", {"in": A, "amount": np.array([0.25, 0.5, 2.0])},
                  np.array(colorsys.hsv_to_rgb(*(np.array(colorsys.rgb_to_hsv(*A)) * [1, 0.5, 2] + [0.25, 0, 0])))),
    "colorcorrect": ("ND_colorcorrect_color3",
                     {"in": A, "saturation": 0.5, "gamma": 2.0, "lift": 0.1, "gain": 2.0, "contrast": 0.5,
                      "contrastpivot": 0.4, "exposure": 1.0},
                     (((((luminance(A) + A) / 2) ** 0.5 * 0.9 + 0.1) * 2 - 0.4) * 0.5 + 0.4) * 2),
    "mix": ("ND_mix_color3", {"fg": A, "bg": B, "mix": 0.25}, A * 0.25 + B * 0.75),
    "mix by a color": ("ND_mix_color3_color3", {"fg": A, "bg": B, "mix": C}, A * C + B * (1 - C)),
    "plus": ("ND_plus_color3", {"fg": A, "bg": B, "mix": 0.5}, B + 0.5 * A),
    "minus": ("ND_minus_color3", {"fg": A, "bg": B + 1, "mix": 0.5}, B + 1 - 0.5 * A),
    "difference": ("ND_difference_color3", {"fg": A, "bg": B}, np.abs(A - B)),
    "screen": ("ND_screen_color3", {"fg": A, "bg": B}, 1 - (1 - A) * (1 - B)),
    "overlay": ("ND_overlay_color3", {"fg": A, "bg": B}, overlay(A, B)),
    "burn": ("ND_burn_color3", {"fg": A + 0.5, "bg": B + 0.5}, 1 - (0.5 - B) / (A + 0.5)),
    "dodge": ("ND_dodge_color3", {"fg": A, "bg": B}, B / (1 - A)),
    "inside": ("ND_inside_color3", {"in": A, "mask": 0.25}, A * 0.25),
    "outside": ("ND_outside_color3", {"in": A, "mask": 0.25}, A * 0.75),
    "ifgreater": ("ND_ifgreater_color3", {"value1": 0.5, "value2": 0.25, "in1": A, "in2": B}, A),
    "ifgreatereq": ("ND_ifgreatereq_color3", {"value1": 0.25, "value2": 0.5, "in1": A, "in2": B}, B),
    "ifequal": ("ND_ifequal_color3", {"value1": 0.5, "value2": 0.5, "in1": A, "in2": B}, A),
    "switch": ("ND_switch_color3", {"in1": A, "in2": B, "in3": C, "which": 2.0}, C),
    "convert": ("ND_convert_float_color3", {"in": 0.25}, np.full(3, 0.25)),
    "normalize": ("ND_normalize_vector3", {"in": A}, A / np.linalg.norm(A)),
    "crossproduct": ("ND_crossproduct_vector3", {"in1": B, "in2": A}, np.maximum(np.cross(B, A), 0)),
    "premult of a color": ("ND_sqrt_vector3", {"in": A}, np.sqrt(A)),
    "exp": ("ND_exp_vector3", {"in": A}, np.exp(A)),
    "ln": ("ND_ln_vector3", {"in": A + 1}, np.log(A + 1)),
    "sin": ("ND_sin_vector3", {"in": A}, np.sin(A)),
    "trianglewave": ("ND_trianglewave_float", {"in": 0.75}, np.full(3, 0.25)),
    "magnitude": ("ND_magnitude_vector3", {"in": A}, np.full(3, np.linalg.norm(A))),
    "dotproduct": ("ND_dotproduct_vector3", {"in1": A, "in2": B}, np.full(3, A @ B)),
    "distance": ("ND_distance_vector3", {"in1": A, "in2": B}, np.full(3, np.linalg.norm(A - B))),
}  # fmt: skip
NUMBERS = ("trianglewave", "magnitude", "dotproduct", "distance")


@pytest.mark.parametrize("name", CASES)
def test_of_numbers(name: str) -> None:
    kind, inputs, expected = CASES[name]
    scene = square(
        "ND_surface_unlit", CONNECTED, node("X", kind, written(inputs), "float" if name in NUMBERS else "color3")
    )
    found = [line for line in scene.warnings if "out of range" not in line]
    assert found == []
    np.testing.assert_allclose(seen_at(scene, [(0.5, 0.5)])["emission"][0], expected, rtol=2e-5, atol=1e-6)


@pytest.mark.parametrize("name", CASES)
def test_of_a_picture_texel_by_texel(tmp_path, name: str) -> None:
    """Every texel gives what the number gives: the picture holds the first color, and darker ones."""
    kind, inputs, expected = CASES[name]
    (first, value), *others = inputs.items()
    color = np.broadcast_to(value, 3)
    factors = np.array([[1.0, 0.75], [0.5, 0.25]])
    path = write(tmp_path / "c.exr", factors[..., None] * color)
    connected = f"color3f inputs:{first}.connect = </M/I.outputs:out>\n" + written(dict(others))
    nodes = node("X", kind, connected, "float" if name in NUMBERS else "color3") + image("I", path)
    scene = square("ND_surface_unlit", CONNECTED, nodes)
    found = seen_at(scene, CENTRES)["emission"]
    np.testing.assert_allclose(found[0], expected, rtol=1e-4, atol=1e-5)
    for place, factor in enumerate(factors.ravel()):
        numbers = node("X", kind, written({**inputs, first: factor * color}), "float" if name in NUMBERS else "color3")
        scene_of_numbers = square("ND_surface_unlit", CONNECTED, numbers)
        one = seen_at(scene_of_numbers, [(0.5, 0.5)])["emission"][0]
        np.testing.assert_allclose(found[place], one, rtol=1e-4, atol=1e-5)


def test_hsv_is_colorsys() -> None:
    colors = np.random.default_rng(1).uniform(0.0, 1.0, (200, 3))
    colors[:3] = [[0.0, 0.0, 0.0], [0.5, 0.5, 0.5], [1.0, 0.0, 1.0]]
    hsv = np.array([colorsys.rgb_to_hsv(*color) for color in colors])
    np.testing.assert_allclose(rgb_to_hsv(colors), hsv, atol=1e-12)
    np.testing.assert_allclose(hsv_to_rgb(hsv), colors, atol=1e-12)
    np.testing.assert_allclose(hsv_to_rgb(hsv + np.array([3.0, 0.0, 0.0])), colors, atol=1e-12)


BLENDS: dict[str, Callable[[np.ndarray, np.ndarray], np.ndarray]] = {
    "over": lambda f, b: f + b * (1 - f[3]),
    "matte": lambda f, b: np.append(f[:3] * f[3] + b[:3] * (1 - f[3]), f[3] + b[3] * (1 - f[3])),
    "in": lambda f, b: f * b[3],
    "mask": lambda f, b: b * f[3],
    "out": lambda f, b: f * (1 - b[3]),
    "disjointover": lambda f, b: np.append(f[:3] + b[:3] * (1 - f[3]) / b[3], 1.0),
}


@pytest.mark.parametrize("name", BLENDS)
def test_blends_with_alpha(name: str) -> None:
    fg, bg = np.append(A, 0.5), np.append(B, 0.75)
    np.testing.assert_allclose(MATH[name].function(fg, bg, np.ones(1)), BLENDS[name](fg, bg))
    np.testing.assert_allclose(MATH[name].function(fg, bg, np.zeros(1)), bg)


def test_what_a_table_calls_affine_is_affine() -> None:
    """In each such input, at three places, with random other inputs."""
    random = np.random.default_rng(2)
    for name, math in MATH.items():
        for which in math.affine:
            others = {each: random.uniform(0.1, 0.9, 3) for each in math.inputs}
            at = [math.function(*{**others, which: np.full(3, x)}.values()) for x in (0.0, 1.0, 0.37)]
            np.testing.assert_allclose(at[2], at[0] + 0.37 * (at[1] - at[0]), err_msg=f"{name} in {which}")


# Booleans and integers have another default here than numbers; nobody compares what is not authored.
EXCEPTIONS = {"ifequal.value1"}


def test_defaults_are_those_of_the_library() -> None:
    """Names of inputs and their values, of every node definition of each category."""
    library = pytest.importorskip("MaterialX")
    document = library.createDocument()
    library.loadLibraries(library.getDefaultDataLibraryFolders(), library.getDefaultDataSearchPath(), document)
    different, checked = {}, 0
    numeric = ("float", "integer", "boolean", "color3", "color4", "vector2", "vector3", "vector4")
    for definition in document.getNodeDefs():
        math = MATH.get(definition.getNodeString())
        inputs = [each for each in definition.getInputs() if each.getType() in numeric]
        if math is None or definition.getType() not in (*numeric, "multioutput"):
            continue
        for each in inputs:
            default = math.inputs.get(each.getName(), (np.nan,))
            text = {"true": "1", "false": "0"}.get(each.getValueString(), each.getValueString())
            expected = [float(one) for one in text.split(",") if one.strip()] or [0.0]
            width = len(default) if len(default) > 1 else len(expected)
            if not np.allclose(np.broadcast_to(default, width), expected[:width]):
                different[f"{definition.getNodeString()}.{each.getName()}"] = (definition.getName(), default, expected)
            checked += 1
    assert {name: what for name, what in different.items() if name not in EXCEPTIONS} == {}
    assert checked > 500


def test_two_pictures_at_the_same_places_are_one(tmp_path) -> None:
    first, second = np.random.default_rng(3).uniform(0.1, 0.9, (2, 2, 2, 3))
    nodes = image("I", write(tmp_path / "a.exr", first)) + image("J", write(tmp_path / "b.exr", second))
    nodes += node("X", "ND_multiply_color3", "color3f inputs:in1.connect = </M/I.outputs:out>\n"
                  "color3f inputs:in2.connect = </M/J.outputs:out>")  # fmt: skip
    found = shown(square("ND_surface_unlit", CONNECTED, nodes), CENTRES)
    np.testing.assert_allclose(found, (first * second).reshape(4, 3), rtol=1e-3)


def test_pictures_of_different_sizes_have_the_larger_one(tmp_path) -> None:
    grey = np.full((1, 1, 3), 0.5)
    texels = np.random.default_rng(4).uniform(0.1, 0.9, (2, 2, 3))
    nodes = image("I", write(tmp_path / "a.exr", grey)) + image("J", write(tmp_path / "b.exr", texels))
    nodes += node("X", "ND_multiply_color3", "color3f inputs:in1.connect = </M/I.outputs:out>\n"
                  "color3f inputs:in2.connect = </M/J.outputs:out>")  # fmt: skip
    found = shown(square("ND_surface_unlit", CONNECTED, nodes), CENTRES)
    np.testing.assert_allclose(found, 0.5 * texels.reshape(4, 3), rtol=1e-3)


def test_a_smaller_picture_is_interpolated(tmp_path) -> None:
    """As a lookup does it: between the centres of its texels, and clamped at its edges."""
    small = np.random.default_rng(7).uniform(0.1, 0.9, (2, 3, 3))
    nodes = image("I", write(tmp_path / "a.exr", small)) + image("J", write(tmp_path / "b.exr", np.ones((8, 12, 3))))
    nodes += node("X", "ND_multiply_color3", "color3f inputs:in1.connect = </M/I.outputs:out>\n"
                  "color3f inputs:in2.connect = </M/J.outputs:out>")  # fmt: skip
    clamped = 'string inputs:uaddressmode = "clamp"\nstring inputs:vaddressmode = "clamp"'
    at = [((x + 0.5) / 12, (y + 0.5) / 8) for x in range(12) for y in range(8)]
    alone = square("ND_surface_unlit", CONNECTED.replace("/X.", "/I."), image("I", tmp_path / "a.exr", more=clamped))
    found = shown(square("ND_surface_unlit", CONNECTED, nodes), at)
    np.testing.assert_allclose(found, shown(alone, at), rtol=1e-3)


def test_encoded_bytes_are_decoded_first(tmp_path) -> None:
    path = write(tmp_path / "c.png", np.full((2, 2, 3), 0.5), "uint8")
    nodes = image("I", path).replace(f"@{path}@", f'@{path}@ ( colorSpace = "srgb_texture" )')
    nodes += node("X", "ND_power_color3FA", "color3f inputs:in1.connect = </M/I.outputs:out>\nfloat inputs:in2 = 2")
    linear = ((128 / 255 + 0.055) / 1.055) ** 2.4
    np.testing.assert_allclose(shown(square("ND_surface_unlit", CONNECTED, nodes)), linear**2, rtol=1e-4)


def test_outside_of_a_border_is_the_function_of_0(tmp_path) -> None:
    place = node("P", "ND_place2d_vector2", "float2 inputs:offset = (OFFSET, 0)", "vector2")
    more = 'string inputs:uaddressmode = "constant"\nfloat2 inputs:texcoord.connect = </M/P.outputs:out>'
    nodes = image("I", write(tmp_path / "a.exr", np.full((2, 2, 3), 0.75)), more=more) + place
    nodes += node("X", "ND_exp_vector3", "color3f inputs:in.connect = </M/I.outputs:out>")
    for offset, expected in (("-1", 1.0), ("0", np.exp(0.75))):
        found = shown(square("ND_surface_unlit", CONNECTED, nodes.replace("OFFSET", offset)))
        np.testing.assert_allclose(found, expected, rtol=1e-4)


def test_pictures_at_different_places_are_approximated_with_a_warning(tmp_path) -> None:
    texels = np.random.default_rng(5).uniform(0.1, 0.9, (2, 2, 3))
    nodes = image("I", write(tmp_path / "a.exr", texels))
    nodes += node(
        "J", "ND_tiledimage_color3", f"asset inputs:file = @{tmp_path}/a.exr@\nfloat2 inputs:uvtiling = (4, 4)"
    )
    nodes += node("X", "ND_multiply_color3", "color3f inputs:in1.connect = </M/I.outputs:out>\n"
                  "color3f inputs:in2.connect = </M/J.outputs:out>")  # fmt: skip
    scene = square("ND_surface_unlit", CONNECTED, nodes)
    assert mentions(scene, "/M", "multiply /M/X", "different places") and len(scene.warnings) == 1
    expected = texels.reshape(4, 3) * texels.mean(axis=(0, 1))
    np.testing.assert_allclose(seen_at(scene, CENTRES)["emission"], expected, rtol=5e-3)


def test_the_larger_of_two_pictures_at_different_places_stays(tmp_path) -> None:
    texels = np.random.default_rng(8).uniform(0.1, 0.9, (2, 2, 3))
    nodes = image("J", write(tmp_path / "b.exr", texels))
    grey = write(tmp_path / "a.exr", np.full((1, 1, 3), 0.5))
    nodes += node("I", "ND_tiledimage_color3", f"asset inputs:file = @{grey}@\nfloat2 inputs:uvtiling = (4, 4)")
    nodes += node("X", "ND_multiply_color3", "color3f inputs:in1.connect = </M/I.outputs:out>\n"
                  "color3f inputs:in2.connect = </M/J.outputs:out>")  # fmt: skip
    scene = square("ND_surface_unlit", CONNECTED, nodes)
    assert mentions(scene, "/M", "multiply /M/X", "different places")
    np.testing.assert_allclose(seen_at(scene, CENTRES)["emission"], 0.5 * texels.reshape(4, 3), rtol=1e-3)


def test_a_made_picture_counts_among_the_stages_texels(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One that has no room is its mean, with a warning."""
    texels = np.random.default_rng(9).uniform(0.1, 0.9, (2, 2, 3))
    nodes = image("I", write(tmp_path / "a.exr", texels))
    nodes += node("X", "ND_power_color3FA", "color3f inputs:in1.connect = </M/I.outputs:out>\nfloat inputs:in2 = 2")
    for words, is_kept in ((24, True), (23, False)):
        monkeypatch.setattr("warpmis.usd.materials.texture.MAX_TEXEL_WORDS", words)
        scene = square("ND_surface_unlit", CONNECTED, nodes)
        found = seen_at(scene, CENTRES)["emission"]
        assert mentions(scene, "/M", "too many texels") != is_kept
        expected = (texels**2).reshape(4, 3)
        expected = expected if is_kept else np.broadcast_to(expected.mean(axis=0), (4, 3))
        np.testing.assert_allclose(found, expected, rtol=1e-2)


def test_channels_are_combined_and_swizzled(tmp_path) -> None:
    texels = np.random.default_rng(6).uniform(0.1, 0.9, (2, 2, 3))
    nodes = image("I", write(tmp_path / "a.exr", texels))
    nodes += node("P", "ND_separate3_color3", "color3f inputs:in.connect = </M/I.outputs:out>", "float", "outr")
    nodes = nodes.replace("float outputs:outr", "float outputs:outr\nfloat outputs:outg\nfloat outputs:outb")
    nodes += node("X", "ND_combine3_color3", "float inputs:in1.connect = </M/P.outputs:outb>\nfloat inputs:in2 = 0.5\n"
                  "float inputs:in3.connect = </M/P.outputs:outr>")  # fmt: skip
    found = shown(square("ND_surface_unlit", CONNECTED, nodes), CENTRES)
    texels = texels.reshape(4, 3)
    np.testing.assert_allclose(found, np.column_stack([texels[:, 2], np.full(4, 0.5), texels[:, 0]]), rtol=1e-3)
    swizzle = image("I", tmp_path / "a.exr")
    swizzle += node("X", "ND_swizzle_color3_color3", 'color3f inputs:in.connect = </M/I.outputs:out>\n'
                    'string inputs:channels = "g1r"')  # fmt: skip
    found = shown(square("ND_surface_unlit", CONNECTED, swizzle), CENTRES)
    np.testing.assert_allclose(found, np.column_stack([texels[:, 1], np.ones(4), texels[:, 0]]), rtol=1e-3)


def test_a_border_has_the_default_through_arithmetic(tmp_path) -> None:
    more = 'color3f inputs:default = (0.5, 0.25, 0.125)\nstring inputs:uaddressmode = "constant"'
    place = node("P", "ND_place2d_vector2", "float2 inputs:offset = (-1, 0)", "vector2")
    nodes = image("I", write(tmp_path / "a.exr", np.full((2, 2, 3), 0.75)), more=more) + place
    nodes = nodes.replace("inputs:file", "inputs:dummy = @a@\nfloat2 inputs:texcoord.connect = </M/P.outputs:out>\n"
                          "asset inputs:file")  # fmt: skip
    nodes += node("X", "ND_power_color3FA", "color3f inputs:in1.connect = </M/I.outputs:out>\nfloat inputs:in2 = 2")
    found = shown(square("ND_surface_unlit", CONNECTED, nodes))
    np.testing.assert_allclose(found[0], np.array([0.5, 0.25, 0.125]) ** 2, rtol=1e-4)
    direct = CONNECTED.replace("/X.", "/I.")
    np.testing.assert_allclose(shown(square("ND_surface_unlit", direct, nodes))[0], [0.5, 0.25, 0.125], rtol=1e-4)


def test_an_affine_graph_keeps_the_pictures_bytes(tmp_path) -> None:
    """No new picture is made of what a lookup's scale and bias say."""
    path = write(tmp_path / "c.png", np.full((2, 2, 3), 0.5), "uint8")
    nodes = image("I", path) + node("Y", "ND_invert_color3", "color3f inputs:in.connect = </M/I.outputs:out>")
    nodes += node(
        "X", "ND_multiply_color3FA", "color3f inputs:in1.connect = </M/Y.outputs:out>\nfloat inputs:in2 = 0.5"
    )
    scene = square("ND_surface_unlit", CONNECTED, nodes)
    lookup: Any = scene.materials[0].emissive_color
    assert lookup.texture.tiles[1001].dtype == np.uint8
    np.testing.assert_allclose(shown(scene), 0.5 * (1 - 128 / 255), rtol=1e-5)


def test_noise_is_its_mean_with_a_warning() -> None:
    noise = node("N", "ND_noise3d_float", "float inputs:pivot = 0.25", "float")
    nodes = noise + node(
        "X", "ND_mix_color3", written({"fg": A, "bg": B}) + "\nfloat inputs:mix.connect = </M/N.outputs:out>"
    )
    scene = square("ND_surface_unlit", CONNECTED, nodes)
    assert mentions(scene, "/M", "ND_noise3d_float /M/N", "mean") and len(scene.warnings) == 1
    np.testing.assert_allclose(seen_at(scene, [(0.5, 0.5)])["emission"][0], 0.25 * A + 0.75 * B, rtol=1e-5)


def test_an_unknown_node_leaves_the_inputs_default() -> None:
    nodes = node("N", "ND_position_vector3", "", "vector3")
    nodes += node(
        "X", "ND_multiply_color3FA", "color3f inputs:in1.connect = </M/N.outputs:out>\nfloat inputs:in2 = 0.5"
    )
    scene = square("ND_standard_surface_surfaceshader", CONNECTED.replace("emission_color", "base_color"), nodes)
    assert mentions(scene, "/M", "ND_position_vector3 /M/N") and len(scene.warnings) == 1
    assert scene.materials[0].diffuse_color == (0.8, 0.8, 0.8)


def test_division_by_zero_is_black() -> None:
    nodes = node("X", "ND_divide_color3FA", written({"in1": A, "in2": 0.0}))
    np.testing.assert_allclose(shown(square("ND_surface_unlit", CONNECTED, nodes)), 0.0)


def test_a_long_chain_ends_with_a_warning() -> None:
    nodes = node("X0", "ND_constant_color3", written({"value": A}))
    for k in range(1500):
        nodes += node(f"X{k + 1}", "ND_dot_color3", f"color3f inputs:in.connect = </M/X{k}.outputs:out>")
    short = square("ND_surface_unlit", CONNECTED.replace("/X.", "/X90."), nodes)
    np.testing.assert_allclose(shown(short)[0], A, rtol=1e-6)
    long = square("ND_surface_unlit", CONNECTED.replace("/X.", "/X1500."), nodes)
    assert mentions(long, "/M", "nodes lie one behind the other")
