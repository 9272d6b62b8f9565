"""Every whole number that a caller can set: within its range it renders, beyond it one sentence says so."""

from __future__ import annotations

import dataclasses
import typing
from typing import Any

import numpy as np
import pytest
import scenes
from hypothesis import given, settings
from hypothesis import strategies as st

import warpmis
from warpmis.compare.measure import Settings
from warpmis.config import LearnConfig, RenderConfig
from warpmis.errors import ConfigError
from warpmis.whole_numbers import MAX_PIXELS, RANGES

# How each setting of RANGES is set, by whom.
SETTERS: dict[str, tuple[Any, str]] = {
    "width": (RenderConfig, "width"),
    "height": (lambda height: warpmis.load_stage("none.usda", height=height), ""),
    "spp": (lambda spp: RenderConfig(method="nee", spp=spp), "spp"),
    "max_depth": (RenderConfig, "max_depth"),
    "seed": (RenderConfig, "seed"),
    "threads": (RenderConfig, "threads"),
    "learn_rounds": (LearnConfig, "rounds"),
    "learn_spp": (LearnConfig, "spp"),
    "shutter_samples": (lambda shutter_samples: warpmis.render("none.usda", shutter_samples=shutter_samples), ""),
    "repeats": (Settings, "repeats"),
    "longest_spp": (Settings, "spp"),
    "reference_spp": (Settings, "reference_spp"),
}

ANY_INTEGER = st.one_of(
    st.integers(-(2**70), 2**70),
    st.sampled_from([2**bits + near for bits in (15, 16, 24, 28, 30, 31, 32, 63, 64) for near in (-1, 0, 1)]),
    st.just(10**5000),
    st.integers(-3, 3).map(np.int64),
)
NO_INTEGER = st.one_of(st.booleans(), st.floats(), st.text(max_size=5), st.just([1]), st.just(np.float32(1.0)))


def integer_fields(settings: type) -> set[str]:
    hints = typing.get_type_hints(settings)
    named = (field.name for field in dataclasses.fields(settings))
    return {name for name in named if hints[name] in (int, int | None)}


def test_every_whole_number_has_a_range() -> None:
    assert set(SETTERS) == set(RANGES)
    set_by = {kind: {name for to, name in SETTERS.values() if to is kind} for kind in (RenderConfig, LearnConfig)}
    assert integer_fields(RenderConfig) == set_by[RenderConfig] | {"spp"}
    assert integer_fields(LearnConfig) == set_by[LearnConfig]
    assert integer_fields(Settings) == {"seed", "repeats", "spp", "reference_spp"}


@pytest.mark.parametrize("setting", RANGES)
@settings(deadline=None)  # the first call imports the renderer
@given(value=ANY_INTEGER | NO_INTEGER)
def test_a_setting_is_taken_or_refused_in_a_sentence(setting: str, value: Any) -> None:
    make, name = SETTERS[setting]
    known = RANGES[setting]
    is_whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    try:
        made = make(**{name or setting: value})
    except ConfigError as error:
        text = str(error)
        assert known.name in text and f"from {known.low} to {known.high}" in text and "\n" not in text
        assert len(text) < 200
        assert not (is_whole and known.low <= value <= known.high)
    except warpmis.StageError:  # what is right is asked of a stage that is not there
        assert is_whole and known.low <= value <= known.high
    else:
        assert is_whole and known.low <= value <= known.high
        assert getattr(made, name) == value


@pytest.mark.parametrize("setting", RANGES)
def test_beyond_32_bits_nothing_is_taken(setting: str) -> None:
    make, name = SETTERS[setting]
    with pytest.raises(ConfigError, match=f"must be from .* got {2**32}"):
        make(**{name or setting: 2**32})
    if setting != "seed":
        with pytest.raises(ConfigError, match=f"must be from .* got {2**31}"):
            make(**{name or setting: 2**31})


def test_the_ends_of_the_ranges_render() -> None:
    """A path of any depth ends by Russian roulette, so the greatest depth gives the picture of a great one."""
    room = scenes.room(4)
    deep, deepest = (warpmis.render(room, method="nee", spp=64, max_depth=depth) for depth in (1000, 1_000_000))
    assert deep.image.any()
    np.testing.assert_array_equal(deep.image, deepest.image)
    high = {name: RANGES[name].high for name in ("seed", "threads", "spp")}
    result = warpmis.render(room, method="nee", time_limit=0.02, **high)
    assert np.isfinite(result.image).all() and result.image.any()


def test_a_picture_of_too_many_pixels_is_refused() -> None:
    with pytest.raises(ConfigError, match="a picture of 20000 x 20000 pixels is too large"):
        warpmis.render(scenes.room(4), width=20_000)
    with pytest.raises(ConfigError, match="image width must be from 1 to"):
        warpmis.render(scenes.room(4), width=MAX_PIXELS + 1)
    with pytest.raises(ConfigError, match="image width must be a whole number"):
        warpmis.load_stage("none.usda", width=2.5)  # type: ignore[arg-type]


@pytest.mark.parametrize("limit", [0.0, -1.0, float("nan"), float("inf"), 1e10])
def test_times_are_finite(limit: float) -> None:
    with pytest.raises(ConfigError, match="time limit must be above 0 and at most"):
        RenderConfig(time_limit=limit)
    with pytest.raises(ConfigError, match="time for the comparison must be above 0"):
        Settings(seconds=limit)
