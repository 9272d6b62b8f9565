"""Which prims are rendered: visibility, purposes, and what is inactive or abstract."""

from __future__ import annotations

import pytest
from usd.stages import (
    load,
)

from warpmis.errors import ConfigError


def test_invisible_prims_hide_everything_below_and_samples_decide():
    text = """def Xform "Hidden"
{
    token visibility = "invisible"
    def Cube "A"
    {
        token visibility = "inherited"
    }
    def SphereLight "L"
    {
    }
}
def Cube "Blinking"
{
    token visibility.timeSamples = {
        1: "invisible",
        2: "inherited",
    }
}
def Cube "Shown"
{
}
"""
    assert [prim.path for prim in load(text, time=1).prims] == ["/Shown"]
    scene = load(text, time=2)
    assert [prim.path for prim in scene.prims] == ["/Blinking", "/Shown"]
    assert not any(light.path == "/Hidden/L" for light in scene.lights)


PURPOSES = """def Cube "Default"
{
}
def Xform "Group"
{
    uniform token purpose = "proxy"
    def Cube "Proxy"
    {
    }
    def SphereLight "ProxyLight"
    {
    }
}
def Cube "Render"
{
    uniform token purpose = "render"
}
def Cube "Guide"
{
    uniform token purpose = "guide"
}
"""


@pytest.mark.parametrize(
    ("purposes", "expected"),
    [
        (("render",), ["/Default", "/Render"]),
        ((), ["/Default"]),
        (("proxy",), ["/Default", "/Group/Proxy"]),
        (("render", "proxy", "guide"), ["/Default", "/Group/Proxy", "/Render", "/Guide"]),
    ],
)
def test_purposes_are_inherited_and_default_is_always_rendered(purposes, expected):
    scene = load(PURPOSES, purposes=purposes)
    assert [prim.path for prim in scene.prims] == expected
    assert any(light.path == "/Group/ProxyLight" for light in scene.lights) == ("proxy" in purposes)


def test_unknown_purpose_is_a_config_error():
    with pytest.raises(ConfigError, match="proxies"):
        load(PURPOSES, purposes=("proxies",))


def test_inactive_abstract_and_undefined_prims_are_not_rendered():
    text = """def Cube "Off" (
    active = false
)
{
}
class Cube "Class"
{
}
over "Over"
{
    def Cube "C"
    {
    }
}
"""
    scene = load(text + 'def Cube "On"\n{\n}\n')
    assert [prim.path for prim in scene.prims] == ["/On"]


def of_purposes(name: str) -> str:
    """A prim of each purpose below an Xform."""
    cubes = "".join(
        f'def Cube "{purpose}"\n{{\nuniform token purpose = "{purpose}"\n}}\n'
        for purpose in ("default", "render", "proxy", "guide")
    )
    return f'def Xform "{name}"\n{{\n{cubes}}}\n'


def with_visibility(name: str, opinions: str, below: str) -> str:
    return f'def Xform "{name}" ( prepend apiSchemas = ["VisibilityAPI"] )\n{{\n{opinions}\n{below}}}\n'


def seen(text: str, *purposes: str) -> set[str]:
    return {prim.path for prim in load(text + 'def Cube "Else"\n{\n}\n', purposes=purposes).prims} - {"/Else"}


@pytest.mark.parametrize("purpose", ["render", "proxy", "guide"])
@pytest.mark.parametrize("value", ["invisible", "visible", "inherited"])
def test_the_visibility_of_a_purpose_shows_and_hides_what_has_it_alone(purpose, value):
    shown = value == "visible" or (value == "inherited" and purpose != "guide")
    text = with_visibility("V", f'uniform token {purpose}Visibility = "{value}"', of_purposes("X"))
    expected = {"/V/X/default", f"/V/X/{purpose}"} if shown else {"/V/X/default"}
    assert seen(text, purpose) == expected


def test_the_nearest_opinion_on_a_purpose_counts_and_overall_visibility_goes_before():
    inner = with_visibility("Shown", 'uniform token renderVisibility = "visible"', of_purposes("X"))
    outer = with_visibility("Hidden", 'uniform token renderVisibility = "invisible"', inner + of_purposes("Y"))
    assert seen(outer, "render") == {"/Hidden/Shown/X/default", "/Hidden/Shown/X/render", "/Hidden/Y/default"}
    off = inner.replace("renderVisibility", 'visibility = "invisible"\nuniform token renderVisibility', 1)
    assert seen(off.replace("uniform token visibility", "token visibility"), "render") == set()


def test_guides_are_hidden_where_the_schema_is_applied_without_speaking_of_them():
    assert seen(with_visibility("V", "", of_purposes("X")), "guide") == {"/V/X/default"}
    shown = with_visibility("V", 'uniform token guideVisibility = "visible"', of_purposes("X"))
    assert seen(shown, "guide") == {"/V/X/default", "/V/X/guide"}
    assert seen(shown, "render") == {"/V/X/default", "/V/X/render"}
    assert seen(of_purposes("X"), "guide") == {"/X/default", "/X/guide"}  # applied nowhere: the render's purposes say


def test_the_visibility_of_a_purpose_reaches_lights_and_instances_of_both_kinds():
    lights = 'def SphereLight "L"\n{\nuniform token purpose = "render"\n}\n'
    native = 'def "N" ( instanceable = true\ninherits = </Class> )\n{\n}\n'
    points = """def PointInstancer "I"
{
    int[] protoIndices = [0]
    point3f[] positions = [(0, 0, 0)]
    rel prototypes = </Library/X>
}
"""
    text = f'class Xform "Class"\n{{\n{of_purposes("X")}}}\nover "Library"\n{{\n{of_purposes("X")}}}\n'
    hidden = text + with_visibility("V", 'uniform token renderVisibility = "invisible"', lights + native + points)
    shown = hidden.replace('"invisible"', '"visible"')
    assert seen(hidden, "render") == {"/V/N/X/default", "/Library/X/default"}
    assert seen(shown, "render") == {
        f"{place}/X/{kind}" for place in ("/V/N", "/Library") for kind in ("default", "render")
    }
    paths = [[light.path for light in load(one + 'def Cube "E"\n{\n}\n').lights] for one in (hidden, shown)]
    assert paths == [[""], ["/V/L"]]  # "" is the dome of a stage without lights
