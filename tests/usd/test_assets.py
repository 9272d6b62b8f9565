"""Other people's stages, where the folder of assets is at hand: none of them may raise anything but a StageError."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from usd.stages import check_invariants

from warpmis.errors import StageError
from warpmis.usd import load_stage

ASSETS = Path(os.environ.get("WARPMIS_ASSETS", "not set"))
FILES = sorted(path for path in ASSETS.rglob("*.usd*") if path.is_file()) if ASSETS.is_dir() else []
MALFORMED = {"framesPerSecond_-1.usda", "framesPerSecond_0.usda"}

pytestmark = pytest.mark.skipif(not FILES, reason="WARPMIS_ASSETS names no folder of other people's stages")


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ASSETS)))
def test_asset_loads_or_says_why_not(path, capfd):
    try:
        scene = load_stage(path)
    except StageError as error:
        assert "\n" not in str(error)
        assert ("cannot be opened" in str(error)) == (path.name in MALFORMED)
    else:
        assert path.name not in MALFORMED
        check_invariants(scene)
        assert len(scene.geometry.triangles) or scene.lights
    assert capfd.readouterr().err == ""
