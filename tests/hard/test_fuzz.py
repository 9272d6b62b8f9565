"""A few hundred stages broken at random: none ends the process, hangs, or raises anything but a WarpmisError.

Ten thousand: python scripts/fuzz_stages.py
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from programs import program


@pytest.fixture(scope="module")
def fuzz_stages() -> Any:
    return program("fuzz_stages.py")


def test_texts_follow_from_their_number_and_differ(fuzz_stages: Any) -> None:
    texts = [fuzz_stages.text_of(number) for number in range(100)]
    assert texts == [fuzz_stages.text_of(number) for number in range(100)]
    assert len(set(texts)) > 95
    assert not set(texts) & set(fuzz_stages.seeds())


def test_no_text_falls(fuzz_stages: Any) -> None:
    counts, falls = fuzz_stages.fuzz(first=0, count=200, render_every=50)
    assert falls == []
    # A fuzzer of texts that cannot be parsed tries nothing but USD's parser.
    assert counts["read"] > 100 and counts["refused"] > 20


def test_what_falls_is_told(fuzz_stages: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A reader that dies at text 3, raises at text 5 and hangs at text 7, in place of warpmis's."""
    package = tmp_path / "warpmis"
    (package / "scene").mkdir(parents=True)
    (package / "__init__.py").write_text(
        "import os, time\n"
        "class WarpmisError(Exception): pass\n"
        "def load_stage(path, **options):\n"
        "    number = int(path.stem)\n"
        "    if number == 3: os.abort()\n"
        "    if number == 5: raise KeyError('lost')\n"
        "    if number == 7: time.sleep(100)\n"
        "    raise WarpmisError('no')\n"
    )
    (package / "scene" / "features.py").write_text("Features = None\n")
    (package / "usd").mkdir()
    (package / "usd" / "products.py").write_text("def read_products(path): return ()\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(fuzz_stages, "PATIENCE", 8.0)
    monkeypatch.setattr(fuzz_stages, "PATIENCE_OF_FIRST", 90.0)
    counts, falls = fuzz_stages.fuzz(first=0, count=9, render_every=1)
    assert counts == {"read": 0, "refused": 6}
    assert [fall.number for fall in falls] == [3, 5, 7]
    assert "status -6" in falls[0].why and "KeyError" in falls[1].why and "hung" in falls[2].why
