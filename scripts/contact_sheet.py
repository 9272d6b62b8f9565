"""Every stage below a folder, rendered small, with what was said about each, on one page:

    python scripts/contact_sheet.py FOLDER -o sheet.html [--pngs FOLDER] [--width 200] [--spp 16] [--complexity low]

For looking at other people's files. A MaterialX file is shown as a ball of each of its materials. Where a stage ships a
picture of itself, as screenshots/STAGE_*.png beside it, that picture is shown at its right. A stage that cannot be
rendered shows its error; anything but a WarpmisError is a bug, which the script names at the end, with exit status 1.
"""

from __future__ import annotations

import argparse
import base64
import html
import re
import tempfile
import time
import traceback
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import warpmis
from warpmis.errors import WarpmisError
from warpmis.output.png import write_png
from warpmis.usd.materials.mtlx_document import MtlxError, mtlx_layer
from warpmis.usd.materials.mtlx_writer import MATERIALS

MOST_LINES = 4  # of what was said about a stage
SUFFIXES = {".usd", ".usda", ".usdc", ".usdz"}
# A ball on a board of two greys, so that what a material refracts and mirrors is seen.
BALL = """#usda 1.0
def Sphere "Ball" ( prepend apiSchemas = ["MaterialBindingAPI"] )
{{
    rel material:binding = </Looks/{material}>
    texCoord2f[] primvars:st = [(0.5, 0.5)] ( interpolation = "constant" )
}}
def Mesh "Board" ( prepend apiSchemas = ["MaterialBindingAPI"] )
{{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-9, -1, 9), (9, -1, 9), (9, -1, -9), (-9, -1, -9)]
    texCoord2f[] primvars:st = [(0, 0), (18, 0), (18, 18), (0, 18)] ( interpolation = "vertex" )
    rel material:binding = </Board/Grey>
    def Material "Grey"
    {{
        token outputs:mtlx:surface.connect = </Board/Grey/S.outputs:out>
        def Shader "S"
        {{
            uniform token info:id = "ND_standard_surface_surfaceshader"
            color3f inputs:base_color.connect = </Board/Grey/C.outputs:out>
            float inputs:specular = 0
            token outputs:out
        }}
        def Shader "C"
        {{
            uniform token info:id = "ND_checkerboard_color3"
            color3f inputs:color1 = (0.4, 0.4, 0.4)
            color3f inputs:color2 = (0.15, 0.15, 0.15)
            float2 inputs:uvtiling = (1, 1)
            color3f outputs:out
        }}
    }}
}}
def Mesh "Patch" ( prepend apiSchemas = ["MaterialBindingAPI"] )
{{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(1.2, -0.99, 0.4), (3, -0.99, 0.4), (3, 0.81, -0.4), (1.2, 0.81, -0.4)]
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] ( interpolation = "vertex" )
    color3f[] primvars:displayColor = [(0.9, 0.3, 0.1), (0.1, 0.8, 0.2), (0.1, 0.3, 0.9), (0.9, 0.9, 0.2)] (
        interpolation = "vertex"
    )
    rel material:binding = </Looks/{material}>
}}
def Camera "Cam"
{{
    float focalLength = 26
    double3 xformOp:translate = (0.9, 1.2, 5.4)
    float xformOp:rotateX = -13
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]
}}
def DomeLight "Sky"
{{
    float inputs:intensity = 0.35
}}
def RectLight "Lamp"
{{
    float inputs:intensity = 9
    float inputs:width = 2.5
    float inputs:height = 2.5
    double3 xformOp:translate = (-3, 4, 3)
    float3 xformOp:rotateXYZ = (-45, -35, 0)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
}}
def "Looks" ( references = @{file}@</MaterialX/Materials> )
{{
}}
"""
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


def balls(file: Path) -> list[tuple[str, str]]:
    """The name of each material of a MaterialX file, and the text of a stage that shows it."""
    layer = mtlx_layer(str(file))
    names = [child.name for child in layer.GetPrimAtPath(str(MATERIALS)).nameChildren]
    return [(f"{file.stem}: {name}", BALL.format(material=name, file=file.resolve())) for name in names]


def shown(path: Path, name: str, settings: dict[str, Any]) -> list[Entry]:
    """The entry of a stage, or those of a MaterialX file's materials."""
    if path.suffix.lower() != ".mtlx":
        return [rendered(path, name, settings)]
    try:
        found = balls(path)
    except MtlxError as error:
        return [Entry(name, b"", error=str(error))]
    entries = []
    for title, text in found:
        with tempfile.TemporaryDirectory() as folder:
            stage = Path(folder, "ball.usda")
            stage.write_text(text, encoding="utf-8")
            entries.append(rendered(stage, title, settings))
    return entries


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
    parser.add_argument("--pngs", type=Path, help="a folder for the pictures as files, too")
    parser.add_argument("--width", type=int, default=200)
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--complexity", default="high", help="that of usdrecord 22.08's pictures is low")
    arguments = parser.parse_args()
    settings = {name: getattr(arguments, name) for name in ("width", "spp", "complexity")}
    stages = sorted(path for path in arguments.folder.rglob("*") if path.suffix.lower() in (*SUFFIXES, ".mtlx"))
    entries: list[Entry] = []
    for stage in stages:
        for entry in shown(stage, str(stage.relative_to(arguments.folder)), settings):
            entries.append(entry)
            print(f"{'error: ' + entry.error if entry.error else 'rendered'}  {entry.name}", flush=True)
    for entry in entries if arguments.pngs else ():
        arguments.pngs.mkdir(parents=True, exist_ok=True)
        Path(arguments.pngs, re.sub(r"\W+", "_", entry.name) + ".png").write_bytes(entry.picture)
    body = "".join(map(figure, entries))
    page = f"<!doctype html><meta charset=utf-8><title>Contact sheet</title><style>{STYLE}</style>{body}"
    arguments.out.write_text(page, encoding="utf-8")
    for entry in entries:
        if entry.bug:
            print(f"\n{entry.name}\n{entry.bug}")
    raise SystemExit(any(entry.bug for entry in entries))


if __name__ == "__main__":
    main()
