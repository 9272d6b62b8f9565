"""opacityThreshold: what is as opaque as the threshold is there, exactly, where all texels around a point are equal."""

from __future__ import annotations

import numpy as np
import pytest
from usd.pictures import stage, write
from usd.points import seen_at
from usd.stages import load

from warpmis.scene.texture import mean_of

PLACES = np.random.default_rng(7).random((4000, 2))


def opacity_of(folder, alpha, threshold, kind, *, texture="", wrap="repeat"):
    """Opacity at PLACES of a square whose picture has this alpha, shape (rows, columns), and the scene."""
    alpha = np.asarray(alpha, float)
    pixels = np.concatenate([np.full((*alpha.shape, 3), 0.5), alpha[..., None]], axis=-1)
    file = write(folder / ("a.exr" if kind == "float" else "a.png"), pixels, kind)
    inputs = f"float inputs:opacity.connect = </M/T.outputs:a>\nfloat inputs:opacityThreshold = {threshold!r}"
    wraps = f'token inputs:wrapS = "{wrap}"\ntoken inputs:wrapT = "{wrap}"\n'
    scene = load(stage(file, inputs=inputs, texture=wraps + texture))
    return seen_at(scene, PLACES)["opacity"], scene


@pytest.mark.parametrize("wrap", ["repeat", "clamp", "mirror"])
@pytest.mark.parametrize(
    ("alpha", "threshold", "kind", "there"),
    [
        (153 / 255, 0.6, "uint8", 1.0),  # 153 / 255 is 0.6, in float32 too
        (153 / 255, 0.6001, "uint8", 0.0),
        (0.7, 0.7, "float", 1.0),
        (0.7, 0.70001, "float", 0.0),
        (0.3, 0.3, "float", 1.0),
    ],
)
def test_a_picture_of_one_alpha_is_wholly_there_or_not_at_all(tmp_path, alpha, threshold, kind, there, wrap):
    opacity, scene = opacity_of(tmp_path, np.full((7, 5), alpha), threshold, kind, wrap=wrap)
    assert (opacity == there).all()
    (material,) = scene.materials
    assert mean_of(material.opacity, threshold=material.opacity_threshold) == there


def test_half_a_picture_of_alpha_1_is_there_at_threshold_1(tmp_path):
    alpha = np.tile([0.0] * 4 + [1.0] * 4, (8, 1))
    opacity, _ = opacity_of(tmp_path, alpha, 1.0, "uint8", wrap="clamp")
    x = PLACES[:, 0]
    assert (opacity[x > 4.5 / 8 + 1e-5] == 1.0).all()
    assert (opacity[x < 4.5 / 8 - 1e-5] == 0.0).all()


def test_a_black_border_cuts_only_what_it_reaches(tmp_path):
    alpha = np.where(np.arange(64).reshape(8, 8) % 8 < 8, 1.0, 0.0)
    alpha[0, 0] = 0.0  # or the picture is 1 everywhere and no picture
    opacity, _ = opacity_of(tmp_path, alpha, 1.0, "uint8", wrap="black")
    inner = ((PLACES > 0.5 / 8 + 1e-5) & (PLACES < 1 - 0.5 / 8 - 1e-5)).all(axis=1)
    beside = (PLACES[:, 0] < 1.5 / 8 + 1e-5) & (PLACES[:, 1] > 1 - 1.5 / 8 - 1e-5)
    assert (opacity[inner & ~beside] == 1.0).all()
    assert (opacity[~inner] == 0.0).all()


def test_scale_and_bias_are_compared_as_float32_has_them(tmp_path):
    for scale, bias, alpha in ((0.7, 0.1, 0.3), (0.9, 0.05, 0.6), (0.31, 0.17, 0.77)):
        threshold = float(np.float32(scale) * np.float32(alpha) + np.float32(bias))
        texture = f"float4 inputs:scale = (1, 1, 1, {scale})\nfloat4 inputs:bias = (0, 0, 0, {bias})"
        opacity, scene = opacity_of(tmp_path, np.full((4, 4), alpha), threshold, "float", texture=texture)
        assert (opacity == 1.0).all()
        (material,) = scene.materials
        assert mean_of(material.opacity, threshold=material.opacity_threshold) == 1.0


@pytest.mark.parametrize(("value", "threshold", "there"), [(0.7, 0.7, 1.0), (0.1, 0.1, 1.0), (0.7, 0.70001, 0.0)])
@pytest.mark.parametrize("count", [1, 4])
def test_a_primvar_of_one_value_is_wholly_there_or_not_at_all(value, threshold, there, count):
    values = f"[{', '.join([repr(value)] * count)}]"
    mesh = f'float[] primvars:cut = {values} (interpolation = "{"constant" if count == 1 else "vertex"}")'
    reader = 'def Shader "P"\n{\nuniform token info:id = "UsdPrimvarReader_float"\nstring inputs:varname = "cut"\n'
    inputs = f"float inputs:opacity.connect = </M/P.outputs:result>\nfloat inputs:opacityThreshold = {threshold!r}"
    scene = load(stage("none.png", inputs=inputs, mesh=mesh, more=reader + "float outputs:result\n}"))
    assert (seen_at(scene, PLACES)["opacity"] == there).all()


def test_a_constant_is_compared_as_its_float32():
    inputs = "float inputs:opacity = 0.6\nfloat inputs:opacityThreshold = 0.6"
    assert load(stage("none.png", inputs=inputs)).materials[0].opacity == 1.0


def test_a_cutout_that_glows_shines_with_its_exact_share(tmp_path):
    """Half the texels meet the threshold of 0.6; the light's mean emission is that half."""
    alpha = np.tile([0.6, 0.3], (4, 2))
    inputs = (
        "float inputs:opacity.connect = </M/T.outputs:a>\nfloat inputs:opacityThreshold = 0.6\n"
        "color3f inputs:emissiveColor = (4, 4, 4)"
    )
    pixels = np.concatenate([np.full((4, 4, 3), 0.5), alpha[..., None]], axis=-1)
    wraps = 'token inputs:wrapS = "repeat"\ntoken inputs:wrapT = "repeat"'
    scene = load(stage(write(tmp_path / "a.exr", pixels), inputs=inputs, texture=wraps))
    assert scene.materials[0].mean_emission == pytest.approx((2.0, 2.0, 2.0))
