"""Light path expressions: which light each asks for, and what is no expression."""

from __future__ import annotations

import pytest

from warpmis.aovs import LIGHT, checked_aovs, light_aovs
from warpmis.errors import ConfigError
from warpmis.path_expression import CLASSES, accepted

EMISSION, DIFFUSE, SPECULAR, TRANSMISSION, LATE_DIFFUSE, LATE_SPECULAR, LATE_TRANSMISSION = range(CLASSES)
ALL = set(range(CLASSES))
LATE = {LATE_DIFFUSE, LATE_SPECULAR, LATE_TRANSMISSION}
LIGHTS, OBJECTS, KEY, RIM = {"light"}, {"object"}, {"key"}, {"rim"}
ANY_LIGHT = LIGHTS | KEY | RIM
EVERYTHING = ANY_LIGHT | OBJECTS

# What users of RenderMan, Karma and Arnold author, and what it asks for: classes, and lights.
EXPRESSIONS = {
    "C.*": (ALL, EVERYTHING),
    "C[DS]*[<L.>O]": (ALL, EVERYTHING),
    "C<.*>L": (ALL, ANY_LIGHT),
    "C[<L.>O]": ({EMISSION}, EVERYTHING),
    "CL": ({EMISSION}, ANY_LIGHT),
    "CO": ({EMISSION}, OBJECTS),
    "C.*O": (ALL, OBJECTS),
    "C<RD>[<L.>O]": ({DIFFUSE}, EVERYTHING),
    "C<RD>L": ({DIFFUSE}, ANY_LIGHT),
    "CDL": ({DIFFUSE}, ANY_LIGHT),
    "C<RD>[DS]+[<L.>O]": ({LATE_DIFFUSE}, EVERYTHING),
    "C<RD>.+L": ({LATE_DIFFUSE}, ANY_LIGHT),
    "C<RD>.*L": ({DIFFUSE, LATE_DIFFUSE}, ANY_LIGHT),
    "C<RS>[<L.>O]": ({SPECULAR}, EVERYTHING),
    "C<RG>.*L": ({SPECULAR, LATE_SPECULAR}, ANY_LIGHT),
    "C<TG>.*[<L.><O>]": ({TRANSMISSION, LATE_TRANSMISSION}, EVERYTHING),
    "C<TD>.*L": (set(), set()),
    "C<TS>[DS]*[<L.>O]": ({TRANSMISSION, LATE_TRANSMISSION}, EVERYTHING),
    "C.*<L.'key'>": (ALL, KEY),
    "C[DS]*<L.'key'>": (ALL, KEY),
    "C[DS]<L.'key'>": ({DIFFUSE, SPECULAR, TRANSMISSION}, KEY),
    "C<RD><L.'rim'>": ({DIFFUSE}, RIM),
    "C.*[<L.'key'><L.'rim'>]": (ALL, KEY | RIM),
    "C<RD>[DSVOB].*<L.'key'>": ({LATE_DIFFUSE}, KEY),
    "C[^D]L": ({SPECULAR, TRANSMISSION}, ANY_LIGHT),
    "C(D|S){2,}L": (LATE, ANY_LIGHT),
    "C.*<L.'unknown'>": (ALL, set()),
}


@pytest.mark.parametrize("expression", EXPRESSIONS)
def test_what_an_expression_asks_for(expression: str) -> None:
    classes, lights = EXPRESSIONS[expression]
    found = accepted(expression, ("key", "rim"))
    for group, light in enumerate(("light", "object", "key", "rim")):
        wanted = [light in lights and index in classes for index in range(CLASSES)]
        assert found[group].tolist() == wanted, light


def test_names_share_out_all_light() -> None:
    for names in (("emission", "direct", "indirect"), ("emission", "diffuse", "specular", "transmission")):
        total = sum(accepted(LIGHT[name], ("key",)).astype(int) for name in names)
        assert (total == 1).all()
    for name in ("diffuse", "specular", "transmission"):
        parts = sum(accepted(LIGHT[f"{kind}_{name}"], ()).astype(int) for kind in ("direct", "indirect"))
        assert (parts == accepted(LIGHT[name], ())).all()


@pytest.mark.parametrize(
    "expression", ["", "foo", "C(", "C**L", "C<RD", "C[DL", "C<RS'coat'>L", "CU2L", "D'x'L", "C<XD>L", "C{3,1}L"]
)
def test_what_is_no_expression(expression: str) -> None:
    if expression:
        with pytest.raises(ConfigError, match="light path expression"):
            accepted(expression, ())
    else:
        assert not accepted(expression, ()).any()


@pytest.mark.parametrize("expression", ["CDSL", "C<RD><RS>+L", "CD[LO]|CDSL", "CS*DL"])
def test_what_is_kept_together_cannot_be_told_apart(expression: str) -> None:
    with pytest.raises(ConfigError, match="first scattering"):
        accepted(expression, ())


def test_aovs_are_checked() -> None:
    assert checked_aovs(["direct", "uv", "direct", "k=C.*<L.'key'>"]) == ("direct", "uv", "k=C.*<L.'key'>")
    for wrong, said in [
        (("nonsense",), "choose from"),
        ("direct", "tuple of names"),
        ((3,), "tuple of names"),
        (("A=C.*",), "cannot be the name"),
        (("9=C.*",), "cannot be the name"),
        (("a=C(",), "light path expression"),
        (("a=C.*", "a=CL"), "two AOVs"),
    ]:
        with pytest.raises(ConfigError, match=said):
            checked_aovs(wrong)


def test_every_light_group_has_a_layer() -> None:
    found = light_aovs(("lights",), ("key", "my rim"))
    assert [one.name for one in found] == ["light.key", "light.my_rim", "light.rest"]
