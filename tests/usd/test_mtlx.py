"""References to MaterialX files: the stage opens with the file's materials, and no layer is changed."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, Usd
from usd.networks import square, the
from usd.pictures import write
from usd.points import seen_at
from usd.stages import mentions

from warpmis.errors import StageError
from warpmis.scene import Scene
from warpmis.usd import load_stage

pytest.importorskip("MaterialX")

SQUARE = """    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] ( interpolation = "vertex" )
"""
PAINT = """<standard_surface name="S" type="surfaceshader">
    <input name="base" type="float" value="0.5" />
    <input name="base_color" type="color3" value="0.5, 0.25, 1" />
    <input name="specular_roughness" type="float" value="0.375" />
  </standard_surface>
  <surfacematerial name="Paint" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="S" />
  </surfacematerial>"""
EXPECTED = """float inputs:base = 0.5
    color3f inputs:base_color = (0.5, 0.25, 1)
    float inputs:specular_roughness = 0.375"""


def document(path: Path, content: str = PAINT, attributes: str = "") -> Path:
    path.write_text(f'<?xml version="1.0"?>\n<materialx version="1.39" {attributes}>\n  {content}\n</materialx>\n')
    return path


def stage(folder: Path, arc: str = "references = @look.mtlx@</MaterialX/Materials>", more: str = "") -> Path:
    """A square whose material is Paint of what the prim Looks refers to."""
    path = folder / "scene.usda"
    path.write_text(f"""#usda 1.0
def Mesh "Q" ( prepend apiSchemas = ["MaterialBindingAPI"] )
{{
{SQUARE}
    rel material:binding = </Looks/Paint>
}}
def "Looks" (
    {arc}
)
{{
    {more}
}}
""")
    return path


def colors(content: str, folder: Path, attributes: str = "") -> np.ndarray:
    """What a document's material diffusely reflects in the middle of a square."""
    document(folder / "look.mtlx", content, attributes)
    scene = load_stage(stage(folder))
    assert scene.warnings == ()
    return seen_at(scene, [(0.5, 0.5)])["diffuse"][0]


def with_color(color: str, before: str = "") -> str:
    """A document whose material's base colour is this input."""
    return f"""{before}
  <standard_surface name="S" type="surfaceshader">
    {color}
  </standard_surface>
  <surfacematerial name="Paint" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="S" />
  </surfacematerial>"""


def assert_is_paint(scene: Scene) -> None:
    expected = the(square("ND_standard_surface_surfaceshader", EXPECTED))
    found = the(scene)
    assert found.diffuse_color == expected.diffuse_color and found.roughness == expected.roughness


@pytest.mark.parametrize(
    "arc",
    [
        "references = @look.mtlx@</MaterialX/Materials>",
        "prepend references = @./look.mtlx@</MaterialX/Materials>",
        "append references = [@look.mtlx@</MaterialX/Materials>]",
        "payload = @look.mtlx@</MaterialX/Materials>",
        "prepend payload = @look.mtlx@</MaterialX/Materials>",
    ],
)
def test_every_kind_of_arc(tmp_path: Path, arc: str) -> None:
    document(tmp_path / "look.mtlx")
    scene = load_stage(stage(tmp_path, arc))
    assert_is_paint(scene)
    assert scene.name == "scene.usda" and scene.materials[0].path == "/Looks/Paint"


def test_without_a_prim_path_it_is_the_whole_file(tmp_path: Path) -> None:
    document(tmp_path / "look.mtlx")
    path = stage(tmp_path, "references = @look.mtlx@")
    path.write_text(path.read_text().replace("</Looks/Paint>", "</Looks/Materials/Paint>"))
    assert_is_paint(load_stage(path))


def test_a_material_alone(tmp_path: Path) -> None:
    document(tmp_path / "look.mtlx")
    path = stage(tmp_path, "")
    over = 'def "Paint" ( references = @look.mtlx@</MaterialX/Materials/Paint> )\n    {\n    }\n'
    path.write_text(path.read_text().replace("(\n    \n)", "").replace("    \n}", f"    {over}}}"))
    assert_is_paint(load_stage(path))


def test_stronger_opinions_win(tmp_path: Path) -> None:
    document(tmp_path / "look.mtlx")
    over = 'over "Paint"\n{\nover "S"\n{\nfloat inputs:specular_roughness = 0.625\n}\n}\n'
    assert the(load_stage(stage(tmp_path, more=over))).roughness == 0.625


def test_weaker_references_stay_weaker(tmp_path: Path) -> None:
    """The order of the references of a prim is kept, whichever of them is a MaterialX file."""
    document(tmp_path / "look.mtlx")
    (tmp_path / "other.usda").write_text("""#usda 1.0
( defaultPrim = "Looks" )
def "Looks"
{
    over "Paint"
    {
        over "S"
        {
            float inputs:specular_roughness = 0.625
        }
    }
}
""")
    names = ("@other.usda@", "@look.mtlx@</MaterialX/Materials>")
    assert the(load_stage(stage(tmp_path, f"references = [{names[0]}, {names[1]}]"))).roughness == 0.625
    assert the(load_stage(stage(tmp_path, f"references = [{names[1]}, {names[0]}]"))).roughness == 0.375


def test_sublayers_and_variants(tmp_path: Path) -> None:
    document(tmp_path / "look.mtlx")
    inner = stage(tmp_path, """variants = { string look = "painted" }
    prepend variantSets = "look" """, """variantSet "look" = {
        "painted" ( references = @look.mtlx@</MaterialX/Materials> ) {
        }
        "bare" {
        }
    }""")  # fmt: skip
    outer = tmp_path / "outer.usda"
    outer.write_text(f'#usda 1.0\n(\n    upAxis = "Z"\n    subLayers = [@{inner.name}@]\n)\n')
    assert_is_paint(load_stage(outer))
    bare = load_stage(outer, variants=["/Looks{look=bare}"])
    assert mentions(bare, "/Looks/Paint", "does not exist")


def test_a_variant_that_the_caller_selects(tmp_path: Path) -> None:
    document(tmp_path / "look.mtlx")
    path = stage(tmp_path, 'prepend variantSets = "look"', """variantSet "look" = {
        "painted" ( references = @look.mtlx@</MaterialX/Materials> ) {
        }
    }""")  # fmt: skip
    assert_is_paint(load_stage(path, variants=["/Looks{look=painted}"]))


def test_instances_of_an_asset_stay_instances(tmp_path: Path) -> None:
    document(tmp_path / "look.mtlx")
    asset = stage(tmp_path).read_text().replace('def Mesh "Q"', 'def Xform "Asset"\n{\ndef Mesh "Q"', 1) + "}\n"
    asset = asset.replace("#usda 1.0", '#usda 1.0\n( defaultPrim = "Asset" )')
    (tmp_path / "asset.usda").write_text(asset.replace("</Looks", "</Asset/Looks"))
    one = """def Xform "{name}" ( instanceable = true
    references = @asset.usda@ )
{{
    double3 xformOp:translate = ({x}, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
"""
    path = tmp_path / "shot.usda"
    path.write_text("#usda 1.0\n" + one.format(name="A", x=0) + one.format(name="B", x=3))
    scene = load_stage(path)
    assert_is_paint(scene)
    assert sorted(prim.path for prim in scene.prims) == ["/A/Q", "/B/Q"]


def test_a_stage_that_is_passed_in_is_not_changed(tmp_path: Path) -> None:
    document(tmp_path / "look.mtlx")
    path = stage(tmp_path)
    opened = Usd.Stage.Open(str(path))
    text, of_layer = opened.ExportToString(), opened.GetRootLayer().ExportToString()
    assert_is_paint(load_stage(opened))
    assert opened.ExportToString() == text and not opened.GetRootLayer().dirty
    assert len(opened.GetCompositionErrors()) == 1
    assert Sdf.Layer.FindOrOpen(str(path)).ExportToString() == of_layer


def test_the_callers_session_layer_counts(tmp_path: Path) -> None:
    document(tmp_path / "look.mtlx")
    opened = Usd.Stage.Open(str(stage(tmp_path, "")))
    opened.SetEditTarget(opened.GetSessionLayer())
    opened.GetPrimAtPath("/Looks").GetReferences().AddReference(str(tmp_path / "look.mtlx"), "/MaterialX/Materials")
    assert_is_paint(load_stage(opened))


def test_a_stage_without_a_session_layer(tmp_path: Path) -> None:
    document(tmp_path / "look.mtlx")
    opened = Usd.Stage.Open(Sdf.Layer.FindOrOpen(str(stage(tmp_path))), sessionLayer=None)
    assert not opened.GetSessionLayer()
    assert_is_paint(load_stage(opened))


def test_a_file_within_a_package(tmp_path: Path) -> None:
    document(tmp_path / "look.mtlx")
    with Sdf.ZipFileWriter.CreateNew(str(tmp_path / "all.usdz")) as package:
        package.AddFile(str(stage(tmp_path)), "scene.usda")
        package.AddFile(str(tmp_path / "look.mtlx"), "look.mtlx")
    scene = load_stage(tmp_path / "all.usdz")
    assert_is_paint(scene)
    assert scene.name == "all.usdz"
    outer = tmp_path / "outer.usda"
    outer.write_text("#usda 1.0\n(\n    subLayers = [@all.usdz@]\n)\n")
    assert_is_paint(load_stage(outer))
    outer.write_text("""#usda 1.0
def "Looks" ( references = @all.usdz@</Looks> )
{
}
def "Q" ( references = @all.usdz@</Q> )
{
    rel material:binding = </Looks/Paint>
}
""")
    assert_is_paint(load_stage(outer))


def bound_to_the_library(folder: Path, head: str) -> Path:
    """A square whose material is the file's own, at its own place."""
    path = stage(folder, "")
    text = path.read_text().replace("</Looks/Paint>", "</MaterialX/Materials/Paint>").replace("(\n    \n)", "")
    path.write_text(text.replace("#usda 1.0", f"#usda 1.0\n{head}"))
    return path


def test_a_sublayer(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    document(tmp_path / "look.mtlx")
    inner = bound_to_the_library(tmp_path, "( subLayers = [@look.mtlx@] )")
    assert_is_paint(load_stage(inner))
    outer = tmp_path / "outer.usda"
    outer.write_text(f"#usda 1.0\n( subLayers = [@{inner.name}@] )\n")
    assert_is_paint(load_stage(outer))
    (tmp_path / "look.mtlx").unlink()
    assert mentions(load_stage(inner), "look.mtlx", "does not exist")
    assert capfd.readouterr().err == ""


def test_a_session_layer(tmp_path: Path) -> None:
    look = document(tmp_path / "look.mtlx")
    assert_is_paint(load_stage(bound_to_the_library(tmp_path, ""), session_layer=look))
    look.write_text("<materialx")
    with pytest.raises(StageError, match=r"look\.mtlx: the session layer cannot be opened"):
        load_stage(tmp_path / "scene.usda", session_layer=look)


def test_a_file_alone_is_no_stage(tmp_path: Path) -> None:
    with pytest.raises(StageError, match=r"look\.mtlx: it holds materials alone"):
        load_stage(document(tmp_path / "look.mtlx"))


def test_color_spaces_of_colors_and_files(tmp_path: Path) -> None:
    linear, encoded = '<input name="base_color" type="color3" value="0.5, 0.5, 0.5" {} />', 0.2140411
    for attributes, own, expected in (
        ("", "", 0.5),
        ('colorspace="lin_rec709"', "", 0.5),
        ('colorspace="srgb_texture"', "", encoded),
        ('colorspace="lin_rec709"', 'colorspace="srgb_texture"', encoded),
        ('colorspace="g22_rec709"', "", 0.5**2.2),
        ('colorspace="g18_rec709"', "", 0.5**1.8),
        ('colorspace="acescg"', "", 0.5),
    ):
        white = '<input name="base" type="float" value="1" />'
        found = colors(with_color(white + linear.format(own)), tmp_path, attributes)
        np.testing.assert_allclose(found, expected, rtol=1e-4, err_msg=attributes + own)
    file = write(tmp_path / "c.png", np.full((2, 2, 3), 0.5), "uint8")
    for space, expected in (("srgb_texture", encoded), ("lin_rec709", 0.5), ("g22_rec709", 0.5**2.2)):
        image = f"""<image name="I" type="color3">
    <input name="file" type="filename" value="{file.name}" colorspace="{space}" />
  </image>"""
        found = colors(with_color('<input name="base_color" type="color3" nodename="I" />', image), tmp_path)
        np.testing.assert_allclose(found, expected, atol=0.003)


def test_a_file_prefix_and_tiles(tmp_path: Path) -> None:
    (tmp_path / "tex").mkdir()
    write(tmp_path / "tex" / "c.1001.exr", np.full((2, 2, 3), 0.25))
    image = """<image name="I" type="color3">
    <input name="file" type="filename" value="c.&lt;UDIM&gt;.exr" />
  </image>"""
    connected = '<input name="base_color" type="color3" nodename="I" />'
    np.testing.assert_allclose(colors(with_color(connected, image), tmp_path, 'fileprefix="tex/"'), 0.25, rtol=1e-3)


GRAPH = """<nodegraph name="G">
    <input name="tint" type="color3" value="1, 0.5, 0.25" />
    <multiply name="half" type="color3">
      <input name="in1" type="color3" interfacename="tint" />
      <input name="in2" type="float" value="0.5" />
    </multiply>
    <separate3 name="parts" type="multioutput">
      <input name="in" type="color3" nodename="half" />
    </separate3>
    <output name="color" type="color3" nodename="half" />
    <output name="green" type="float" nodename="parts" output="outg" />
  </nodegraph>"""


def test_node_graphs_with_an_interface_and_several_outputs(tmp_path: Path) -> None:
    color = '<input name="base_color" type="color3" nodegraph="G" output="color" />'
    np.testing.assert_allclose(colors(with_color(color, GRAPH), tmp_path), [0.5, 0.25, 0.125])
    metal = '<input name="metalness" type="float" nodegraph="G" output="green" />'
    np.testing.assert_allclose(colors(with_color(metal, GRAPH), tmp_path), 0.75 * 0.8)


def test_nodes_that_the_file_defines(tmp_path: Path) -> None:
    """By graphs of their own, and with the defaults of their definition."""
    own = """<nodedef name="ND_halved_color3" node="halved">
    <input name="in" type="color3" value="1, 0.5, 0.25" />
    <output name="out" type="color3" />
  </nodedef>
  <nodegraph name="NG_halved_color3" nodedef="ND_halved_color3">
    <multiply name="half" type="color3">
      <input name="in1" type="color3" interfacename="in" />
      <input name="in2" type="float" value="0.5" />
    </multiply>
    <output name="out" type="color3" nodename="half" />
  </nodegraph>
  <halved name="H" type="color3" />"""
    found = colors(with_color('<input name="base_color" type="color3" nodename="H" />', own), tmp_path)
    np.testing.assert_allclose(found, [0.5, 0.25, 0.125])


def test_nodes_of_the_library_that_are_graphs(tmp_path: Path) -> None:
    """glTF's image node: a factor, a picture and a channel of it."""
    write(tmp_path / "c.exr", np.broadcast_to(np.array([0.25, 0.5, 0.75]), (2, 2, 3)).copy())
    image = """<gltf_colorimage name="I" type="multioutput">
    <input name="file" type="filename" value="c.exr" />
    <input name="color" type="color4" value="1, 0.5, 0.25, 1" />
  </gltf_colorimage>"""
    found = colors(
        with_color('<input name="base_color" type="color3" nodename="I" output="outcolor" />', image), tmp_path
    )
    np.testing.assert_allclose(found, [0.25, 0.25, 0.1875], rtol=1e-3)


def test_disneys_surface_is_a_graph_of_the_library(tmp_path: Path) -> None:
    content = PAINT.replace("standard_surface", "disney_principled").replace('name="base" type="float" value="0.5"',
            'name="metallic" type="float" value="0.25"').replace("base_color", "baseColor")  # fmt: skip
    document(tmp_path / "look.mtlx", content.replace("specular_roughness", "roughness"))
    scene = load_stage(stage(tmp_path))
    assert mentions(scene, "roughness of ND_burley_diffuse_bsdf") and len(scene.warnings) == 1
    # The library's graph weighs the diffuse node by 1 - metallic, and mixes it with the metal by that again.
    seen = seen_at(scene, [(0.5, 0.5)])
    np.testing.assert_allclose(seen["diffuse"][0], 0.75**2 * np.array([0.5, 0.25, 1]), rtol=1e-4)
    np.testing.assert_allclose(seen["specular_f0"][0], 0.75 * 0.04 + 0.25 * np.array([0.5, 0.25, 1]), rtol=1e-4)


def test_shapes_of_the_library_are_graphs_of_coordinates(tmp_path: Path) -> None:
    """A circle, and a ramp of three colors: drawn from coordinates, texel by texel."""
    connected = '<input name="base_color" type="color3" nodename="C" />'
    circle = """<circle name="O" type="float">
    <input name="center" type="vector2" value="0.5, 0.5" />
    <input name="radius" type="float" value="0.25" />
  </circle>
  <convert name="C" type="color3"><input name="in" type="float" nodename="O" /></convert>"""
    document(tmp_path / "look.mtlx", with_color(connected, circle))
    scene = load_stage(stage(tmp_path))
    assert scene.warnings == ()
    found = seen_at(scene, [(0.5, 0.5), (0.65, 0.5), (0.85, 0.5), (0.7, 0.7)])["diffuse"][:, 0]
    np.testing.assert_allclose(found, [1, 1, 0, 0], atol=1e-4)
    ramp = """<ramp name="R" type="color4">
    <input name="num_intervals" type="integer" value="3" />
    <input name="interval1" type="float" value="0" />
    <input name="color1" type="color4" value="1, 0, 0, 1" />
    <input name="interval2" type="float" value="0.5" />
    <input name="color2" type="color4" value="0, 1, 0, 1" />
    <input name="interval3" type="float" value="1" />
    <input name="color3" type="color4" value="0, 0, 1, 1" />
    <input name="interpolation" type="integer" value="0" />
  </ramp>
  <convert name="C" type="color3"><input name="in" type="color4" nodename="R" /></convert>"""
    document(tmp_path / "look.mtlx", with_color(connected, ramp))
    scene = load_stage(stage(tmp_path))
    assert scene.warnings == ()
    found = seen_at(scene, [(0.25, 0.5), (0.5, 0.5), (0.875, 0.5)])["diffuse"]
    np.testing.assert_allclose(found, [[0.5, 0.5, 0], [0, 1, 0], [0, 0.25, 0.75]], atol=5e-3)


def test_files_that_a_file_includes(tmp_path: Path) -> None:
    document(tmp_path / "inner.mtlx", GRAPH)
    color = '<input name="base_color" type="color3" nodegraph="G" output="color" />'
    include = '<xi:include href="inner.mtlx" />'
    found = colors(with_color(color, include), tmp_path, 'xmlns:xi="http://www.w3.org/2001/XInclude"')
    np.testing.assert_allclose(found, [0.5, 0.25, 0.125])


def test_files_before_1_39(tmp_path: Path) -> None:
    """Older versions are upgraded: channels of connected inputs, and swizzles."""
    constant = '<constant name="C" type="color3"><input name="value" type="color3" value="0.25, 0.5, 1" /></constant>'
    (tmp_path / "look.mtlx").write_text(f"""<?xml version="1.0"?>
<materialx version="1.38">
  {with_color('<input name="base_color" type="color3" nodename="C" channels="gbr" />', constant)}
</materialx>
""")
    scene = load_stage(stage(tmp_path))
    assert scene.warnings == ()
    np.testing.assert_allclose(seen_at(scene, [(0.5, 0.5)])["diffuse"][0], [0.5, 1, 0.25])


@pytest.mark.parametrize("content", ["<materialx", "", "<a/>", '<materialx version="x"><image name="I"/></materialx>'])
def test_a_broken_file_is_a_warning(tmp_path: Path, content: str) -> None:
    (tmp_path / "look.mtlx").write_text(content)
    scene = load_stage(stage(tmp_path))
    assert len(scene.warnings) >= 1 and not any("Traceback" in line or "anon:" in line for line in scene.warnings)
    assert scene.materials[0].diffuse_color == (0.18, 0.18, 0.18)


def test_a_definition_that_contains_itself_is_a_warning(tmp_path: Path) -> None:
    own = """<nodedef name="ND_a_color3" node="a">
    <input name="in" type="color3" value="1, 1, 1" />
    <output name="out" type="color3" />
  </nodedef>
  <nodegraph name="NG_a" nodedef="ND_a_color3">
    <a name="x" type="color3"><input name="in" type="color3" interfacename="in" /></a>
    <output name="out" type="color3" nodename="x" />
  </nodegraph>
  <a name="C" type="color3" />"""
    document(tmp_path / "look.mtlx", with_color('<input name="base_color" type="color3" nodename="C" />', own))
    assert mentions(load_stage(stage(tmp_path)), "/Looks", "look.mtlx", "stand for graphs")


@pytest.mark.parametrize("length, expected", [(90, 0.5 + 90 / 256), (3000, None)])
def test_a_long_chain_of_nodes(tmp_path: Path, length: int, expected: float | None) -> None:
    """It ends after a hundred nodes, with a warning; no stack is deep enough for any length."""
    nodes = '<constant name="N0" type="float"><input name="value" type="float" value="0.5" /></constant>'
    for k in range(length):
        nodes += f"""<add name="N{k + 1}" type="float">
    <input name="in1" type="float" nodename="N{k}" />
    <input name="in2" type="float" value="0.00390625" />
  </add>"""
    nodes += f"""<convert name="C" type="color3">
    <input name="in" type="float" nodename="N{length}" />
  </convert>"""
    document(tmp_path / "look.mtlx", with_color('<input name="base_color" type="color3" nodename="C" />', nodes))
    scene = load_stage(stage(tmp_path))
    if expected is not None:
        assert scene.warnings == ()
        np.testing.assert_allclose(seen_at(scene, [(0.5, 0.5)])["diffuse"], expected, rtol=1e-5)
    else:
        assert len(scene.warnings) <= 1


def test_values_of_the_wrong_length_are_left_out(tmp_path: Path) -> None:
    bad = """<input name="base_color" type="color3" value="0.5, 0.25" />
    <input name="specular_roughness" type="float" value="0.5, 0.5" />
    <input name="metalness" type="float" value="much" />"""
    np.testing.assert_allclose(colors(with_color(bad), tmp_path), 0.8, rtol=1e-6)


def damaged(text: str, seed: int) -> str:
    """A file's text with some characters, values and lines that are others', gone, or twice."""
    random = np.random.default_rng(seed)
    for _ in range(int(random.integers(1, 6))):
        choice, lines = random.random(), text.split("\n")
        place = int(random.integers(len(lines)))
        if choice < 0.3:
            at = int(random.integers(len(text)))
            text = text[:at] + str(random.choice(list('"<>/ 0-,'))) + text[at + int(random.integers(3)) :]
        elif choice < 0.6:
            old, new = random.choice(re.findall(r'"([^"]*)"', text) or ["a"], 2)
            text = text.replace(f'"{old}"', f'"{new}"', 2)
        else:
            other = lines[int(random.integers(len(lines)))]
            text = "\n".join(lines[:place] + ([other] if choice < 0.8 else []) + lines[place + (choice >= 0.8) :])
    return text


@pytest.mark.parametrize("name", ["standard_surface", "graphs", "bsdf_nodes"])
def test_damaged_files_are_read_or_refused(tmp_path: Path, name: str) -> None:
    """Whatever is broken in them: a scene, and at most warnings."""
    text = (LOOKS / f"{name}.mtlx").read_text()
    materials = re.findall(r'surfacematerial name="(\w+)"', text)
    for seed in range(25):
        file = tmp_path / f"{seed}.mtlx"
        file.write_text(damaged(text, seed))
        scene = load_stage(_square_of(file, materials[seed % len(materials)]))
        assert not any("anon:" in line for line in scene.warnings)
        assert len(scene.materials) == 1


def test_a_missing_file_is_named_with_the_prim(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    scene = load_stage(stage(tmp_path))
    assert mentions(scene, "/Looks", "look.mtlx", "does not exist")
    assert capfd.readouterr().err == ""


def test_without_materialx_a_line_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    document(tmp_path / "look.mtlx")
    monkeypatch.setitem(sys.modules, "MaterialX", None)
    assert mentions(load_stage(stage(tmp_path)), "/Looks", "look.mtlx", "pip install", "warpmis[materialx]")


def test_other_composition_errors_are_still_named(tmp_path: Path) -> None:
    document(tmp_path / "look.mtlx")
    path = stage(tmp_path)
    path.write_text(path.read_text() + 'def "Other" ( references = @nowhere.usda@ )\n{\n}\n')
    scene = load_stage(path)
    assert mentions(scene, "/Other", "nowhere.usda", "scene.usda")
    assert len(scene.warnings) == 1 and "anon:" not in scene.warnings[0]


LOOKS = Path(__file__).parent / "looks"
# What is left out of each of our looks, by the material's name.
LEFT_OUT = {"skin": "subsurface", "marble": "ND_noise3d_float", "disney": "roughness of ND_burley_diffuse_bsdf"}


def look(name: str, material: str) -> Scene:
    """A square of one material of one of our own files."""
    scene = load_stage(_square_of(LOOKS / f"{name}.mtlx", material))
    expected = LEFT_OUT.get(material)
    assert len(scene.warnings) == (expected is not None)
    assert expected is None or expected in scene.warnings[0]
    return scene


def _square_of(file: Path, material: str) -> Usd.Stage:
    found = Usd.Stage.CreateInMemory()
    found.GetRootLayer().ImportFromString(f"""#usda 1.0
def Mesh "Q" ( prepend apiSchemas = ["MaterialBindingAPI"] )
{{
{SQUARE}
    color3f[] primvars:displayColor = [(0.25, 0.5, 1)]
    rel material:binding = </M>
}}
def "M" ( references = @{file}@</MaterialX/Materials/{material}> )
{{
}}
""")
    return found


@pytest.mark.parametrize(
    "name, material, diffuse, reflectance, alpha",
    [
        ("standard_surface", "default", (0.8, 0.8, 0.8), 0.04, 0.2**2),
        ("standard_surface", "gold", 0.0, (0.944, 0.776, 0.373), 0.05**2),
        ("standard_surface", "rough_copper", 0.0, (0.96, 0.64, 0.54), 0.4**2),
        ("standard_surface", "plastic", (0.1, 0.27, 0.36), 0.04, 0.325**2),
        ("standard_surface", "paint", (0.05, 0.02, 0.15), (0.016, 0.016, 0.04), 0.4**2),
        ("standard_surface", "tinted_coat", 0.0, (0.72, 0.08, 0.08), 0.3**2),
        ("standard_surface", "skin", (0.85, 0.5, 0.4), 0.04, 0.4**2),
        ("bsdf_nodes", "gold", 0.0, (0.944, 0.776, 0.373), 0.2**2),
        ("bsdf_nodes", "coated", (0.05, 0.1, 0.5), 0.04, 0.3),
        ("bsdf_nodes", "half", (0.025, 0.05, 0.25), (0.472, 0.388, 0.1865), 0.2**2),
        ("bsdf_nodes", "sign", 0.0, 0.0, 1.0),
        ("graphs", "marble", (0.45, 0.45, 0.55), 0.04, 0.2**2),
        ("graphs", "painted", (0.2, 0.4, 0.8), 0.04, 0.4**2),
    ],
)
def test_our_looks(name: str, material: str, diffuse: object, reflectance: object, alpha: float) -> None:
    """By the formulas of their shaders: albedo, reflectance at normal incidence, width of the facets."""
    seen = seen_at(look(name, material), [(0.5, 0.5)])
    np.testing.assert_allclose(seen["diffuse"][0], np.broadcast_to(diffuse, 3), rtol=2e-4, atol=1e-6)
    np.testing.assert_allclose(seen["specular_f0"][0], np.broadcast_to(reflectance, 3), rtol=2e-4, atol=1e-6)
    np.testing.assert_allclose(seen["alpha"][0], alpha, rtol=2e-4)


def test_our_looks_that_vary() -> None:
    places = np.array([[0.3, 0.4], [0.6, 0.7]])
    s, t = places[:, :1], places[:, 1:]
    corners = np.array([[0.05, 0.1, 0.4], [0.1, 0.1, 0.3], [0.9, 0.4, 0.1], [0.9, 0.7, 0.2]])
    sky = (corners[0] * (1 - s) + corners[1] * s) * t + (corners[2] * (1 - s) + corners[3] * s) * (1 - t)
    np.testing.assert_allclose(seen_at(look("graphs", "sunset"), places)["diffuse"], sky, atol=1e-5)
    tiles = seen_at(look("graphs", "tiles"), places)
    is_odd = np.floor(places * 6).sum(axis=1, keepdims=True) % 2 == 1
    board = np.where(is_odd, [0.8, 0.8, 0.75], [0.1, 0.3, 0.2])
    np.testing.assert_allclose(tiles["diffuse"], board, atol=1e-5)
    luminance = board @ [0.2722287, 0.6740818, 0.0536895]
    np.testing.assert_allclose(tiles["alpha"], (0.05 + 0.55 * luminance) ** 2, rtol=1e-3)


def test_our_glass() -> None:
    (clear,) = look("standard_surface", "glass").materials
    assert (clear.transmission, clear.transmission_color, clear.transmission_depth) == (1.0, (1.0, 1.0, 1.0), 0.0)
    assert clear.ior == pytest.approx(1.52)
    (tinted,) = look("standard_surface", "tinted_glass").materials
    assert tinted.transmission_depth == 1.0
    np.testing.assert_allclose(tinted.transmission_color, (0.2, 0.8, 0.5), rtol=1e-6)
    (of_nodes,) = look("bsdf_nodes", "glass").materials
    assert of_nodes.transmission == 1.0
    np.testing.assert_allclose(of_nodes.transmission_color, (0.8, 1.0, 0.9), rtol=1e-6)
