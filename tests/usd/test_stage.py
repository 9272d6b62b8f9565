"""load_stage: what it opens, supplies, refuses, and keeps off standard error."""

from __future__ import annotations

import time

import numpy as np
import pytest
from pxr import Tf, Usd, UsdGeom, Vt
from usd.stages import check_invariants, load, mentions, stage_of

from warpmis.errors import StageError
from warpmis.scene import DomeLight
from warpmis.usd import load_stage

CUBE = 'def Cube "C"\n{\n}\n'


def test_opens_a_path_and_a_stage_alike(tmp_path):
    path = tmp_path / "cube.usda"
    path.write_text("#usda 1.0\n" + CUBE)
    for source in (path, str(path), Usd.Stage.Open(str(path))):
        scene = load_stage(source)
        assert scene.name == "cube.usda"
        assert len(scene.geometry.triangles) == 12


def test_stage_without_light_gets_a_white_dome_and_a_note():
    scene = load(CUBE)
    (dome,) = scene.lights
    assert isinstance(dome, DomeLight)
    np.testing.assert_allclose(dome.radiance, 1.0)
    assert dome.picture is None
    assert any("no light" in note for note in scene.notes)


def test_emissive_material_is_light_enough_and_only_where_it_is_used():
    glow = """def Material "M"
{
    token outputs:surface.connect = </M/S.outputs:surface>
    def Shader "S"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:emissiveColor = (0, 1, 0)
        token outputs:surface
    }
}
"""
    bound = (
        'def Cube "C" (\n    prepend apiSchemas = ["MaterialBindingAPI"]\n)\n{\n    rel material:binding = </M>\n}\n'
    )
    assert load(bound + glow).lights == ()
    assert [type(light) for light in load(CUBE + glow).lights] == [DomeLight]


def test_stage_with_one_visible_light_alone_loads():
    scene = load('def RectLight "L"\n{\n}\n')
    check_invariants(scene)
    assert len(scene.geometry.triangles) == 0
    assert scene.geometry.triangles.shape == scene.geometry.points.shape == (0, 3)
    assert [light.path for light in scene.lights] == ["/L"]


@pytest.mark.parametrize(
    "text",
    ["", 'def Xform "X"\n{\n}\n', 'def Camera "X"\n{\n}\n', CUBE.replace("{", '{\ntoken visibility = "invisible"'),
     CUBE.replace("{", '{\nuniform token purpose = "guide"')],
)  # fmt: skip
def test_empty_stage_is_an_error(text):
    with pytest.raises(StageError, match=r"empty.*default, render"):
        load(text)


@pytest.mark.parametrize("body", ['token visibility = "invisible"', 'uniform token purpose = "guide"'])
def test_an_empty_stage_says_how_many_gprims_are_hidden(body):
    with pytest.raises(StageError, match="; 3 gprims are invisible, of another purpose or left out"):
        load("".join(f'def Cube "C{i}"\n{{\n{body}\n}}\n' for i in range(3)))
    with pytest.raises(StageError, match=r"default, render$"):
        load('def Xform "X"\n{\n}\n')


def test_missing_file_is_one_clear_line(tmp_path, capfd):
    with pytest.raises(StageError) as caught:
        load_stage(tmp_path / "nowhere.usda")
    assert str(caught.value) == f"{tmp_path / 'nowhere.usda'}: there is no such file"
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("bad.usda", b"#usda 1.0\ndef Cube {{{\n"),
        ("bad.usdc", b"PXR-USDC" + b"\xff" * 200),
        ("bad.usdz", b"PK no zip"),
        ("bad.txt", b"hello"),
        ("empty.usda", b""),
    ],
)
def test_unreadable_file_is_one_line_without_source_places(tmp_path, capfd, name, content):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(StageError) as caught:
        load_stage(tmp_path / name)
    message = str(caught.value)
    assert message.startswith(f"{name}: the stage cannot be opened")
    assert "\n" not in message
    assert ".cpp" not in message
    assert caught.value.__cause__ is None
    assert capfd.readouterr() == ("", "")


def test_composition_errors_are_one_warning_each_and_nothing_on_standard_error(tmp_path, capfd):
    path = tmp_path / "scene.usda"
    path.write_text(
        "#usda 1.0\n(\n    subLayers = [@gone.usda@]\n)\n"
        'def "A" (\n    references = @nowhere.usda@\n)\n{\n}\n'
        'def "B" (\n    references = </Nothing>\n)\n{\n}\n'
        'def "M" (\n    payload = @look.mtlx@\n)\n{\n}\n' + CUBE
    )
    scene = load_stage(path)
    assert mentions(scene, "gone.usda")
    assert mentions(scene, "/A", "nowhere.usda")
    assert mentions(scene, "/B", "/Nothing")
    assert mentions(scene, "/M", "look.mtlx")
    assert len(scene.warnings) == 4
    assert not any("0x" in line for line in scene.warnings)
    assert capfd.readouterr() == ("", "")


def test_open_stage_tells_of_its_composition_errors_too(capfd):
    stage = stage_of('def "A" (\n    references = @nowhere.usda@\n)\n{\n}\n' + CUBE)
    capfd.readouterr()
    assert mentions(load_stage(stage), "/A", "nowhere.usda")
    assert capfd.readouterr() == ("", "")


def test_pxr_speaks_again_after_loading(capfd):
    load(CUBE)
    Tf.Warn("still here")
    assert "still here" in capfd.readouterr().err


def test_binding_without_its_schema_is_honoured_with_a_warning_of_pxr(capfd):
    text = 'def Cube "C"\n{\n    rel material:binding = </M>\n}\ndef Material "M"\n{\n}\n'
    scene = load(text)
    assert mentions(scene, "/C", "MaterialBindingAPI")
    assert capfd.readouterr() == ("", "")


def test_many_prims_and_many_triangles_load_quickly():
    side = 40
    grid = np.arange(side * side).reshape(side, side)
    corner = grid[:-1, :-1].ravel()
    quads = np.stack([corner, corner + 1, corner + side + 1, corner + side], axis=1).astype(np.int32)
    points = np.random.default_rng(0).random((side * side, 3), np.float32)
    stage = Usd.Stage.CreateInMemory()
    for i in range(20):
        mesh = UsdGeom.Mesh.Define(stage, f"/W/M{i}")
        mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(quads.ravel()))
        mesh.CreateFaceVertexCountsAttr(Vt.IntArray(len(quads), 4))
    begin = time.process_time()  # other work on the machine does not count
    scene = load_stage(stage, complexity="low")
    # at 20 s for 1,000,000 triangles in 1,000 meshes these would take 1.2 s
    assert len(scene.geometry.triangles) == 20 * len(quads) * 2
    assert time.process_time() - begin < 1.2
