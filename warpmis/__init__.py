"""warpmis: a path tracer for OpenUSD stages that learns how many samples each sampling strategy deserves.

`import warpmis` is cheap: the names below load what they need (pxr, Warp, OpenEXR) when they are first used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from warpmis.errors import ConfigError, Interrupted, StageError, WarpmisError

if TYPE_CHECKING:
    from warpmis.config import LearnConfig, RenderConfig
    from warpmis.output.notebook import notebook_preview
    from warpmis.rendering.progress import Progress
    from warpmis.rendering.render import render
    from warpmis.rendering.result import RenderResult
    from warpmis.rendering.stats import RenderStats
    from warpmis.scene import Scene
    from warpmis.usd import load_stage

__version__ = "0.1.0"

__all__ = [
    "ConfigError",
    "Interrupted",
    "LearnConfig",
    "Progress",
    "RenderConfig",
    "RenderResult",
    "RenderStats",
    "Scene",
    "StageError",
    "WarpmisError",
    "__version__",
    "load_stage",
    "notebook_preview",
    "render",
]

_HOME = {
    "LearnConfig": "warpmis.config",
    "Progress": "warpmis.rendering.progress",
    "RenderConfig": "warpmis.config",
    "RenderResult": "warpmis.rendering.result",
    "RenderStats": "warpmis.rendering.stats",
    "Scene": "warpmis.scene",
    "load_stage": "warpmis.usd",
    "notebook_preview": "warpmis.output.notebook",
    "render": "warpmis.rendering.render",
}


if not TYPE_CHECKING:  # to a type checker a name that is not listed above is an error

    def __getattr__(name: str) -> Any:
        if name not in _HOME:
            raise AttributeError(f"module 'warpmis' has no attribute '{name}'")
        return getattr(importlib.import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
