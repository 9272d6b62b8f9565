"""MaterialX's nodes of arithmetic, by category: functions of values, shape (..., n), with their inputs' defaults.

Reference: Smythe, Stone et al. (2024), "MaterialX Specification" 1.39, sections "Math", "Adjustment", "Compositing",
"Conditional" and "Channel Nodes".
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[Any]
Numbers = tuple[float, ...]

# Weights of red, green and blue in a colour's luminance where a node says no others: AP1's.
LUMA = (0.2722287, 0.6740818, 0.0536895)
SWITCHES = 10
ARTISTIC: dict[str, Numbers] = {"reflectivity": (0.944, 0.776, 0.373), "edge_color": (0.998, 0.981, 0.751)}


class NodeMath(NamedTuple):
    """A function of the inputs' values, in their order, and those inputs in which it is affine, one by one."""

    function: Callable[..., FloatArray]
    inputs: dict[str, Numbers]
    affine: tuple[str, ...] = ()


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    # Several times as fast over a short last axis as a sum is.
    return np.asarray(np.einsum("...i,...i->...", *np.broadcast_arrays(a, b))[..., None])


def _length(a: FloatArray) -> FloatArray:
    return np.sqrt(_dot(a, a))


def _mix(foreground: FloatArray, background: FloatArray, share: FloatArray) -> FloatArray:
    return background * (1.0 - share) + foreground * share


def _blended(blend: Callable[[FloatArray, FloatArray], FloatArray]) -> Callable[..., FloatArray]:
    """A blend of foreground and background, of which the result takes a share."""
    return lambda fg, bg, share: _mix(blend(fg, bg), bg, share)


def _remap(a: FloatArray, low: FloatArray, high: FloatArray, to_low: FloatArray, to_high: FloatArray) -> FloatArray:
    return to_low + (a - low) * (to_high - to_low) / (high - low)


def _range(
    a: FloatArray,
    low: FloatArray,
    high: FloatArray,
    gamma: FloatArray,
    to_low: FloatArray,
    to_high: FloatArray,
    clamps: FloatArray,
) -> FloatArray:
    share = (a - low) / (high - low)
    found = to_low + np.sign(share) * np.abs(share) ** (1.0 / gamma) * (to_high - to_low)
    return np.where(clamps > 0.0, np.clip(found, np.minimum(to_low, to_high), np.maximum(to_low, to_high)), found)


def _smoothstep(a: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    share = np.clip((a - low) / (high - low), 0.0, 1.0)
    return np.where(a >= high, 1.0, np.where(a <= low, 0.0, share * share * (3.0 - 2.0 * share)))


def _burn(fg: FloatArray, bg: FloatArray) -> FloatArray:
    return np.where(np.abs(fg) < 1e-8, 0.0, 1.0 - (1.0 - bg) / fg)


def _dodge(fg: FloatArray, bg: FloatArray) -> FloatArray:
    return np.where(np.abs(1.0 - fg) < 1e-8, 0.0, bg / (1.0 - fg))


def _overlay(fg: FloatArray, bg: FloatArray) -> FloatArray:
    return np.where(bg < 0.5, 2.0 * fg * bg, 1.0 - 2.0 * (1.0 - fg) * (1.0 - bg))


def _over(fg: FloatArray, bg: FloatArray) -> FloatArray:
    return fg + bg * (1.0 - fg[..., 3:])


def _matte(fg: FloatArray, bg: FloatArray) -> FloatArray:
    return _with_alpha(_mix(fg[..., :3], bg[..., :3], fg[..., 3:]), _over(fg, bg)[..., 3:])


def _disjoint_over(fg: FloatArray, bg: FloatArray) -> FloatArray:
    alpha = fg[..., 3:] + bg[..., 3:]
    kept = np.where(alpha <= 1.0, 1.0, (1.0 - fg[..., 3:]) / np.where(bg[..., 3:] == 0.0, np.inf, bg[..., 3:]))
    return _with_alpha(fg[..., :3] + bg[..., :3] * kept, np.minimum(alpha, 1.0))


def _with_alpha(rgb: FloatArray, alpha: FloatArray) -> FloatArray:
    shape = np.broadcast_shapes(rgb.shape[:-1], alpha.shape[:-1])
    parts = [np.broadcast_to(part, (*shape, part.shape[-1])) for part in (rgb, alpha)]
    return np.concatenate(parts, axis=-1)


def _of_rgb(function: Callable[..., FloatArray]) -> Callable[..., FloatArray]:
    """A function of colours that leaves their alpha, where they have one, as it is."""

    def of_color(color: FloatArray, *others: FloatArray) -> FloatArray:
        found = function(color[..., :3], *others)
        return _with_alpha(found, color[..., 3:]) if color.shape[-1] == 4 else found

    return of_color


def _luminance(rgb: FloatArray, weights: FloatArray) -> FloatArray:
    return np.repeat(_dot(rgb, weights), 3, axis=-1)


def _saturate(rgb: FloatArray, amount: FloatArray, weights: FloatArray) -> FloatArray:
    return _mix(rgb, _luminance(rgb, weights), amount)


def rgb_to_hsv(rgb: FloatArray) -> FloatArray:
    """Hue, saturation and value in [0, 1], shape (..., 3). Reference: Foley et al. (1990), section 13.3.4."""
    red, green, blue = np.moveaxis(rgb, -1, 0)
    most, least = np.maximum(np.maximum(red, green), blue), np.minimum(np.minimum(red, green), blue)
    chroma = most - least
    some = np.where(chroma == 0.0, 1.0, chroma)
    sextant = np.where(
        red >= most,
        (green - blue) / some,
        np.where(green >= most, 2.0 + (blue - red) / some, 4.0 + (red - green) / some),
    )
    saturation = np.where(most > 0.0, chroma / np.where(most == 0.0, 1.0, most), 0.0)
    hue = np.where(saturation > 0.0, sextant / 6.0 % 1.0, 0.0)
    return np.stack([hue, saturation, most], axis=-1)


def hsv_to_rgb(hsv: FloatArray) -> FloatArray:
    """The inverse of `rgb_to_hsv`, shape (..., 3); the hue may lie outside [0, 1]."""
    hue, saturation, value = np.moveaxis(hsv, -1, 0)
    # Smith's hexcone: each channel falls off linearly around its own hue.
    places = (np.stack([5.0 + 6.0 * hue, 3.0 + 6.0 * hue, 1.0 + 6.0 * hue], axis=-1)) % 6.0
    fall = np.clip(np.minimum(places, 4.0 - places), 0.0, 1.0)
    return value[..., None] * (1.0 - saturation[..., None] * fall)


def _hsv_adjust(rgb: FloatArray, amount: FloatArray) -> FloatArray:
    hsv = rgb_to_hsv(rgb)
    shifted = [hsv[..., 0] + amount[..., 0], hsv[..., 1] * amount[..., 1], hsv[..., 2] * amount[..., 2]]
    return hsv_to_rgb(np.stack(np.broadcast_arrays(*shifted), axis=-1))


def _color_correct(
    rgb: FloatArray, hue: FloatArray, saturation: FloatArray, gamma: FloatArray, *others: FloatArray
) -> FloatArray:
    lift, gain, contrast, pivot, exposure = others
    turned = _hsv_adjust(rgb, np.concatenate([hue, hue * 0.0 + 1.0, hue * 0.0 + 1.0], axis=-1)) if hue.any() else rgb
    color = _saturate(turned, saturation, np.array(LUMA))
    color = np.sign(color) * np.abs(color) ** (1.0 / gamma)
    color = (color * (1.0 - lift) + lift) * gain
    return ((color - pivot) * contrast + pivot) * 2.0**exposure


def _premult(color: FloatArray) -> FloatArray:
    return _with_alpha(color[..., :3] * color[..., 3:], color[..., 3:])


def _unpremult(color: FloatArray) -> FloatArray:
    alpha = color[..., 3:]
    return _with_alpha(color[..., :3] / np.where(alpha == 0.0, 1.0, alpha), alpha)


def _switch(*values: FloatArray) -> FloatArray:
    which = np.floor(values[-1])
    found = np.zeros(1)
    for number, value in enumerate(values[:-1]):
        found = np.where(which == number, value, found)
    return found


def _facets(roughness: FloatArray, anisotropy: FloatArray) -> FloatArray:
    """Widths of a microfacet distribution in both directions. Reference: Burley (2012), section 5.4."""
    alpha = np.clip(roughness * roughness, 1e-8, 1.0)
    aspect = np.sqrt(1.0 - np.clip(anisotropy, 0.0, 0.98))
    across = np.where(anisotropy > 0.0, np.minimum(alpha / aspect, 1.0), alpha)
    along = np.where(anisotropy > 0.0, alpha * aspect, alpha)
    return np.concatenate([across, along], axis=-1)


def _dual_facets(roughness: FloatArray) -> FloatArray:
    return np.clip(np.where(roughness < 0.0, roughness[..., :1], roughness) ** 2, 1e-8, 1.0)


def artistic_ior(reflectivity: FloatArray, edge: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Index of refraction and extinction by the colours at normal incidence and at the edge.

    Reference: Gulbrandsen (2014), "Artist Friendly Metallic Fresnel".
    """
    r = np.clip(reflectivity, 0.0, 0.99)
    n = (1.0 - edge) * (1.0 + np.sqrt(r)) / (1.0 - np.sqrt(r)) + edge * (1.0 - r) / (1.0 + r)
    squared = (r * (n + 1.0) ** 2 - (n - 1.0) ** 2) / (1.0 - r)
    return n, np.sqrt(np.maximum(squared, 0.0))


def _choice(holds: Callable[[FloatArray, FloatArray], FloatArray], first: float) -> NodeMath:
    def chosen(value1: FloatArray, value2: FloatArray, in1: FloatArray, in2: FloatArray) -> FloatArray:
        return np.where(holds(value1, value2), in1, in2)

    return NodeMath(chosen, {"value1": (first,), "value2": (0.0,), "in1": (0.0,), "in2": (0.0,)}, ("in1", "in2"))


def _unary(function: Callable[[FloatArray], FloatArray], default: float = 0.0) -> NodeMath:
    return NodeMath(function, {"in": (default,)})


def _binary(function: Callable[..., FloatArray], second: float, affine: tuple[str, ...] = ()) -> NodeMath:
    return NodeMath(function, {"in1": (0.0,), "in2": (second,)}, affine)


def _blend(function: Callable[..., FloatArray], affine: tuple[str, ...] = ("fg", "bg", "mix")) -> NodeMath:
    return NodeMath(_blended(function), {"fg": (0.0,), "bg": (0.0,), "mix": (1.0,)}, affine)


def _alpha_blend(function: Callable[..., FloatArray]) -> NodeMath:
    return NodeMath(_blended(function), {"fg": (0.0,) * 4, "bg": (0.0,) * 4, "mix": (1.0,)})


MATH: dict[str, NodeMath] = {
    "constant": NodeMath(np.asarray, {"value": (0.0,)}, ("value",)),
    "dot": NodeMath(np.asarray, {"in": (0.0,)}, ("in",)),
    "add": _binary(np.add, 0.0, ("in1", "in2")),
    "subtract": _binary(np.subtract, 0.0, ("in1", "in2")),
    "multiply": _binary(np.multiply, 1.0, ("in1", "in2")),
    "divide": _binary(np.divide, 1.0, ("in1",)),
    "modulo": _binary(lambda a, b: a - b * np.floor(a / b), 1.0),
    "power": _binary(np.power, 1.0),
    "safepower": _binary(lambda a, b: np.sign(a) * np.abs(a) ** b, 1.0),
    "min": _binary(np.minimum, 0.0),
    "max": _binary(np.maximum, 0.0),
    "fract": _unary(lambda a: a - np.floor(a)),
    "invert": NodeMath(lambda a, amount: amount - a, {"in": (0.0,), "amount": (1.0,)}, ("in", "amount")),
    "absval": _unary(np.abs),
    "sign": _unary(np.sign),
    "floor": _unary(np.floor),
    "ceil": _unary(np.ceil),
    "round": _unary(lambda a: np.floor(a + 0.5)),
    "sin": _unary(np.sin),
    "cos": _unary(np.cos),
    "tan": _unary(np.tan),
    "asin": _unary(np.arcsin),
    "acos": _unary(np.arccos),
    "atan2": NodeMath(np.arctan2, {"iny": (0.0,), "inx": (1.0,)}),
    "sqrt": _unary(np.sqrt),
    "ln": _unary(np.log, 1.0),
    "exp": _unary(np.exp),
    "clamp": NodeMath(
        lambda a, low, high: np.minimum(np.maximum(a, low), high), {"in": (0.0,), "low": (0.0,), "high": (1.0,)}
    ),
    "trianglewave": _unary(lambda a: 0.5 - np.abs(np.abs(a) % 1.0 - 0.5)),
    "normalize": _unary(lambda a: a / np.where(_length(a) == 0.0, 1.0, _length(a))),
    "magnitude": _unary(_length),
    "distance": _binary(lambda a, b: _length(a - b), 0.0),
    "dotproduct": _binary(_dot, 0.0),
    "crossproduct": NodeMath(np.cross, {"in1": (0.0,) * 3, "in2": (0.0,) * 3}),
    "remap": NodeMath(
        _remap,
        {"in": (0.0,), "inlow": (0.0,), "inhigh": (1.0,), "outlow": (0.0,), "outhigh": (1.0,)},
        ("in", "outlow", "outhigh"),
    ),
    "range": NodeMath(
        _range,
        {
            "in": (0.0,), "inlow": (0.0,), "inhigh": (1.0,), "gamma": (1.0,), "outlow": (0.0,), "outhigh": (1.0,),
            "doclamp": (0.0,),
        },
    ),
    "smoothstep": NodeMath(_smoothstep, {"in": (0.0,), "low": (0.0,), "high": (1.0,)}),
    "contrast": NodeMath(
        lambda a, amount, pivot: (a - pivot) * amount + pivot,
        {"in": (0.0,), "amount": (1.0,), "pivot": (0.5,)},
        ("in", "amount", "pivot"),
    ),
    "luminance": NodeMath(_of_rgb(_luminance), {"in": (0.0,) * 3, "lumacoeffs": LUMA}),
    "rgbtohsv": NodeMath(_of_rgb(rgb_to_hsv), {"in": (0.0,) * 3}),
    "hsvtorgb": NodeMath(_of_rgb(hsv_to_rgb), {"in": (0.0,) * 3}),
    "hsvadjust": NodeMath(_of_rgb(_hsv_adjust), {"in": (0.0,) * 3, "amount": (0.0, 1.0, 1.0)}),
    "saturate": NodeMath(_of_rgb(_saturate), {"in": (0.0,) * 3, "amount": (1.0,), "lumacoeffs": LUMA}),
    "colorcorrect": NodeMath(
        _of_rgb(_color_correct),
        {
            "in": (1.0,) * 3, "hue": (0.0,), "saturation": (1.0,), "gamma": (1.0,), "lift": (0.0,), "gain": (1.0,),
            "contrast": (1.0,), "contrastpivot": (0.5,), "exposure": (0.0,),
        },
    ),
    "premult": NodeMath(_premult, {"in": (0.0, 0.0, 0.0, 1.0)}),
    "unpremult": NodeMath(_unpremult, {"in": (0.0, 0.0, 0.0, 1.0)}),
    "mix": NodeMath(_mix, {"fg": (0.0,), "bg": (0.0,), "mix": (0.0,)}, ("fg", "bg", "mix")),
    "plus": _blend(lambda fg, bg: bg + fg),
    "minus": _blend(lambda fg, bg: bg - fg),
    "screen": _blend(lambda fg, bg: 1.0 - (1.0 - fg) * (1.0 - bg)),
    "difference": _blend(lambda fg, bg: np.abs(bg - fg), ("mix",)),
    "burn": _blend(_burn, ("mix",)),
    "dodge": _blend(_dodge, ("mix",)),
    "overlay": _blend(_overlay, ("mix",)),
    "over": _alpha_blend(_over),
    "matte": _alpha_blend(_matte),
    "disjointover": _alpha_blend(_disjoint_over),
    "in": _alpha_blend(lambda fg, bg: fg * bg[..., 3:]),
    "mask": _alpha_blend(lambda fg, bg: bg * fg[..., 3:]),
    "out": _alpha_blend(lambda fg, bg: fg * (1.0 - bg[..., 3:])),
    "inside": NodeMath(np.multiply, {"in": (0.0,), "mask": (1.0,)}, ("in", "mask")),
    "outside": NodeMath(lambda a, mask: a * (1.0 - mask), {"in": (0.0,), "mask": (0.0,)}, ("in", "mask")),
    "roughness_anisotropy": NodeMath(_facets, {"roughness": (0.0,), "anisotropy": (0.0,)}),
    "glossiness_anisotropy": NodeMath(lambda g, a: _facets(1.0 - g, a), {"glossiness": (1.0,), "anisotropy": (0.0,)}),
    "roughness_dual": NodeMath(_dual_facets, {"roughness": (0.0, 0.0)}),
    "artistic_ior": NodeMath(lambda r, e: artistic_ior(r, e)[0], ARTISTIC),
    "artistic_extinction": NodeMath(lambda r, e: artistic_ior(r, e)[1], ARTISTIC),
    "ifgreater": _choice(np.greater, 1.0),
    "ifgreatereq": _choice(np.greater_equal, 1.0),
    "ifequal": _choice(np.equal, 0.0),
    "switch": NodeMath(_switch, {**{f"in{k + 1}": (0.0,) for k in range(SWITCHES)}, "which": (0.0,)}),
    "and": _binary(np.minimum, 0.0),
    "or": _binary(np.maximum, 0.0),
    "xor": _binary(lambda a, b: np.abs(a - b), 0.0),
    "not": _unary(lambda a: 1.0 - a),
}  # fmt: skip


def category_of(kind: str) -> str:
    """The category in a node definition's name, such as "mix" in ND_mix_color3_color3; "" where it is not one of
    MATH."""
    words = kind.removeprefix("ND_").removeprefix("logical_").split("_")
    for end in range(len(words), 0, -1):
        name = "_".join(words[:end])
        if kind.startswith("ND_") and name in MATH:
            return name
    return ""
