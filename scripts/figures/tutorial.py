"""The tutorial's pictures, by doing what it says: its Python blocks and its `warpmis` commands are run in their order.

python scripts/figures/tutorial.py [--page docs/tutorial.md] [--out docs/pictures/tutorial]

A block that fails ends the script with its error, so that it also tests the page. What the commands print can be
copied into the page's text blocks.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from warpmis.output.png import write_display_png
from warpmis.usd.materials.image import read_stored

DOCS = Path(__file__).parents[2] / "docs"
KEPT = ("first.png", "wide.png", "map.png", "denoised.png", "close.png")
GAP = 6


def blocks(page: Path) -> Iterator[tuple[str, str]]:
    """The language and text of each fenced block that is run: Python, and shell commands that begin with warpmis."""
    for language, text in re.findall(r"^```(\w+)\n(.*?)^```$", page.read_text("utf-8"), flags=re.M | re.S):
        if language == "python" or (language == "sh" and text.startswith("warpmis ")):
            yield language, text


def run_page(page: Path) -> None:
    """Run the page's blocks in the current folder; Python blocks share their names, as in one session."""
    names: dict[str, object] = {}
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    for language, text in blocks(page):
        if language == "python":
            exec(compile(text, str(page), "exec"), names)
        else:
            print(f"$ {text}", end="", flush=True)
            subprocess.run(text, shell=True, check=True, env=environment)


def beside(files: list[Path]) -> np.ndarray:
    """The pictures side by side, white between them, shape (H, W, 3) uint8."""
    pictures = [read_stored(str(file)).pixels[..., :3] for file in files]
    gap = np.full((len(pictures[0]), GAP, 3), 255, dtype=np.uint8)
    return np.concatenate([piece for picture in pictures for piece in (picture, gap)][:-1], axis=1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--page", type=Path, default=DOCS / "tutorial.md")
    parser.add_argument("--out", type=Path, default=DOCS / "pictures" / "tutorial")
    arguments = parser.parse_args()
    page, out = arguments.page.resolve(), arguments.out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        run_page(page)
        for name in KEPT:
            shutil.copy(name, out / name)
        write_display_png(out / "frames.png", beside(sorted(Path().glob("shot.*.png"))))


if __name__ == "__main__":
    main()
