"""What a hard case is: a small stage, what is hard about it, and what its picture must be."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class HardCase:
    """One row of docs/stability.md.

    Attributes:
        name: words joined by dashes, such as "sphere-light-tiny".
        trouble: what breaks in the naive form.
        remedy: what warpmis does about it, with its source.
        build: makes the stage, in memory, with a camera and a resolution of at most 24 x 24 pixels.
        mean: the picture's mean radiance (R, G, B) where it is known in closed form; None where the case is shown by
            an invariance, a refusal or bounds alone.
        settings: settings of render() that the case calls for.
        learns: whether a mixture learned on it is to be held against balance.
    """

    name: str
    trouble: str
    remedy: str
    build: Callable[[], Any]
    mean: tuple[float, float, float] | None = None
    settings: dict[str, Any] = field(default_factory=dict)
    learns: bool = True
