"""The reader of IES profiles: LM-63 files, type C."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from usd.lights.test_light_control import SHAPING, light
from usd.stages import load, mentions

from warpmis.usd.lights.ies import IesError, read_ies


def profile(vertical: list[float], horizontal: list[float], candela: list[float], kind: int = 1, **more: str) -> str:
    """A file's text, with a multiplier of 2 and a ballast factor of 0.5."""
    numbers = " ".join(f"{value:g}" for value in [*vertical, *horizontal, *candela])
    header = f"1 1000 2 {len(vertical)} {len(horizontal)} {kind} 2 0 0 0\n0.5 1 50"
    return f"IESNA:LM-63-2002\n[MANUFAC] none\n{more.get('tilt', 'TILT=NONE')}\n{header}\n{numbers}\n"


def at(text: str, degrees: float) -> float:
    """Intensity at the horizontal angle, for the first vertical one."""
    found = read_ies(text)
    return float(np.interp(np.radians(degrees), found.horizontal, found.candela[:, 0]))


def test_angles_factors_and_order() -> None:
    found = read_ies(profile([0, 45, 90], [0, 180, 360], [1, 2, 3, 4, 5, 6, 1, 2, 3]))
    np.testing.assert_allclose(found.vertical, np.radians([0, 45, 90]))
    inner = (found.horizontal >= 0) & (found.horizontal < 2 * np.pi)
    np.testing.assert_allclose(found.horizontal[inner], [0, np.pi])
    np.testing.assert_allclose(found.candela[inner], [[1, 2, 3], [4, 5, 6]])


@pytest.mark.parametrize(
    ("horizontal", "values", "expected"),
    [
        ([0], [7], {0: 7, 123: 7, 359: 7}),
        ([0, 90], [1, 3], {0: 1, 45: 2, 90: 3, 135: 2, 180: 1, 270: 3, 315: 2}),
        ([0, 90, 180], [1, 3, 5], {45: 2, 180: 5, 225: 4, 270: 3, 315: 2}),
        ([90, 180, 270], [1, 3, 5], {90: 1, 180: 3, 270: 5, 0: 3, 45: 2, 315: 4}),
        ([0, 90, 180, 270, 360], [1, 2, 3, 4, 1], {45: 1.5, 225: 3.5, 315: 2.5}),
    ],
    ids=["all around", "quadrant", "half", "half about 90", "full"],
)
def test_symmetry_completes_the_turn(
    horizontal: list[float], values: list[float], expected: dict[float, float]
) -> None:
    text = profile([0, 90], horizontal, np.repeat(values, 2).tolist())
    for degrees, value in expected.items():
        assert at(text, degrees) == pytest.approx(value), degrees


def test_tilt_data_is_skipped() -> None:
    tilted = profile([0, 90], [0], [3, 4], tilt="TILT=INCLUDE\n1\n3\n0 45 90\n1 0.9 0.8")
    np.testing.assert_allclose(read_ies(tilted).candela[0], [3, 4])


def test_mean_is_the_power_over_four_pi() -> None:
    assert read_ies(profile([0, 180], [0], [5, 5])).mean == pytest.approx(5.0, rel=1e-5)
    assert read_ies(profile([0, 90], [0], [5, 5])).mean == pytest.approx(2.5, rel=1e-3)
    # 1 at 0 and 180, 0 at 90 degrees, all linear in the angle: 2 pi * 2 * integral of (1 - 2 t / pi) sin t
    assert read_ies(profile([0, 90, 180], [0], [1, 0, 1])).mean == pytest.approx(1 - 2 / np.pi, rel=1e-3)


GOOD = profile([0, 90], [0], [3, 4])


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("", "TILT"),
        ("not a profile", "TILT"),
        ("TILT=NONE\n1 2 3", "header"),
        (GOOD.rsplit(" ", 1)[0], "intensities"),
        (GOOD.replace("2 1 1 2", "2 1 2 2"), "type B"),
        (GOOD.replace("2 1 1 2", "99999999 1 1 2"), "angles"),
        (GOOD.replace("3 4", "3 nan"), "finite"),
        (GOOD.replace("3 4", "3 four"), "number"),
        (GOOD.replace("3 4", "3 -4"), "negative"),
        (GOOD.replace("3 4", "3 1e17").replace("1 1000 2", "1 1000 1e17"), "above 1e"),
        (profile([90, 0], [0], [3, 4]), "grow"),
        (profile([0, 200], [0], [3, 4]), "180"),
        (profile([0, 90], [0, 120], [3, 4, 3, 4]), "0 to 120"),
    ],
)
def test_damaged_profiles_say_why(text: str, word: str) -> None:
    with pytest.raises(IesError, match=word):
        read_ies(text)


def test_a_profile_is_normalized_by_its_mean_and_a_damaged_one_is_one_warning(tmp_path: Path) -> None:
    (tmp_path / "a.ies").write_text(profile([0, 180], [0], [500, 500]))
    (tmp_path / "b.ies").write_text("nothing")
    for name, more, value in (("a", "", 500.0), ("a", "bool inputs:shaping:ies:normalize = 1", 1.0)):
        text = light("SphereLight", f"asset inputs:shaping:ies:file = @{tmp_path / name}.ies@\n{more}", SHAPING)
        found = load(text).lights[0].control.shaping.ies
        np.testing.assert_allclose(found.candela, value, rtol=1e-5)
    scene = load(light("SphereLight", f"asset inputs:shaping:ies:file = @{tmp_path}/b.ies@", SHAPING))
    assert mentions(scene, "/L", "without its profile", "TILT")
    assert len(scene.warnings) == 1
