"""The programs in scripts/ as modules, which are no package."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from typing import Any

SCRIPTS = Path(__file__).parents[1] / "scripts"


def program(path: str) -> Any:
    """The module of a file in scripts/, such as "bench/speed.py"."""
    spec = importlib.util.spec_from_file_location(Path(path).stem, SCRIPTS / path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # where dataclasses looks for it
    spec.loader.exec_module(module)
    return module
