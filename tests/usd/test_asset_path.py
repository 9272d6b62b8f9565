"""Files are found by the layer that holds their path, whatever stronger layers say of the attribute."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdUtils
from usd.pictures import diffuse, stage, write
from usd.stages import mentions

from warpmis.usd import load_stage

HEADER = "#usda 1.0\n"
RAW = 'token inputs:sourceColorSpace = "raw"\n'


def over(metadata: str, path: str = "M/T", name: str = "asset inputs:file") -> str:
    """Overs down to a prim with an opinion on one attribute that is no value."""
    names = path.split("/")
    text = f"{name} ( {metadata} )\n"
    for one in reversed(names):
        text = f'over "{one}"\n{{\n{text}}}\n'
    return text


OPINIONS = {
    "none": "",
    "documentation": over('doc = "seen by lighting"'),
    "custom data": over("customData = {\nint version = 3\n}"),
    "a color space": over('colorSpace = "raw"'),
    "of the prim alone": 'over "M"\n{\nover "T" ( doc = "seen" )\n{\n}\n}\n',
}


def layers(tmp_path: Path, file: str, opinion: str, arc: str, st: str, values: str = "") -> Path:
    """In the shot's folder an opinion, in looks/ the texture's path, in looks/tex/ tiles of 0.25 and 0.75."""
    tex = tmp_path / "looks" / "tex"
    tex.mkdir(parents=True)
    for name, value in (("c.1001.exr", 0.25), ("c.1002.exr", 0.75), ("grey.exr", 0.5)):
        write(tex / name, np.full((2, 2, 3), value))
    text = stage(file, texture=RAW, st=st)
    if values:
        text = text.replace(f"asset inputs:file = @{file}@", f"asset inputs:file.timeSamples = {{\n{values}\n}}")
    root = f"(\nsubLayers = [@./looks/look.usda@]\n)\n{opinion}"
    if arc == "reference":
        text = f'def "A"\n{{\n{text.replace("</M", "</A/M")}}}\n'
        root = f'def "B" ( references = @./looks/look.usda@</A> )\n{{\n{opinion}}}\n'
    (tmp_path / "looks" / "look.usda").write_text(HEADER + text)
    (tmp_path / "shot.usda").write_text(HEADER + root)
    return tmp_path / "shot.usda"


WIDE = "[(0, 0), (2, 0), (2, 1), (0, 1)]"


@pytest.mark.parametrize("opinion", OPINIONS)
@pytest.mark.parametrize("arc", ["sublayer", "reference"])
def test_tiles_stand_beside_the_layer_of_the_path(tmp_path, opinion, arc):
    shot = layers(tmp_path, "./tex/c.<UDIM>.exr", OPINIONS[opinion], arc, WIDE)
    scene = load_stage(shot)
    assert scene.warnings == ()
    np.testing.assert_allclose(diffuse(scene, [(0.25, 0.5), (0.75, 0.5)])[:, 0], [0.25, 0.75], atol=1e-6)


@pytest.mark.parametrize("opinion", OPINIONS)
@pytest.mark.parametrize("file", ["./tex/grey.exr", "tex/grey.exr", r".\tex\grey.exr", r"tex\grey.exr"])
def test_a_picture_stands_beside_the_layer_of_the_path(tmp_path, file, opinion):
    scene = load_stage(layers(tmp_path, file, OPINIONS[opinion], "sublayer", WIDE))
    assert scene.warnings == ()
    np.testing.assert_allclose(diffuse(scene, [(0.25, 0.5)])[0], 0.5, atol=1e-6)


def test_backslashes_before_tiles(tmp_path):
    scene = load_stage(layers(tmp_path, r".\tex\c.<UDIM>.exr", OPINIONS["documentation"], "sublayer", WIDE))
    assert scene.warnings == ()
    np.testing.assert_allclose(diffuse(scene, [(0.25, 0.5), (0.75, 0.5)])[:, 0], [0.25, 0.75], atol=1e-6)


def test_samples_over_time_count_as_values(tmp_path):
    values = "1: @./tex/grey.exr@,\n2: @./tex/c.<UDIM>.exr@,"
    shot = layers(tmp_path, "x", OPINIONS["documentation"], "sublayer", WIDE, values)
    for time, expected in ((1, [0.5, 0.0]), (2, [0.25, 0.75])):
        scene = load_stage(shot, time=time)
        assert scene.warnings == ()
        np.testing.assert_allclose(diffuse(scene, [(0.25, 0.5), (0.75, 0.5)])[:, 0], expected, atol=1e-6)


def test_a_stronger_path_counts_with_its_own_layer(tmp_path):
    shot = layers(tmp_path, "./tex/c.<UDIM>.exr", "", "sublayer", WIDE)
    write(tmp_path / "d.1001.exr", np.full((2, 2, 3), 0.125))
    shot.write_text(
        shot.read_text() + over("").replace("asset inputs:file (  )", "asset inputs:file = @./d.<UDIM>.exr@")
    )
    np.testing.assert_allclose(diffuse(load_stage(shot), [(0.25, 0.5)])[0], 0.125, atol=1e-6)


def test_a_session_layer_that_speaks_of_the_path_changes_nothing(tmp_path):
    shot = layers(tmp_path, "./tex/c.<UDIM>.exr", "", "sublayer", WIDE)
    (tmp_path / "session").mkdir()
    session = tmp_path / "session" / "s.usda"
    session.write_text(HEADER + OPINIONS["documentation"])
    opened = Usd.Stage.Open(str(shot))
    opened.SetEditTarget(opened.GetSessionLayer())
    opened.GetAttributeAtPath("/M/T.inputs:file").SetDocumentation("seen")
    for scene in (load_stage(shot, session_layer=session), load_stage(opened)):
        assert scene.warnings == ()
        np.testing.assert_allclose(diffuse(scene, [(0.75, 0.5)])[0], 0.75, atol=1e-6)


def test_a_file_of_the_working_folder_is_not_taken_for_one_beside_the_layer(tmp_path, monkeypatch):
    shot = layers(tmp_path, "./tex/gone.exr", "", "sublayer", WIDE)
    elsewhere = tmp_path / "elsewhere" / "tex"
    elsewhere.mkdir(parents=True)
    write(elsewhere / "gone.exr", np.full((2, 2, 3), 0.5))
    monkeypatch.chdir(elsewhere.parent)
    assert mentions(load_stage(shot), "/M/T.inputs:file", "./tex/gone.exr does not exist")


def test_tiles_that_are_not_there_are_one_warning_with_the_path(tmp_path):
    shot = layers(tmp_path, "./tex/gone.<UDIM>.exr", "", "sublayer", WIDE)
    assert mentions(load_stage(shot), "/M/T.inputs:file", "gone.<UDIM>.exr has no tiles")


def test_tiles_in_a_usdz_package(tmp_path):
    shot = layers(tmp_path, "./tex/c.<UDIM>.exr", "", "sublayer", WIDE)
    package = tmp_path / "shot.usdz"
    assert UsdUtils.CreateNewUsdzPackage(str(shot), str(package))
    for file in (tmp_path / "looks" / "tex").iterdir():
        file.unlink()
    scene = load_stage(package)
    assert scene.warnings == ()
    np.testing.assert_allclose(diffuse(scene, [(0.25, 0.5), (0.75, 0.5)])[:, 0], [0.25, 0.75], atol=1e-6)


@pytest.mark.parametrize("light", ["DomeLight", "RectLight"])
def test_pictures_of_lights_with_backslashes(tmp_path, light):
    (tmp_path / "sky").mkdir()
    write(tmp_path / "sky" / "blue.exr", np.broadcast_to([0.0, 0.0, 1.0], (4, 8, 3)))
    (tmp_path / "s.usda").write_text(
        HEADER + f'def {light} "L"\n{{\nasset inputs:texture:file = @.\\sky\\blue.exr@\n}}\ndef Cube "C"\n{{\n}}\n'
    )
    scene = load_stage(tmp_path / "s.usda")
    assert scene.warnings == ()
    found = scene.lights[0].picture if light == "DomeLight" else scene.lights[0].control.picture
    np.testing.assert_allclose(found.mean(axis=(0, 1)), [0, 0, 1], atol=1e-6)
