"""Variants, masks and session layers, and that the caller's stage is never changed."""

from __future__ import annotations

import pytest
from pxr import Sdf, Usd
from usd.stages import SQUARE, stage_of

import warpmis
from warpmis.errors import StageError
from warpmis.usd import load_stage

CAR = """
def Xform "Car" (
    variants = {
        string body = "van"
    }
    prepend variantSets = ["body", "paint"]
)
{
    variantSet "body" = {
        "van" {
            def Cube "Van"
            {
            }
        }
        "sedan" (
            prepend variantSets = "roof"
        ) {
            def Cube "Sedan"
            {
            }
            variantSet "roof" = {
                "open" {
                }
                "closed" {
                    def Cube "Roof"
                    {
                    }
                }
            }
        }
    }
    variantSet "paint" = {
        "red" {
            color3f[] primvars:displayColor = [(1, 0, 0)]
        }
    }
}
"""


def paths(scene):
    return [prim.path for prim in scene.prims]


def layers_of(stage):
    return [layer.ExportToString() for layer in (stage.GetRootLayer(), stage.GetSessionLayer())]


def test_variants_are_selected_in_order_and_the_stage_stays_as_it_was():
    stage = stage_of(CAR)
    before = layers_of(stage)
    assert paths(load_stage(stage)) == ["/Car/Van"]
    assert paths(load_stage(stage, variants=["/Car{body=sedan}"])) == ["/Car/Sedan"]
    both = load_stage(stage, variants=["/Car{body=sedan}{roof=closed}", "/Car{paint=red}"])
    assert sorted(paths(both)) == ["/Car/Roof", "/Car/Sedan"]
    assert {material.diffuse_color for material in both.materials} == {(1.0, 0.0, 0.0)}
    assert layers_of(stage) == before
    assert stage.GetEditTarget().GetLayer() == stage.GetRootLayer()


VARIANT_ERRORS = {
    "/Bus{body=van}": "/Bus: there is no such prim to select a variant of",
    "/Car{wheels=four}": "/Car: there is no variant set wheels; its variant sets: body, paint",
    "/Car{body=truck}": "/Car: variant set body has no variant 'truck'; it has: sedan, van",
    "/Car": "/Car: a variant is selected as /Prim{set=variant}",
    "body=van": "body=van: a variant is selected as /Prim{set=variant}",
    "Car{body=van}": "Car{body=van}: a variant is selected as /Prim{set=variant}",
    "/Car{body=van}Van{x=y}": "/Car{body=van}Van{x=y}: a variant is selected as /Prim{set=variant}",
}


@pytest.mark.parametrize("selection", VARIANT_ERRORS)
def test_wrong_selections_say_what_there_is(selection, capfd):
    with pytest.raises(StageError) as caught:
        load_stage(stage_of(CAR), variants=[selection])
    assert str(caught.value) == VARIANT_ERRORS[selection]
    assert capfd.readouterr().err == ""


def test_variant_inside_an_instance_cannot_be_selected():
    text = CAR + 'def Xform "Copy" (\n instanceable = true\n references = </Garage>\n)\n{\n}\n'
    text += 'def Xform "Garage"\n{\n    def "Car" (\n        references = </Car>\n    )\n    {\n    }\n}\n'
    with pytest.raises(StageError, match="/Copy/Car: its variants cannot be selected: it is part of an instance"):
        load_stage(stage_of(text), variants=["/Copy/Car{body=van}"])


ROOM = """
def Xform "Room"
{
    def Xform "Chair"
    {
        def Cube "Seat"
        {
            rel material:binding = </Room/Looks/Red>
        }
    }
    def Cube "Table"
    {
    }
    def Scope "Looks"
    {
        def Material "Red"
        {
            token outputs:surface.connect = </Room/Looks/Red/S.outputs:surface>
            def Shader "S"
            {
                uniform token info:id = "UsdPreviewSurface"
                color3f inputs:diffuseColor = (1, 0, 0)
                token outputs:surface
            }
        }
    }
}
def Cube "Tree"
{
}
""".replace('Cube "Seat"', 'Cube "Seat" (\n            prepend apiSchemas = ["MaterialBindingAPI"]\n        )')


def test_mask_loads_prims_with_what_they_refer_to():
    stage = stage_of(ROOM)
    chair = load_stage(stage, mask=["/Room/Chair"])
    assert paths(chair) == ["/Room/Chair/Seat"]
    assert [material.path for material in chair.materials] == ["/Room/Looks/Red"]
    assert sorted(paths(load_stage(stage, mask=["/Room/Chair", "/Tree"]))) == ["/Room/Chair/Seat", "/Tree"]
    assert len(paths(load_stage(stage))) == 3


@pytest.mark.parametrize(
    ("mask", "message"),
    [
        ("/Room/Sofa", "/Room/Sofa: there is no such prim to mask"),
        ("Room", "Room: a mask needs absolute prim paths"),
        ("/Room.x", "/Room.x: a mask needs absolute prim paths"),
        ("/Room/", "/Room/: a mask needs absolute prim paths"),
    ],
)
def test_wrong_masks_are_errors(mask, message):
    with pytest.raises(StageError) as caught:
        load_stage(stage_of(ROOM), mask=[mask])
    assert str(caught.value) == message


def test_session_layer_is_stronger_than_the_stage_and_stays_as_it_was(tmp_path):
    (tmp_path / "part.usda").write_text(f'#usda 1.0\ndef Mesh "Part"\n{{\n{SQUARE}}}\n')
    (tmp_path / "stage.usda").write_text('#usda 1.0\ndef Cube "A"\n{\n    double size = 2\n}\n')
    session = tmp_path / "session.usda"
    session.write_text(
        '#usda 1.0\n(\n    startTimeCode = 7\n)\nover "A"\n{\n    double size.timeSamples = { 0: 1, 7: 8 }\n}\n'
        'def "B" (\n    references = @./part.usda@</Part>\n)\n{\n}\n'
    )
    scene = load_stage(tmp_path / "stage.usda", session_layer=session)
    assert paths(scene) == ["/A", "/B"]  # its own relative paths are found
    assert scene.geometry.points.max() == 4.0  # its start time is the stage's
    before = session.read_text()
    stage = Usd.Stage.Open(str(tmp_path / "stage.usda"))
    stage.GetSessionLayer().ImportFromString('#usda 1.0\ndef Cube "Own"\n{\n}\n')
    own = stage.GetSessionLayer().ExportToString()
    both = load_stage(stage, session_layer=session, variants=[])
    assert sorted(paths(both)) == ["/A", "/B", "/Own"]
    assert session.read_text() == before
    assert not Sdf.Layer.Find(str(session)) or not Sdf.Layer.Find(str(session)).dirty
    assert stage.GetSessionLayer().ExportToString() == own
    assert not stage.GetRootLayer().dirty


@pytest.mark.parametrize(("name", "content"), [("missing.usda", None), ("bad.usda", "#usda 1.0\ndef def")])
def test_session_layer_that_cannot_be_opened_is_an_error(tmp_path, capfd, name, content):
    if content:
        (tmp_path / name).write_text(content)
    with pytest.raises(StageError, match=f"{name}: the session layer cannot be opened"):
        load_stage(stage_of(CAR), session_layer=tmp_path / name)
    assert capfd.readouterr().err == ""


def test_what_the_caller_masked_and_muted_stays_so(tmp_path):
    (tmp_path / "more.usda").write_text('#usda 1.0\ndef Cube "More"\n{\n}\n')
    (tmp_path / "stage.usda").write_text("#usda 1.0\n(\n    subLayers = [@./more.usda@]\n)\n" + CAR + ROOM)
    stage = Usd.Stage.OpenMasked(str(tmp_path / "stage.usda"), Usd.StagePopulationMask(["/Car", "/More"]))
    selection = ["/Car{body=sedan}"]
    assert sorted(paths(load_stage(stage, variants=selection))) == ["/Car/Sedan", "/More"]
    stage.MuteLayer(str(tmp_path / "more.usda"))
    assert paths(load_stage(stage, variants=selection)) == ["/Car/Sedan"]


def test_render_hands_all_stage_options_to_the_reader(monkeypatch):
    given = {"time": 3.0, "complexity": "low", "variants": ["/A{b=c}"], "mask": ["/A"], "session_layer": "s.usda"}
    given |= {"camera": "/C", "purposes": ("proxy",), "render_settings": "/R", "product": "/P"}
    seen = {}

    def load(stage, **options):
        seen.update(options)
        raise StageError("seen")

    monkeypatch.setattr("warpmis.usd.load_stage", load)
    with pytest.raises(StageError, match="seen"):
        warpmis.render("stage.usda", width=32, **given)
    assert seen == given | {"width": 32}
