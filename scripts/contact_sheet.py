"""Every stage below a folder, rendered small, with what was said about each, on one page:

    python scripts/contact_sheet.py FOLDER -o sheet.html [--width 200] [--spp 16] [--complexity low]

For looking at other people's files. Where a stage ships a picture of itself, as screenshots/STAGE_*.png beside it, that
picture is shown at its right. A stage that cannot be rendered shows its error; anything but a WarpmisError is a bug,
which the script names at the end and exits with status 1.
"""

from __future__ import annotations

import argparse
import base64
import html
import tempfile
import time
import traceback
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import warpmis
from warpmis.errors import WarpmisError
from warpmis.output.png import write_png

MOST_LINES = 4  # of what was said about a stage
SUFFIXES = {".usd", ".usda", ".usdc", ".usdz"}
STYLE = """
body { font: 13px system-ui; margin: 1em; display: flex; flex-wrap: wrap; gap: 1em; }
figure { margin: 0; width: 260px; } img { width: 100%; background: #888; } b { overflow-wrap: anywhere; }
figure.pair { width: 520px; } figure.pair img { width: 50%; vertical-align: top; }
p { margin: 0.2em 0; color: #555; overflow-wrap: anywhere; } .error { color: #a00; }
"""


@dataclass(frozen=True)
class Entry:
    name: str
    shipped: bytes
    picture: bytes = b""
    lines: tuple[str, ...] = ()
    error: str = ""
    bug: str = ""


def rendered(stage: Path, name: str, settings: dict[str, Any]) -> Entry:
    shipped = b"".join(path.read_bytes() for path in sorted(stage.parent.glob(f"screenshots/{stage.stem}_*.png"))[:1])
    start = time.perf_counter()
    try:
        result = warpmis.render(str(stage), method="nee", **settings)
    except WarpmisError as error:
        return Entry(name, shipped, error=str(error))
    except Exception:  # the very thing that the sheet is to bring to light
        return Entry(name, shipped, error="internal error", bug=traceback.format_exc())
    with tempfile.TemporaryDirectory() as folder:
        write_png(f"{folder}/picture.png", result.image)
        picture = Path(folder, "picture.png").read_bytes()
    counts = f"{result.stats['triangles']:,} triangles, {time.perf_counter() - start:.1f} s"
    return Entry(name, shipped, picture, (counts, *dict.fromkeys(result.warnings + result.notes)))


def figure(entry: Entry) -> str:
    pictures = [picture for picture in (entry.picture, entry.shipped) if picture]
    images = "".join(f'<img src="data:image/png;base64,{base64.b64encode(data).decode()}">' for data in pictures)
    error = f'<p class="error">{html.escape(entry.error)}</p>' if entry.error else ""
    shown = [*entry.lines[:MOST_LINES], *([f"and {more} more"] if (more := len(entry.lines) - MOST_LINES) > 0 else [])]
    lines = "".join(f"<p>{html.escape(line)}</p>" for line in shown)
    style = "pair" if len(pictures) > 1 else "single"
    return f'<figure class="{style}">{images}<b>{html.escape(entry.name)}</b>{error}{lines}</figure>'


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("-o", "--out", type=Path, default=Path("sheet.html"))
    parser.add_argument("--width", type=int, default=200)
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--complexity", default="high", help="that of usdrecord 22.08's pictures is low")
    arguments = parser.parse_args()
    settings = {name: getattr(arguments, name) for name in ("width", "spp", "complexity")}
    stages = sorted(path for path in arguments.folder.rglob("*") if path.suffix.lower() in SUFFIXES)
    entries = []
    for stage in stages:
        entry = rendered(stage, str(stage.relative_to(arguments.folder)), settings)
        entries.append(entry)
        print(f"{'error: ' + entry.error if entry.error else 'rendered'}  {entry.name}", flush=True)
    body = "".join(map(figure, entries))
    page = f"<!doctype html><meta charset=utf-8><title>Contact sheet</title><style>{STYLE}</style>{body}"
    arguments.out.write_text(page, encoding="utf-8")
    for entry in entries:
        if entry.bug:
            print(f"\n{entry.name}\n{entry.bug}")
    raise SystemExit(any(entry.bug for entry in entries))


if __name__ == "__main__":
    main()
