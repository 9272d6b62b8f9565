"""What is typed behind an option, as a value; what it cannot be is said in a sentence."""

from __future__ import annotations

import math
from argparse import ArgumentTypeError

PURPOSES = ("default", "render", "proxy", "guide")


def whole_number(text: str) -> int:
    """Any whole number: the settings know their ranges."""
    try:
        return int(text)
    except ValueError:
        raise ArgumentTypeError(f"'{_shortened(text)}' is not a whole number such as 64") from None


def number(text: str) -> float:
    return _number(text, "is not a number such as 1.5")


def error_share(text: str) -> float:
    """0.01 of "1%" or "0.01"."""
    wanted = "is not an error such as 1% or 0.01, above 0 and at most 100%"
    digits, percent, rest = text.strip().partition("%")
    value = _number(digits, wanted, text) / (100.0 if percent else 1.0)
    if rest or not 0.0 < value <= 1.0:
        raise ArgumentTypeError(f"'{_shortened(text)}' {wanted}")
    return value


def time_in_seconds(text: str) -> float:
    wanted = "is not a time in seconds such as 60"
    value = _number(text, wanted)
    if not 0.0 < value < math.inf:
        raise ArgumentTypeError(f"'{_shortened(text)}' {wanted}")
    return value


def time_code(text: str) -> float:
    wanted = "is not a time code such as 12 or 3.5"
    code = _number(text, wanted)
    if not math.isfinite(code):
        raise ArgumentTypeError(f"'{_shortened(text)}' {wanted}")
    return code


def name_list(text: str) -> tuple[str, ...]:
    """Separated by commas."""
    return tuple(name.strip() for name in text.split(",") if name.strip())


def purpose_list(text: str) -> tuple[str, ...]:
    chosen = name_list(text)
    for name in chosen:
        if name not in PURPOSES:
            raise ArgumentTypeError(f"there is no purpose '{_shortened(name)}'; choose from {', '.join(PURPOSES)}")
    return chosen


def binding_purpose_list(text: str) -> tuple[str, ...]:
    """Purposes of material bindings as USD writes them: allPurpose is "" there."""
    known = {"full": "full", "preview": "preview", "allPurpose": ""}
    chosen = name_list(text)
    for name in chosen:
        if name not in known:
            raise ArgumentTypeError(
                f"there is no purpose '{_shortened(name)}' of bindings; choose from {', '.join(known)}"
            )
    return tuple(known[name] for name in chosen)


def number_list(text: str) -> tuple[float, ...]:
    wanted = "is not a list of numbers such as 0.5,0.5"
    return tuple(_number(share, wanted, text) for share in text.split(","))


def _number(text: str, wanted: str, whole: str | None = None) -> float:
    try:
        return float(text)
    except ValueError:
        raise ArgumentTypeError(f"'{_shortened(whole or text)}' {wanted}") from None


def _shortened(text: str) -> str:
    return text if len(text) <= 40 else f"{text[:40]}..."
