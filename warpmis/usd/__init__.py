"""From an OpenUSD stage to a warpmis.scene.Scene: the only part of warpmis that imports pxr."""

from warpmis.usd.stage import load_stage

__all__ = ["load_stage"]
