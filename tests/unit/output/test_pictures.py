"""What is made to be looked at: the display transfer function, PNG files and the balance map."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from warpmis.errors import WarpmisError
from warpmis.output.balance_map import NEXT_EVENT, balance_map, entry_colors, sample_shares
from warpmis.output.legend import entry_text, with_legend
from warpmis.output.png import write_display_png, write_png
from warpmis.output.tonemap import to_display


def luminance(picture: np.ndarray) -> np.ndarray:
    """Relative luminance of sRGB values, shape (..., 3) uint8 to (...)."""
    value = picture / 255.0
    linear = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    return np.asarray(linear @ [0.2126, 0.7152, 0.0722])


# ---- tone mapping ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("linear", "display"),
    [(0.0, 0), (1.0, 255), (0.18, 118), (0.002, 7), (0.5, 188), (7.0, 255), (-1.0, 0), (np.inf, 255), (np.nan, 0)],
)
def test_display_values_are_srgb(linear: float, display: int) -> None:
    np.testing.assert_array_equal(to_display(np.full((1, 1, 3), linear, np.float32)), display)


def test_exposure_is_in_stops() -> None:
    linear = np.random.default_rng(0).random((2, 3, 3))
    np.testing.assert_array_equal(to_display(linear, exposure=1.0), to_display(2.0 * linear))


# ---- PNG ------------------------------------------------------------------------------------------------------------


def read_png(path: Path) -> np.ndarray:
    source = oiio.ImageInput.open(str(path))
    pixels = source.read_image("uint8")
    source.close()
    return np.asarray(pixels)


def test_png_holds_the_display_values(tmp_path: Path) -> None:
    linear = np.random.default_rng(0).random((4, 6, 3), dtype=np.float32)
    write_png(tmp_path / "a.png", linear)
    np.testing.assert_array_equal(read_png(tmp_path / "a.png"), to_display(linear))
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]


def test_png_of_a_view(tmp_path: Path) -> None:
    picture = np.random.default_rng(0).integers(0, 256, (4, 6, 3), dtype=np.uint8)[::-1, ::-1]
    write_display_png(tmp_path / "a.png", picture)
    np.testing.assert_array_equal(read_png(tmp_path / "a.png"), picture)


def test_png_says_that_it_is_srgb(tmp_path: Path) -> None:
    write_png(tmp_path / "a.png", np.zeros((2, 2, 3), np.float32))
    assert b"sRGB" in (tmp_path / "a.png").read_bytes()


def test_png_into_a_missing_folder(tmp_path: Path) -> None:
    with pytest.raises(WarpmisError, match="does not exist; create it first"):
        write_png(tmp_path / "nowhere" / "a.png", np.zeros((2, 2, 3), np.float32))


# ---- balance map ----------------------------------------------------------------------------------------------------


def ramp(steps: int = 33) -> np.ndarray:
    """From all BSDF to all light, shape (1, steps, 2)."""
    light = np.linspace(0.0, 1.0, steps)
    return np.stack([1.0 - light, light], axis=-1)[np.newaxis]


def test_bsdf_is_red_light_is_blue_and_a_third_is_green() -> None:
    red, blue, green = balance_map(np.eye(3)[np.newaxis], ("bsdf", "light", "uniform"))[0].astype(int)
    assert red.argmax() == 0 and red[0] > 2 * max(red[1], red[2])
    assert blue.argmax() == 2 and blue[2] > 2 * max(blue[0], blue[1])
    assert green.argmax() == 1 and green[1] > max(green[0], green[2])


def test_colours_follow_the_names_not_the_order() -> None:
    shares = ramp()
    np.testing.assert_array_equal(
        balance_map(shares, ("bsdf", "light")), balance_map(shares[..., ::-1], ("light", "bsdf"))
    )


def test_two_strategies_are_ordered_in_colour_and_in_grey() -> None:
    colors = balance_map(ramp(), ("bsdf", "light"))[0]
    assert (np.diff(colors[:, 0].astype(int)) < 0).all()  # ever less red
    assert (np.diff(colors[:, 2].astype(int)) >= 0).all()  # ever more blue
    assert (np.diff(luminance(colors)) < 0).all()


def test_one_strategy_is_one_colour() -> None:
    picture = balance_map(np.ones((2, 3, 1), np.float32), ("bsdf",))
    assert picture.shape == (2, 3, 3)
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) == 1


def test_more_strategies_than_colours() -> None:
    with pytest.raises(WarpmisError, match="one more strategy"):
        balance_map(np.full((1, 1, 4), 0.25), ("bsdf", "light", "uniform", "guide"))


def test_next_event_estimation_has_a_colour_that_no_mixture_has() -> None:
    """Between two strategies, and as light as none of the two, so that a grey print tells it, too."""
    mixtures = balance_map(ramp(257), ("bsdf", "light"))[0].astype(int)
    yellow = balance_map(np.full((1, 1, 2), 0.5), ("bsdf", "light"), np.ones((1, 1)))[0, 0].astype(int)
    assert yellow[0] > yellow[2] + 100 and yellow[1] > yellow[2] + 100
    assert np.abs(mixtures - yellow).sum(axis=1).min() > 150
    assert luminance(yellow.astype(np.uint8)) > luminance(mixtures.astype(np.uint8)).max() + 0.3
    green = balance_map(np.eye(3)[np.newaxis], ("bsdf", "light", "uniform"))[0, 2].astype(int)
    assert np.abs(green - yellow).sum() > 80


def test_shares_of_the_samples() -> None:
    """Two pixels: one all next-event estimation, whose shares do not count, and one of a quarter and three."""
    allocation = np.array([[[0.5, 0.5], [0.25, 0.75]]])
    assert sample_shares(allocation, ("bsdf", "light")) == {"bsdf": 0.375, "light": 0.625}
    told = sample_shares(allocation, ("bsdf", "light"), np.array([[1.0, 0.0]]))
    assert told == {"bsdf": 0.125, "light": 0.375, NEXT_EVENT: 0.5}


def test_shares_in_words() -> None:
    for share, text in ((None, "bsdf"), (0.0, "bsdf 0 %"), (0.001, "bsdf < 1 %"), (0.255, "bsdf 26 %")):
        assert entry_text("bsdf", share) == text
    assert entry_text("bsdf", 0.999) == "bsdf > 99 %" and entry_text("bsdf", 1.0) == "bsdf 100 %"


@pytest.mark.parametrize("strategies", [("bsdf",), ("bsdf", "light"), ("bsdf", "light", "uniform")])
@pytest.mark.parametrize("width", [1, 2, 64, 640])
def test_legend_stands_below_the_picture(strategies: tuple[str, ...], width: int) -> None:
    """The picture as it is; where it is narrow the names have room on a black margin."""
    picture = balance_map(np.full((48, width, len(strategies)), 1.0 / len(strategies)), strategies)
    whole = with_legend(picture, strategies)
    np.testing.assert_array_equal(whole[:48, :width], picture)
    assert whole.shape[0] > 48 and whole.shape[1] >= width
    assert (whole[48] == 0).all() and (whole[:48, width:] == 0).all()
    if width == 640:
        assert whole.shape[1] == width


def test_legend_runs_from_the_first_strategy_to_the_next() -> None:
    strategies = ("bsdf", "light")
    bar = with_legend(balance_map(np.full((48, 640, 2), 0.5), strategies), strategies)[49 + 7]  # below the ticks
    ends = balance_map(np.eye(2)[np.newaxis], strategies)[0]
    np.testing.assert_array_equal(bar[[0, -1]], ends)


def test_legend_names_each_colour_and_its_share() -> None:
    """A square of the colour of each, and white words that differ with the share."""
    picture = np.zeros((48, 640, 3), np.uint8)
    strategies = ("bsdf", "light")

    def words(share: float) -> np.ndarray:
        shares = {"bsdf": 0.5 - share, "light": 0.5, NEXT_EVENT: share}
        return with_legend(picture, strategies, shares)[49 + 8 :]

    strip = words(0.25)
    for color in entry_colors(strategies).values():
        assert (strip == color).all(axis=-1).sum() >= 16 * 16
    assert (strip == 255).all(axis=-1).sum() > 100
    assert (words(0.25) != words(0.26)).any()


def test_without_a_mixture_there_is_no_bar() -> None:
    picture = np.zeros((48, 640, 3), np.uint8)
    heights = [
        len(
            with_legend(
                picture, ("bsdf", "light"), {"bsdf": (1.0 - share) / 2, "light": (1.0 - share) / 2, NEXT_EVENT: share}
            )
        )
        for share in (1.0, 0.5)
    ]
    assert heights[0] == heights[1] - 8


def test_linear_png_holds_the_values_themselves(tmp_path: Path) -> None:
    linear = np.array([[[0.0, 0.2, 0.5], [1.0, 2.0, np.nan]]])
    write_png(tmp_path / "linear.png", linear, srgb=False)
    pixels = oiio.ImageInput.open(str(tmp_path / "linear.png")).read_image("uint8")
    np.testing.assert_array_equal(pixels, [[[0, 51, 128], [255, 255, 0]]])
