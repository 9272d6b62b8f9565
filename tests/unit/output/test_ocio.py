"""OpenColorIO's views of a picture, by the configuration that comes with it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from warpmis.cli import main
from warpmis.errors import ConfigError
from warpmis.output.ocio import check_view, to_view
from warpmis.output.tonemap import to_display

RAMP = np.repeat(np.linspace(0.0, 1.0, 33, dtype=np.float32)[None, :, None], 3, axis=2)


@pytest.fixture(autouse=True)
def own_configuration(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("OCIO", raising=False)


def test_without_tone_mapping_it_is_srgb() -> None:
    shown = to_view(RAMP, "sRGB - Display", "Un-tone-mapped").astype(int)
    assert abs(shown - to_display(RAMP).astype(int)).max() <= 1


def test_the_default_view_maps_tones() -> None:
    """Grey stays grey, brighter stays brighter, and white is kept below what a display can show."""
    shown = to_view(RAMP).astype(int)
    assert np.ptp(shown, axis=2).max() <= 1
    assert (np.diff(shown[0, :, 0]) >= 0).all() and shown[0, -1, 0] < 230
    assert to_view(np.full((1, 1, 3), 1e30)).min() > 230


def test_bad_values_stay_values() -> None:
    shown = to_view(np.array([[[np.nan, np.nan, np.nan], [np.inf, np.inf, np.inf], [-1.0, -1.0, -1.0]]]))
    assert shown[0, 0].tolist() == [0, 0, 0] and shown[0, 1].min() > 230


@pytest.mark.parametrize(
    ("names", "said"),
    [(("nonsense",), "no OpenColorIO display"), (("", "nonsense"), "no view"), (("", "", "nonsense"), "colour space")],
)
def test_names_that_there_are_not(names: tuple[str, ...], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        check_view(*names)


def test_a_configuration_that_cannot_be_read(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "bad.ocio").write_text("nonsense")
    for path in (tmp_path / "bad.ocio", tmp_path / "absent.ocio"):
        monkeypatch.setenv("OCIO", str(path))
        with pytest.raises(ConfigError, match="cannot be read as an OpenColorIO configuration"):
            check_view()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--ocio-view", "Raw"], "is for --color-correction-mode openColorIO"),
        (["--colorCorrectionMode", "openColorIO", "--ocioDisplay", "x"], "no OpenColorIO display 'x'"),
        (["-color", "openColorIO", "--ocio-view", "x"], "no view 'x'"),
    ],
)
def test_the_command_refuses_before_it_renders(
    options: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["render", "absent.usda", "a.exr", *options]) == 2
    error = capsys.readouterr().err
    assert said in error and len(error.strip().splitlines()) == 1
