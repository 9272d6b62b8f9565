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
