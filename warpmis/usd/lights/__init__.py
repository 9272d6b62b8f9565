"""Lights of a stage, and what UsdLux says of them."""
