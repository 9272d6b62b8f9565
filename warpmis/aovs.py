"""The pictures that can be asked for beside the beauty picture (AOVs), by name.

Those of light are light path expressions (path_expression.py). The others show the surface in the middle of each pixel.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass

from warpmis.errors import ConfigError
from warpmis.path_expression import accepted

# Of light, by their expressions.
LIGHT = {
    "emission": "C[LO]",
    "direct": "C.[LO]",
    "indirect": "C..+[LO]",
    "diffuse": "C<RD>.*[LO]",
    "specular": "C<RS>.*[LO]",
    "transmission": "C<T.>.*[LO]",
    "direct_diffuse": "C<RD>[LO]",
    "direct_specular": "C<RS>[LO]",
    "direct_transmission": "C<T.>[LO]",
    "indirect_diffuse": "C<RD>.+[LO]",
    "indirect_specular": "C<RS>.+[LO]",
    "indirect_transmission": "C<T.>.+[LO]",
}
# One picture for each light group, and one of all other light.
LIGHTS = "lights"
# Of surfaces.
SURFACE = ("uv", "materialId", "primId", "motion")
NAMES = (*LIGHT, LIGHTS, *SURFACE)

# Names that a result has anyway: two pictures of one name cannot be in a file.
TAKEN = {"R", "G", "B", "A", "Z", "N", "albedo", "denoised", "variance", "samples", "allocation", "nextEvent"}


@dataclass(frozen=True)
class LightAov:
    """A picture of some of the light. expression: "" for the light of no light group."""

    name: str
    expression: str


def checked_aovs(asked: object) -> tuple[str, ...]:
    """The names and NAME=EXPRESSION as they are asked for, each once.

    Raises:
        ConfigError: there is no such AOV, or an expression is none.
    """
    if isinstance(asked, str) or not isinstance(asked, Collection) or not all(isinstance(one, str) for one in asked):
        raise ConfigError(f"aov must be a tuple of names, such as ('direct', 'indirect'), got {asked!r}")
    found: dict[str, str] = {}
    for one in asked:
        name, equals, expression = one.partition("=")
        if equals:
            if not re.fullmatch(r"[A-Za-z_][\w.-]*", name) or name in TAKEN or name in SURFACE:
                raise ConfigError(f"'{name}' cannot be the name of an AOV; choose another for {expression}")
            accepted(expression, ())
        elif name not in NAMES:
            raise ConfigError(f"there is no AOV '{one}'; choose from {', '.join(NAMES)}, or give NAME=EXPRESSION")
        if found.get(name, one) != one:
            raise ConfigError(f"two AOVs have the name {name}")
        found[name] = one
    return tuple(found.values())


def light_aovs(asked: Sequence[str], keys: Sequence[str]) -> tuple[LightAov, ...]:
    """Those of light among the AOVs that were asked for; keys: of the scene's light groups."""
    found = []
    for one in asked:
        name, equals, expression = one.partition("=")
        if equals or name in LIGHT:
            found.append(LightAov(name, expression or LIGHT[name]))
        elif name == LIGHTS:
            found += [LightAov(layer_of_group(key), f"C.*<L.'{key}'>") for key in keys]
            found.append(LightAov("light.rest", ""))
    return tuple(found)


def layer_of_group(key: str) -> str:
    """The name of the picture of a light group."""
    return f"light.{re.sub(r'[^A-Za-z0-9_-]', '_', key)}"


def asks_for_surfaces(asked: Sequence[str]) -> bool:
    return any(one in SURFACE for one in asked)


def asks_for_light(asked: Sequence[str]) -> bool:
    return any("=" in one or one in LIGHT or one == LIGHTS for one in asked)
