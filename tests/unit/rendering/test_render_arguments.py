"""The keyword arguments of `render`: what each becomes, and which may not come together."""

from __future__ import annotations

import dataclasses
import inspect
from typing import Any

import numpy as np
import pytest
import scenes

import warpmis
from warpmis.config import LearnConfig, RenderConfig
from warpmis.usd import load_stage

LEARN = {
    "learn_rounds": "rounds",
    "learn_spp": "spp",
    "initial_allocation": "initial_allocation",
    "keep_maps": "keep_maps",
}
ROOM = scenes.room(4)


def parameters(function: Any) -> dict[str, inspect.Parameter]:
    return dict(inspect.signature(function).parameters)


def test_every_setting_is_an_argument_by_name() -> None:
    """Editors complete them: there is no **settings."""
    known = parameters(warpmis.render)
    assert {field.name for field in dataclasses.fields(RenderConfig)} <= set(known)
    assert {field.name for field in dataclasses.fields(LearnConfig)} == set(LEARN.values())
    assert set(LEARN) <= set(known)
    assert set(parameters(load_stage)) - {"path_or_stage"} <= set(known)
    for function in (warpmis.render, load_stage):
        kinds = {parameter.kind for parameter in list(parameters(function).values())[1:]}
        assert kinds == {inspect.Parameter.KEYWORD_ONLY}


def test_every_setting_reaches_the_render() -> None:
    """Each has a value of its own in what the result says that was used."""
    settings: dict[str, Any] = {
        "width": 8, "spp": 9, "target_error": 0.9, "time_limit": 50.0, "method": "murray20",
        "strategies": ("light", "bsdf"), "strategy_choice": "random", "sampler": "independent",
        "mis_compensation": True, "max_depth": 1, "seed": 5, "ids": True, "device": "cpu", "threads": 1,
    }  # fmt: skip
    learn = {"rounds": 2, "spp": 3, "initial_allocation": (0.25, 0.75), "keep_maps": True}
    flat = {name: learn[own] for name, own in LEARN.items()}
    result = warpmis.render(ROOM, **settings, **flat)
    expected = RenderConfig(learn=LearnConfig(**learn), **settings).to_dict()
    assert result.settings == {**expected, "camera": "/camera"}
    assert result.image.shape == (8, 8, 3)
    assert len(result.round_allocations) > 0
    again = warpmis.render(ROOM, **settings, learn=LearnConfig(**learn))
    assert again.settings == result.settings
    whole = warpmis.render(ROOM, config=RenderConfig(learn=LearnConfig(**learn), **settings))
    assert whole.settings == result.settings
    np.testing.assert_array_equal(whole.image, again.image)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"config": RenderConfig(), "spp": 4, "seed": 0}, "either a config or single settings, got both: seed, spp"),
        ({"config": RenderConfig(), "learn_spp": 4}, "either a config or single settings, got both: learn"),
        ({"learn": LearnConfig(), "learn_spp": 4}, "either learn or single learn settings, got both: spp"),
        ({"samples": 4}, "unexpected keyword argument 'samples'"),
    ],
)
def test_settings_have_one_meaning(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(TypeError, match=message):
        warpmis.render(ROOM, **arguments)


def test_a_scene_takes_no_options_of_a_stage() -> None:
    with pytest.raises(warpmis.ConfigError, match="has been read already: give camera, shutter_samples to load_stage"):
        warpmis.render(ROOM, camera="/Other", shutter_samples=4)
