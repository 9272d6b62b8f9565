"""Tests share kernels: see superset.py. Those about kernels are marked `own_kernels`, by file. The order: order.py."""

from __future__ import annotations

import gc
from collections.abc import Iterator

import order
import pytest
from superset import shared

from warpmis.rendering import specialise
from warpmis.scene.features import Features


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--own-kernels", action="store_true", help="compile what each scene calls for, and no more")


def pytest_configure(config: pytest.Config) -> None:
    config.option.loadscopereorder = False  # pytest-xdist's own order, by the number of a file's tests
    # A process keeps six thousand tests and some hundred kernels' syntax trees, which Python would walk through for
    # garbage again and again.
    gc.set_threshold(50_000, 20, 100)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    order.sort(items)


@pytest.fixture(autouse=True, scope="module")
def shared_kernels(request: pytest.FixtureRequest) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        if not request.config.getoption("--own-kernels") and not request.node.get_closest_marker("own_kernels"):
            patch.setattr(specialise, "detect", shared)
            # Paths of one bounce go through the kernels of longer ones.
            patch.setattr(Features, "with_depth", lambda features, max_depth: features)
        yield
