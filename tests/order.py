"""The order of the tests' files, each of which one process runs: the longest first, so that all processes end together.

Left out are those that take less than fifteen seconds of one core.
"""

from __future__ import annotations

from pathlib import Path

import pytest

TESTS = Path(__file__).parent
LONGEST = (
    "production/test_cluster.py",
    "statistical/test_unbiased.py",
    "statistical/test_unbiased_strategies.py",
    "unit/kernels/test_cuda_compile.py",
    "statistical/test_light_tree_means.py",
    "statistical/test_light_samplers.py",
    "analytic/test_light_links.py",
    "unit/rendering/test_effects.py",
    "statistical/test_interface.py",
    "statistical/test_emissive_instances.py",
    "statistical/test_learning.py",
    "unit/rendering/test_aovs.py",
    "unit/rendering/test_integrator.py",
    "unit/rendering/test_checkpoint.py",
    "hard/test_light.py",
    "hard/test_learning.py",
    "analytic/test_closed_forms.py",
    "statistical/test_strategies.py",
    "unit/rendering/test_counted.py",
    "unit/cli/test_compile_command.py",
    "production/test_killed.py",
    "hard/test_cache.py",
    "statistical/test_guided.py",
    "statistical/test_counts.py",
    "statistical/test_stopping.py",
    "compare/test_cli_compare.py",
    "statistical/test_surface_samplers.py",
    "unit/rendering/test_stopping_render.py",
    "analytic/test_light_controls.py",
    "hard/test_fuzz.py",
    "unit/cli/test_streams.py",
    "analytic/test_luxtest.py",
    "unit/rendering/test_denoised_render.py",
    "hard/test_material.py",
    "analytic/test_textured_forms.py",
)
PLACES = {str(TESTS / name): place for place, name in enumerate(LONGEST)}


def sort(items: list[pytest.Item]) -> None:
    """The files that are listed first; the rest as they were."""
    gone = [name for name in PLACES if not Path(name).is_file()]
    assert not gone, f"{gone} is not there: say so in {__file__}"
    items.sort(key=lambda item: PLACES.get(str(item.path), len(PLACES)))
