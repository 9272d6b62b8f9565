"""Warnings and notes: one line for each kind, however many prims it is said of; refusals quote what explains them."""

from __future__ import annotations

import pytest
from usd.stages import load, mentions, stage_of

from warpmis import cli
from warpmis.errors import StageError
from warpmis.usd import load_stage
from warpmis.usd.messages import Messages
from warpmis.usd.products import read_products


def lines_of(*messages: tuple[str, str]) -> list[str]:
    found = Messages()
    for path, message in messages:
        found.add(path, message)
    return list(found)


def test_the_same_of_many_prims_is_one_line_with_the_first_path_and_a_count():
    assert lines_of(("/A", "is odd"), ("/B", "is odd"), ("/C", "is odd"), ("/B", "is odd")) == [
        "/A: is odd (and 2 more like it)"
    ]
    assert lines_of(("/A", "is odd"), ("/A", "is odd")) == ["/A: is odd"]
    assert lines_of(("", "of the stage"), ("/B", "is odd")) == ["of the stage", "/B: is odd"]


@pytest.mark.parametrize(
    ("first", "second", "lines"),
    [
        ("3 faces left out", "17 faces left out", 1),
        ("its mean 0.5 is used", "its mean -1.25e-07 is used", 1),
        ("inputs:x is connected to /A/Node", "inputs:x is connected to /B/Node", 1),
        ("a1.png cannot be opened", "a2.png cannot be opened", 2),
        ("tex/7.png cannot be opened", "tex/8.png cannot be opened", 2),
        ("tile.1001.png cannot be opened", "tile.1002.png cannot be opened", 2),
        ("its material /Looks/M1 does not exist", "its material /Looks/M2 does not exist", 1),
        ("/tex/a.png cannot be opened", "/tex/b.png cannot be opened", 2),
        ("/my-files/a cannot be opened", "/my-files/b cannot be opened", 2),
        ("left out: it is red", "left out: it is green", 2),
    ],
)
def test_lines_that_differ_in_numbers_or_their_own_path_are_of_one_kind(first, second, lines):
    found = lines_of(("/A", first), ("/B", second))
    assert len(found) == lines
    assert found[0].startswith(f"/A: {first}")


def test_lines_of_pxr_are_counted_by_the_prims_that_they_name():
    found = Messages()
    for name in ("</A>", "</B/C>", "</D.inputs:x>"):
        found.add_text(f"Something is wrong with prim {name}.")
    found.add_text("Another thing.")
    assert next(iter(found)) == "Something is wrong with prim </A>. (and 2 more like it)"
    assert list(found)[-1] == "Another thing."


def test_forty_broken_meshes_and_a_missing_texture_are_two_lines():
    broken = "".join(
        f'def Mesh "Broken{i}"\n{{\nint[] faceVertexCounts = [3, {i + 4}]\n    int[] faceVertexIndices = [0, 1, 2]\n'
        "    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]\n}\n"
        for i in range(40)
    )
    dome = 'def DomeLight "Sky"\n{\n    asset inputs:texture:file = @nowhere.hdr@\n}\n'
    scene = load(broken + dome)
    assert len(scene.warnings) == 2
    assert mentions(scene, "/Broken0: ", "faceVertexCounts", "(and 39 more like it)")
    assert mentions(scene, "/Sky", "nowhere.hdr")


def test_a_scene_that_is_read_twice_counts_its_prims_once():
    far = 'double3 xformOp:translate = (1000000, 0, 0)\n    uniform token[] xformOpOrder = ["xformOp:translate"]'
    scene = load(
        "".join(
            f'def Sphere "S{i}"\n{{\n    {far}\n    color3f[] primvars:displayColor = [(7, 0, 0)]\n}}\n'
            for i in range(3)
        )
    )
    assert scene.origin.any()
    (line,) = scene.warnings
    assert line.startswith("/S0: primvars:displayColor")
    assert line.endswith("(and 2 more like it)")


BAD_MESH = """def Mesh "Only"
{
    int[] faceVertexCounts = [-4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
}
"""


def test_an_empty_stage_says_what_left_it_empty(tmp_path, capsys):
    with pytest.raises(StageError, match=r"the stage is empty.*; /Only: faceVertexCounts add up to -4") as caught:
        load(BAD_MESH)
    assert len(caught.value.warnings) == 1
    path = tmp_path / "only.usda"
    path.write_text("#usda 1.0\n" + BAD_MESH)
    assert cli.main(["render", str(path), str(tmp_path / "out.exr"), "-w", "8"]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "/Only: faceVertexCounts" in line


def test_a_refusal_quotes_three_warnings_and_counts_the_others():
    texts = [f'def "R{c}" (\n    references = @{c}.usda@\n)\n{{\n}}\n' for c in "abcde"]
    with pytest.raises(StageError, match=r"there is no such camera.*/Ra.*/Rb.*/Rc.*; and 2 more warnings$") as caught:
        load('def Cube "C"\n{\n}\n' + "".join(texts), camera="/Rd/Cam")
    assert len(caught.value.warnings) == 5


def test_what_could_not_be_composed_explains_an_empty_stage_in_one_line(tmp_path):
    path = tmp_path / "lost.usda"
    path.write_text('#usda 1.0\n(\n    subLayers = [@gone.usda@]\n)\ndef Xform "X"\n{\n}\n')
    with pytest.raises(StageError, match=r"the stage is empty.*gone\.usda") as caught:
        load_stage(path)
    assert "\n" not in str(caught.value)


def test_products_that_are_none_are_named_in_the_refusal():
    stage = stage_of('def RenderSettings "S"\n{\n    rel products = [</Gone>]\n}\n')
    with pytest.raises(StageError, match=r"no products; /S.products: its target /Gone does not exist"):
        read_products(stage, render_settings="/S")
