"""Light path expressions: regular expressions over what light meets on its way from the camera to a light.

    C              the camera                     L  a light, <L.'key'> one of a light group
    D, <RD>        diffuse reflection             O  a surface that glows by its material
    S, G, <RS>     specular reflection, and       .  anything
                   transmission without the R     [..] one of them, [^..] none of them
    T, <TS>        transmission                   * + ? {n,m} | ( )  as in other regular expressions

Glossy and mirror reflection are both specular, as RenderMan and Karma have it. The whole path must match.

A path is kept by three things: how often it scatters (not at all, once, more often), by which lobe it scatters first
behind the camera, and the group of its light. An expression that asks for more, such as the lobe of the second
scattering, is refused.

References: Heckbert (1990), "Adaptive Radiosity Textures for Bidirectional Ray Tracing"; Gritz et al. (2010), "Open
Shading Language", light path expressions.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from warpmis.errors import ConfigError

# First lobes: diffuse and specular reflection, transmission.
LOBES = "dst"
# What a path can be beside its light: seen at once, then the lobes of one scattering, then those of several.
CLASSES = 1 + 2 * len(LOBES)
# Light groups that are always there, ahead of those with a key: lights without one, and surfaces that glow.
UNKEYED, GLOWING = 0, 1

# Each scattering of a word is a letter of LOBES, each light group a letter from here on.
_FIRST_LIGHT = 0xE000
_SCATTERING = {
    "D": "d", "S": "st", "G": "st", "T": "t", "R": "ds", "RD": "d", "RS": "s", "RG": "s", "R.": "ds", "TD": "",
    "TS": "t", "TG": "t", "T.": "t", ".D": "d", ".S": "st", ".G": "st", "..": "dst", "V": "", "V.": "",
}  # fmt: skip
_ATOM = re.compile(r"<([A-Z.]{1,2})((?:'[^']*')*)>|([CDSGTRVLOB.])")
_OPERATOR = re.compile(r"[()|*+?]|\{\d*,?\d*\}")
# Words with so many more scatterings stand for all longer ones.
_LONGEST = 3


def accepted(expression: str, keys: Sequence[str]) -> NDArray[np.bool_]:
    """Which light an expression asks for: shape (2 + len(keys), CLASSES), rows as UNKEYED, GLOWING, then the keys.

    Raises:
        ConfigError: it is no expression, or tells apart what is kept together.
    """
    pattern = _pattern(expression, keys)
    found = np.zeros((2 + len(keys), CLASSES), bool)
    for group in range(len(found)):
        light = chr(_FIRST_LIGHT + group)
        for index, words in enumerate(_words()):
            matches = {pattern.fullmatch(f"C{word}{light}") is not None for word in words}
            if len(matches) > 1:
                raise ConfigError(
                    f"light path expression {expression}: paths are told apart by their first scattering and their "
                    "light alone"
                )
            found[group, index] = matches.pop()
    return found


def _words() -> list[list[str]]:
    """The scatterings of each class."""
    tails = ["".join(tail) for count in range(1, _LONGEST + 1) for tail in product(LOBES, repeat=count)]
    return [[""], *([lobe] for lobe in LOBES), *([lobe + tail for tail in tails] for lobe in LOBES)]


def _pattern(expression: str, keys: Sequence[str]) -> re.Pattern[str]:
    text = expression.replace(" ", "").replace("<.*>", ".*")
    parts, place = [], 0
    try:
        while place < len(text):
            operator = _OPERATOR.match(text, place)
            if operator:
                parts.append("(?:" if operator[0] == "(" else operator[0])
                place = operator.end()
                continue
            letters, place = _set(text, place, keys)
            parts.append(f"[{letters}]" if letters else "(?!)")
        return re.compile("".join(parts))
    except (re.error, ValueError, OverflowError):
        raise ConfigError(
            f"'{expression}' is no light path expression that is supported, such as C<RD>.*[LO] or C.*<L.'key'>"
        ) from None


def _set(text: str, place: int, keys: Sequence[str]) -> tuple[str, int]:
    """The letters that an atom or a set of them stands for, and where it ends."""
    if text[place] != "[":
        atom = _ATOM.match(text, place)
        if atom is None:
            raise ValueError(text[place:])
        return _letters(atom, keys), atom.end()
    negated = text.startswith("^", place + 1)
    place += 2 if negated else 1
    letters = ""
    while not text.startswith("]", place):
        atom = _ATOM.match(text, place)
        if atom is None:
            raise ValueError(text[place:])
        letters += _letters(atom, keys)
        place = atom.end()
    every = LOBES + _lights(keys)
    return "".join(c for c in every if (c in letters) != negated), place + 1


def _letters(atom: re.Match[str], keys: Sequence[str]) -> str:
    kind, labels = atom[1] or atom[3], re.findall(r"'([^']*)'", atom[2] or "")
    if kind in ("L", "L."):
        if labels:
            return "".join(chr(_FIRST_LIGHT + 2 + keys.index(label)) for label in labels if label in keys)
        return _lights(keys).replace(chr(_FIRST_LIGHT + GLOWING), "")
    if labels:
        raise ValueError(labels[0])  # those of lobes and objects are not known
    if kind in ("O", "O."):
        return chr(_FIRST_LIGHT + GLOWING)
    if kind == ".":
        return LOBES + _lights(keys)
    if kind in ("C", "B"):
        return "C" if kind == "C" else ""
    return _SCATTERING[kind] if kind in _SCATTERING else _unknown(kind)


def _lights(keys: Sequence[str]) -> str:
    return "".join(chr(_FIRST_LIGHT + group) for group in range(2 + len(keys)))


def _unknown(kind: str) -> str:
    raise ValueError(kind)
