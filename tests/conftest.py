"""Tests share kernels: see superset.py. Those about kernels are marked `own_kernels`, by file."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from superset import shared

from warpmis.rendering import specialise
from warpmis.scene.features import Features


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--own-kernels", action="store_true", help="compile what each scene calls for, and no more")


@pytest.fixture(autouse=True, scope="module")
def shared_kernels(request: pytest.FixtureRequest) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        if not request.config.getoption("--own-kernels") and not request.node.get_closest_marker("own_kernels"):
            patch.setattr(specialise, "detect", shared)
            # Paths of one bounce go through the kernels of longer ones.
            patch.setattr(Features, "with_depth", lambda features, max_depth: features)
        yield
