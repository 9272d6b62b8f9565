"""A result's EXR has the channels and the header that scripts rely on."""

from __future__ import annotations

import base64
import dataclasses
import re
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

import warpmis
from warpmis.config import RenderConfig
from warpmis.output.exr import read_exr
from warpmis.rendering.result import RenderResult

CHANNELS = {
    "R", "G", "B", "A", "Z", "albedo.R", "albedo.G", "albedo.B", "N.X", "N.Y", "N.Z", "variance.Y", "samples.Y",
    "allocation.bsdf", "allocation.light",
}  # fmt: skip


def make_result(height: int = 3, width: int = 4) -> RenderResult:
    rng = np.random.default_rng(0)

    def picture(*shape: int) -> np.ndarray:
        return rng.random((height, width, *shape), dtype=np.float32)

    return RenderResult(
        image=picture(3), alpha=picture(), albedo=picture(3), normal=picture(3), depth=picture(),
        samples=np.full((height, width), 64, np.int32), variance=picture(), allocation=picture(2),
        strategies=("bsdf", "light"), stats={"seconds": {"learn": 1.0}}, name="box.usda",
        settings=RenderConfig(spp=64, method="murray20", seed=3).to_dict(),
    )  # fmt: skip


def test_written_channels(tmp_path: Path) -> None:
    result = make_result()
    result.write(tmp_path / "a.exr")
    channels, _ = read_exr(tmp_path / "a.exr")
    assert set(channels) == CHANNELS
    for axis, name in enumerate("RGB"):
        np.testing.assert_array_equal(channels[name], result.image[..., axis])
        np.testing.assert_array_equal(channels[f"albedo.{name}"], result.albedo[..., axis])
    for axis, name in enumerate("XYZ"):
        np.testing.assert_array_equal(channels[f"N.{name}"], result.normal[..., axis])
    np.testing.assert_array_equal(channels["A"], result.alpha)
    np.testing.assert_array_equal(channels["Z"], result.depth)
    np.testing.assert_array_equal(channels["samples.Y"], 64.0)
    np.testing.assert_array_equal(channels["variance.Y"], result.variance)
    np.testing.assert_array_equal(channels["allocation.light"], result.allocation[..., 1])


def test_written_header(tmp_path: Path) -> None:
    make_result().write(tmp_path / "a.exr")
    _, header = read_exr(tmp_path / "a.exr")
    assert header == {
        "version": warpmis.__version__, "stage": "box.usda", "spp": 64, "method": "murray20",
        "strategies": "bsdf,light", "strategy_choice": "stratified", "sampler": "lattice",
        "mis_compensation": 0, "max_depth": 8, "seed": 3, "ids": 0, "cryptomatte": 0,
        "device": "cpu", "learn.rounds": 1, "learn.spp": 32,
    }  # fmt: skip


@pytest.mark.parametrize("name", ["a.png", "A.PNG"])
def test_a_png_is_the_picture_to_look_at(tmp_path: Path, name: str) -> None:
    """sRGB, as IEC 61966-2-1 encodes it; the denoised picture where there is one."""
    result = make_result()
    for shown in (result, dataclasses.replace(result, denoised=result.image[::-1] * 2.0)):
        shown.write(tmp_path / name)
        stored = oiio.ImageBuf(str(tmp_path / name)).get_pixels(oiio.UINT8)
        linear = np.minimum(shown.shown.astype(np.float64), 1.0)
        expected = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
        np.testing.assert_allclose(stored / 255.0, expected, atol=0.002)


@pytest.mark.parametrize("name", ["a.jpg", "a", "a.exr.gz", ".exr", "png"])
def test_other_endings_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(warpmis.ConfigError, match=f"{re.escape(name)}: the file's name must end in .exr or .png"):
        make_result().write(tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_channels_are_those_of_an_exr(tmp_path: Path) -> None:
    result = make_result()
    result.write(tmp_path / "a.exr", {"beauty.R": "R"})
    channels, _ = read_exr(tmp_path / "a.exr")
    assert set(channels) == {"beauty.R"}
    with pytest.raises(warpmis.ConfigError, match=r"there is no channel Q; there are A, Z, variance\.Y, "):
        result.write(tmp_path / "b.exr", {"beauty.R": "R", "odd": "Q"})
    with pytest.raises(warpmis.ConfigError, match="a PNG has no named channels"):
        result.write(tmp_path / "b.png", {"beauty.R": "R"})
    assert [path.name for path in tmp_path.iterdir()] == ["a.exr"]


def test_expected_error_is_that_of_the_mean() -> None:
    """Variance 4 a sample, 64 samples, a grey picture of 2: standard error 0.25, relative to 2 sqrt(1.01)."""
    grey = np.full((3, 4, 3), 2.0, np.float32)
    result = dataclasses.replace(make_result(), image=grey, variance=np.full((3, 4), 4.0, np.float32))
    assert result.relative_error() == pytest.approx(0.125 / np.sqrt(1.01))


def test_notebook_shows_picture_map_and_error(tmp_path: Path) -> None:
    result = dataclasses.replace(make_result(), name="a<b>.usda", variance=np.zeros((3, 4), np.float32))
    assert repr(result) == "RenderResult(a<b>.usda, 4 x 3, murray20, 64 spp)"
    page = result._repr_html_()
    assert "a&lt;b&gt;.usda, 4 x 3, murray20, 64 spp): relative error about 0 %" in page
    picture, _map = re.findall(r'src="data:image/png;base64,([^"]+)"', page)
    (tmp_path / "a.png").write_bytes(base64.b64decode(picture))
    shown = oiio.ImageBuf(str(tmp_path / "a.png")).get_pixels(oiio.UINT8)
    linear = result.image[..., :3].astype(np.float64)
    expected = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    np.testing.assert_allclose(shown / 255.0, expected, atol=0.003)
    shares = result.allocation.mean(axis=(0, 1))
    for name, share in zip(("bsdf", "light"), shares, strict=True):
        assert f"{name} {100 * share:.0f} %" in page


def test_notebook_shows_no_map_where_nothing_was_learned() -> None:
    result = dataclasses.replace(make_result(), allocation=np.full((3, 4, 2), 0.5, np.float32))
    assert result._repr_html_().count("<img") == 1


def test_notebook_says_where_next_event_estimation_is_everywhere() -> None:
    """What `auto` learned, though every pixel has equal shares. `nee` learns nothing, and shows no map."""
    everywhere = np.ones((3, 4), np.float32)
    result = dataclasses.replace(make_result(), allocation=np.full((3, 4, 2), 0.5, np.float32), next_event=everywhere)
    page = result._repr_html_()
    assert page.count("<img") == 2
    assert "bsdf 0 %" in page and "light 0 %" in page and "next-event estimation 100 %" in page
    unlearned = dataclasses.replace(result, stats={"seconds": {"learn": 0.0}})
    assert unlearned._repr_html_().count("<img") == 1


def test_next_event_estimation_is_a_channel_where_the_method_knows_it() -> None:
    assert "nextEvent.Y" not in make_result().channels()
    known = dataclasses.replace(make_result(), next_event=np.eye(3, 4, dtype=np.float32))
    np.testing.assert_array_equal(known.channels()["nextEvent.Y"], np.eye(3, 4))
