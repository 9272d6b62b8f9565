"""The order of the tests' files, each of which one process runs: the longest first, so that all processes end together.

Left out are those that take less than fifteen seconds of one core.
"""

from __future__ import annotations

from pathlib import Path

import pytest

TESTS = Path(__file__).parent
LONGEST = (
    "statistical/test_unbiased.py",
    "production/test_cluster.py",
    "statistical/test_interface.py",
    "statistical/test_unbiased_strategies.py",
    "unit/rendering/test_effects.py",
    "unit/kernels/test_cuda_compile.py",
    "statistical/test_emissive_instances.py",
    "statistical/test_light_tree_means.py",
    "statistical/test_light_samplers.py",
    "statistical/test_strategies.py",
    "analytic/test_light_links.py",
    "statistical/test_guided.py",
    "unit/cli/test_compile_command.py",
    "production/test_killed.py",
    "statistical/test_surface_samplers.py",
    "analytic/test_closed_forms.py",
    "unit/rendering/test_aovs.py",
    "statistical/test_stopping.py",
    "hard/test_fuzz.py",
    "hard/test_learning.py",
    "unit/rendering/test_integrator.py",
    "unit/rendering/test_paired.py",
    "hard/test_cache.py",
    "analytic/test_luxtest.py",
    "unit/cli/test_streams.py",
    "statistical/test_counts.py",
    "statistical/test_learning.py",
    "unit/rendering/test_denoised_render.py",
)
PLACES = {str(TESTS / name): place for place, name in enumerate(LONGEST)}


def sort(items: list[pytest.Item]) -> None:
    """The files that are listed first; the rest as they were."""
    gone = [name for name in PLACES if not Path(name).is_file()]
    assert not gone, f"{gone} is not there: say so in {__file__}"
    items.sort(key=lambda item: PLACES.get(str(item.path), len(PLACES)))
