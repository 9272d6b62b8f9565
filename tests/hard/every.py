"""All hard cases, from the lists named *_CASES of the modules hard/*_cases.py, and what they call for together."""

from __future__ import annotations

from collections.abc import Iterable
from functools import reduce
from importlib import import_module
from pathlib import Path

from hard.case import HardCase

import warpmis
from warpmis.scene.features import Features, detect


def cases() -> list[HardCase]:
    names = sorted(path.stem for path in Path(__file__).parent.glob("*_cases.py"))
    modules = [vars(import_module(f"hard.{name}")) for name in names]
    return [case for module in modules for name, found in module.items() if name.endswith("_CASES") for case in found]


def effects_of(scenes: Iterable[warpmis.Scene]) -> Features:
    """What any of the scenes calls for: one kernel a method for all of them."""
    return reduce(lambda a, b: Features(**{k: v or vars(b)[k] for k, v in vars(a).items()}), map(detect, scenes))
