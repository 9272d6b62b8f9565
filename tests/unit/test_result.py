"""A result's EXR has the channels and the header that scripts rely on."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import warpmis
from warpmis.config import RenderConfig
from warpmis.output.exr import read_exr
from warpmis.result import RenderResult

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
        strategies=("bsdf", "light"), stats={}, name="box.usda", settings=RenderConfig(spp=64, seed=3).to_dict(),
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
        "strategies": "bsdf,light", "max_depth": 8, "seed": 3, "device": "cpu", "learn.rounds": 2, "learn.spp": 16,
    }  # fmt: skip
