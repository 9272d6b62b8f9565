"""The naive forms break, and ours do not."""

from __future__ import annotations

import pytest
from hard.naive_forms import NAIVE_FORMS


@pytest.mark.parametrize("name", NAIVE_FORMS)
def test_the_naive_form_breaks_and_ours_does_not(name: str) -> None:
    naive, ours = NAIVE_FORMS[name]()
    assert naive > 5e-3, naive
    assert ours < 2e-5, ours
