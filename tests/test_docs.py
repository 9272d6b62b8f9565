"""The documentation names what exists, shows commands that parse, and has sentences that one reading is enough for."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from warpmis.cli import _parsed

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
FOLDERS = ("", "warpmis", "tests", "scripts", "scripts/bench", "tests/statistical", "tests/unit/kernels")
MOST_WORDS = 35
READERS_OWN = {"make_shot.py"}  # the tutorial has its reader write it

FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", flags=re.M | re.S)
END_OF_SENTENCE = re.compile(r"(?<=[.!?:])[\"')*]*\s+(?=[\"'(*`A-Z\d])")


def paragraphs(text: str) -> list[str]:
    """The page's paragraphs and list items as one line each, without code blocks, tables and headings."""
    found, current = [], []
    for line in [*map(str.strip, FENCE.sub("", text).splitlines()), ""]:
        item = re.match(r"([-*]|\d+\.)\s+", line)
        if not line or line.startswith(("|", "#", ":::", "![")) or item:
            found.append(" ".join(current))
            current = []
        if line and not line.startswith(("|", "#", ":::")):
            current.append(line[item.end() :] if item else line)
    return [paragraph for paragraph in found if paragraph]


def sentences(text: str) -> list[str]:
    """Links count as their text, and a piece of code as one word."""
    plain = [re.sub(r"`[^`]*`", "Code", re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", one)) for one in paragraphs(text)]
    return [sentence for paragraph in plain for sentence in END_OF_SENTENCE.split(paragraph)]


def commands(text: str) -> list[str]:
    lines = [line for _, block in FENCE.findall(text) for line in block.splitlines()]
    found = [re.search(r"(?:^|&& )(?:\S*/)?(warpmis [a-z].*)", line.split(" #")[0]) for line in lines]
    return [match.group(1) for match in found if match]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_a_page_names_files_that_exist(page: Path) -> None:
    text = page.read_text("utf-8")
    files = re.findall(r"`(?:python )?((?:[\w.]+/)*\w+\.py)\b", text)
    links = [link.partition("#")[0] for link in re.findall(r"\]\((?!https?:)([^)\s]+)\)", text)]
    missing = [name for name in files if not any((ROOT / folder / name).is_file() for folder in FOLDERS)]
    missing = [name for name in missing if "/" in name or not any(ROOT.glob(f"[stw]*/**/{name}"))]
    missing = [name for name in missing if name not in READERS_OWN]
    assert [*missing, *(link for link in links if not (page.parent / link).exists())] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_a_page_shows_commands_that_parse(page: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for command in commands(page.read_text("utf-8")):
        try:
            _parsed(shlex.split(command)[1:])
        except SystemExit as stop:
            assert stop.code == 0, f"{command}: {capsys.readouterr().err}"  # --help and --version end, too


def test_the_architecture_has_every_part_of_the_package() -> None:
    """In the table of packages, and in the one of who may import whom."""
    text = (ROOT / "docs" / "architecture.md").read_text("utf-8")
    packages = {path.name for path in (ROOT / "warpmis").iterdir() if (path / "__init__.py").is_file()}
    assert len(packages) > 10
    assert {name for name in packages if f"| `{name}/` |" not in text} == set()
    importers = re.findall(r"^\| ((?:`\w+`(?:, )?)+) \| ", text, flags=re.M)
    named = {name for row in importers for name in re.findall(r"`(\w+)`", row)}
    assert packages - named == set()


def test_the_readme_shows_commands() -> None:
    assert len(commands(PAGES[0].read_text("utf-8"))) > 8


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_a_page_has_short_sentences(page: Path) -> None:
    long = [one for one in sentences(page.read_text("utf-8")) if len(one.split()) > MOST_WORDS]
    assert long == []


def test_a_long_sentence_is_found() -> None:
    text = "# Title\n\nShort one. Then " + "word " * 20 + "\n" + "word " * 16 + "end. A `piece of code` counts once.\n"
    assert [len(one.split()) for one in sentences(text)] == [2, 38, 4]
    assert sentences("| a | table |\n\n```sh\ncode\n```\n\n- An item.\n- Another\n  one.\n") == [
        "An item.",
        "Another one.",
    ]
