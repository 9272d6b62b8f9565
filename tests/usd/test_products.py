"""RenderProducts: which files, which channels, and what a product overrides."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from usd.stages import stage_of

from warpmis.cli import main
from warpmis.errors import StageError
from warpmis.output.exr import read_exr
from warpmis.usd import load_stage
from warpmis.usd.products import read_products

HEAD = '(\n    renderSettingsPrimPath = "/Render/Settings"\n    startTimeCode = 1\n)\n'
SCENE = """
def Camera "A" {}
def Camera "B" {
    double3 xformOp:translate = (0, 0, 9)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def DomeLight "Sky" {
    float inputs:intensity.timeSamples = { 0: 0, 100: 100 }
}
"""


def var(name: str, source: str = "", extra: str = "") -> str:
    return f'def RenderVar "{name}" {{\nuniform string sourceName = "{source}"\n{extra}\n}}\n'


def product(name: str, body: str, variables: str = "") -> str:
    targets = ", ".join(f"</Render/{one}>" for one in variables.split())
    return f'def RenderProduct "{name}" {{\n{body}\nrel orderedVars = [{targets}]\n}}\n'


def text(*prims: str, products: str = "P") -> str:
    targets = ", ".join(f"</Render/{name}>" for name in products.split())
    body = f"rel products = [{targets}]\nint2 resolution = (8, 4)\nrel camera = </A>\n"
    settings = f'def RenderSettings "Settings" {{\n{body}}}\n'
    return HEAD + 'def Scope "Render" {\n' + settings + "".join(prims) + "}\n" + SCENE


def only(*prims: str):
    (found,) = read_products(stage_of(text(*prims)))
    return found


@pytest.mark.parametrize(
    ("name", "file"),
    [
        ("beauty.exr", "beauty.exr"),
        ("beauty.PNG", "beauty.PNG"),
        ("", "P.exr"),
        ("/etc/x/beauty.exr", "beauty.exr"),
        ("../../b.exr", "b.exr"),
        ("..", "P.exr"),
        ("C:\\\\x\\\\b.exr", "b.exr"),
        ("b.tif", "b.tif.exr"),
    ],
)
def test_a_stage_names_files_but_not_folders(name: str, file: str) -> None:
    assert only(product("P", f'token productName = "{name}"')).file == file


@pytest.mark.parametrize(
    ("variable", "channels"),
    [
        (var("color"), {"R": "R", "G": "G", "B": "B"}),
        (var("Ci", extra='uniform token dataType = "color4f"'), {"R": "R", "G": "G", "B": "B", "A": "A"}),
        (var("look", "lpe:C.*"), {"look.R": "R", "look.G": "G", "look.B": "B"}),
        (var("look", "C.*", 'uniform token sourceType = "lpe"'), {"look.R": "R", "look.G": "G", "look.B": "B"}),
        (var("a"), {"A": "A"}),
        (var("cover", "alpha"), {"cover": "A"}),
        (var("depth"), {"Z": "Z"}),
        (var("N"), {"N.X": "N.X", "N.Y": "N.Y", "N.Z": "N.Z"}),
        (var("sheen", "specular_direct"), {f"sheen.{c}": f"direct_specular.{c}" for c in "RGB"}),
        (var("emission"), {f"emission.{c}": f"emission.{c}" for c in "RGB"}),
        (var("rd", "lpe:C<RD>[<L.>O]"), {f"rd.{c}": f"var.rd.{c}" for c in "RGB"}),
        (var("all", "lpe:C[DS]*[<L.>O]"), {"all.R": "R", "all.G": "G", "all.B": "B"}),
        (var("st", extra='uniform token sourceType = "primvar"'), {"st.U": "uv.U", "st.V": "uv.V"}),
        (var("paint", "albedo"), {"paint.R": "albedo.R", "paint.G": "albedo.G", "paint.B": "albedo.B"}),
    ],
)
def test_variables_are_channels(variable: str, channels: dict[str, str]) -> None:
    name = variable.split('"')[1]
    found = only(variable, product("P", "", name))
    assert found.channels == channels
    assert not found.warnings


def test_variables_ask_the_render_for_aovs() -> None:
    lpe = 'uniform token sourceType = "lpe"'
    found = only(
        var("key", "C.*<L.'key'>", lpe), var("uv"), var("caustics", "CDS+L", lpe), var("coat", "C<RS'coat'>L", lpe),
        product("P", "", "key uv caustics coat"),
    )  # fmt: skip
    assert found.aovs == ("var.key=C.*<L.'key'>", "uv")
    assert [line.split(":")[0] for line in found.warnings] == ["/Render/caustics", "/Render/coat"]


def test_what_is_not_supported_is_a_warning_and_the_rest_is_written() -> None:
    found = only(
        var("id", "pointId"), var("st", "color", 'uniform token sourceType = "primvar"'), var("z"),
        product("P", 'uniform token productType = "deepRaster"', "id st z Nope"),
    )  # fmt: skip
    assert found.channels == {"Z": "Z"}
    where = [line.split(":")[0] for line in found.warnings]
    assert where == ["/Render/P", "/Render/P.orderedVars", "/Render/id", "/Render/st"]
    assert only(product("P", "")).channels is None
    assert only(var("id", "pointId"), product("P", "", "id")).channels is None


def test_a_product_overrides_the_settings() -> None:
    stage = stage_of(text(product("P", "int2 resolution = (5, 5)\nrel camera = </B>"), product("Q", "")))
    scene = load_stage(stage, product="/Render/P")
    assert (scene.resolution, scene.camera.path) == ((5, 5), "/B")
    scene = load_stage(stage, product="/Render/Q")
    assert (scene.resolution, scene.camera.path) == ((8, 4), "/A")
    assert load_stage(stage, product="/Render/P", camera="/A").camera.path == "/A"
    with pytest.raises(StageError, match="no RenderProduct"):
        load_stage(stage, product="/A")


def test_no_products_are_an_error() -> None:
    with pytest.raises(StageError, match="no products"):
        read_products(stage_of(text(products="Nope")))
    with pytest.raises(StageError, match="no RenderSettings"):
        read_products(stage_of(SCENE))


@pytest.fixture
def stage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    Path("s.usda").write_text(
        "#usda 1.0\n"
        + text(
            var("color"), var("z"), var("id"),
            product("P", 'token productName = "p.##.exr"', "color z id"),
            product("Q", 'token productName.timeSamples = {1: "first.png", 2: "second.png"}\nint2 resolution = (2, 2)'),
            products="P Q",
        )
    )  # fmt: skip
    Path("out").mkdir()
    return "s.usda"


SMALL = "--spp 2 --method nee".split()


def test_products_of_each_frame(stage: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["render", stage, "--products", "out", "--frames", "1:2", "--json", *SMALL]) == 0
    assert sorted(path.name for path in Path("out").iterdir()) == ["first.png", "p.01.exr", "p.02.exr", "second.png"]
    channels, _ = read_exr("out/p.02.exr")
    assert set(channels) == {"R", "G", "B", "Z"}
    np.testing.assert_allclose(channels["R"], np.full((4, 8), 2.0))
    assert oiio.ImageInput.open("out/first.png").spec().width == 2
    captured = capsys.readouterr()
    assert [one["product"] for one in json.loads(captured.out)["products"]] == ["/Render/P", "/Render/Q"] * 2
    assert captured.err.count("/Render/id") == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--products", "out", "--png", "a.png"], "drop --png"),
        (["a.exr", "--products", "out"], "drop OUT"),
        (["--products", "out", "--frames", "3:4"], "the same file"),  # Q's name is the same from 2 on
    ],
)
def test_contradictions_are_one_line(stage: str, capsys: pytest.CaptureFixture[str], options, message: str) -> None:
    assert main(["render", stage, *options]) == 2
    said = capsys.readouterr().err
    assert message in said and said.count("\n") == 1
    assert not list(Path("out").iterdir())
