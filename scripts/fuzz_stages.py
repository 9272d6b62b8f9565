"""Stages that are broken at random, read and partly rendered, to see that none ends the process:

    python scripts/fuzz_stages.py [--count 10000] [--first 0] [--render-every 10] [--keep FOLDER]

The text of number N follows from N alone: a scene of usd_scenes or one of the texts below, mutated one to four times.
Worker processes read them; one that dies, hangs or raises anything but a WarpmisError names the text that did it, and
the next one goes on behind it. NumPy's warnings count as errors. `--print N` writes a text. Exit status 1 if any fell.
"""

from __future__ import annotations

import argparse
import queue
import random
import re
import subprocess
import sys
import tempfile
import threading
import traceback
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

USD_SCENES = Path(__file__).parents[1] / "usd_scenes"

# Seconds that one text may take, on a machine with other work; the first render compiles its kernel.
PATIENCE = 240.0
PATIENCE_OF_FIRST = 480.0

# Texts longer than this are read coarsely, or most of the time would go into tessellating their spheres.
FINE = 5000

TEXTS = {
    "subdivided": """#usda 1.0
(
    defaultPrim = "Cage"
    upAxis = "Z"
    metersPerUnit = 0.01
)
def Mesh "Cage" {
    uniform token subdivisionScheme = "catmullClark"
    uniform token interpolateBoundary = "edgeAndCorner"
    int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
    int[] faceVertexIndices = [0, 1, 3, 2, 2, 3, 5, 4, 4, 5, 7, 6, 6, 7, 1, 0, 1, 7, 5, 3, 6, 0, 2, 4]
    point3f[] points = [(-1, -1, 1), (1, -1, 1), (-1, 1, 1), (1, 1, 1),
        (-1, 1, -1), (1, 1, -1), (-1, -1, -1), (1, -1, -1)]
    int[] cornerIndices = [0]
    float[] cornerSharpnesses = [10]
    int[] creaseIndices = [1, 3, 5]
    int[] creaseLengths = [3]
    float[] creaseSharpnesses = [2.5]
    int[] holeIndices = [5]
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (
        interpolation = "faceVarying"
    )
    int[] primvars:st:indices = [0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3]
}
""",
    "instances": """#usda 1.0
(
    startTimeCode = 1
    endTimeCode = 10
)
def PointInstancer "Many" {
    int[] protoIndices = [0, 1, 0]
    point3f[] positions = [(0, 0, 0), (2, 0, 0), (4, 0, 0)]
    quath[] orientations = [(1, 0, 0, 0), (0.7, 0.7, 0, 0), (0, 1, 0, 0)]
    float3[] scales = [(1, 1, 1), (0.5, 0.5, 0.5), (1, 2, 1)]
    int64[] invisibleIds = [2]
    rel prototypes = [</Many/Ball>, </Many/Rod>]
    def Sphere "Ball" {
        double radius = 0.5
    }
    def Cylinder "Rod" {
        double height = 2
        double radius = 0.2
        uniform token axis = "X"
    }
}
def BasisCurves "Hair" {
    uniform token type = "cubic"
    uniform token basis = "bspline"
    uniform token wrap = "nonperiodic"
    int[] curveVertexCounts = [5, 4]
    point3f[] points = [(0, 0, 0), (0, 1, 0), (0, 2, 1), (0, 3, 0), (1, 3, 0),
        (2, 0, 0), (2, 1, 0), (2, 2, 1), (2, 3, 0)]
    float[] widths = [0.1] (
        interpolation = "constant"
    )
}
def Points "Dust" {
    point3f[] points.timeSamples = {
        1: [(0, 0, 3), (1, 0, 3)],
        10: [(0, 1, 3), (1, 1, 3)],
    }
    float[] widths = [0.1, 0.2]
    color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0)] (
        interpolation = "vertex"
    )
}
""",
    "lights": """#usda 1.0
(
    renderSettingsPrimPath = "/Render/Settings"
)
def Cube "Box" (
    prepend apiSchemas = ["MaterialBindingAPI"]
)
{
    rel material:binding = </Look>
}
def Material "Look" {
    token outputs:surface.connect = </Look/Surface.outputs:surface>
    def Shader "Surface" {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </Look/Picture.outputs:rgb>
        color3f inputs:emissiveColor = (0.1, 0, 0)
        float inputs:metallic = 0.2
        float inputs:roughness = 0.4
        float inputs:opacity = 0.5
        float inputs:ior = 1.5
        float inputs:clearcoat = 0.5
        token outputs:surface
    }
    def Shader "Picture" {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @nowhere.png@
        float2 inputs:st = (0.3, 0.4)
        float4 inputs:fallback = (1, 0, 0, 1)
        token inputs:wrapS = "mirror"
        float3 outputs:rgb
    }
}
def DiskLight "Disk" (
    prepend apiSchemas = ["ShapingAPI"]
)
{
    float inputs:radius = 0.5
    float inputs:intensity = 3
    float inputs:shaping:cone:angle = 30
    float inputs:shaping:cone:softness = 0.2
    float inputs:shaping:focus = 2
    double3 xformOp:translate = (0, 0, 4)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def CylinderLight "Tube" {
    float inputs:length = 2
    float inputs:radius = 0.1
    bool inputs:normalize = 1
    float inputs:colorTemperature = 3000
    bool inputs:enableColorTemperature = 1
    matrix4d xformOp:transform = ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 3, 2, 1))
    uniform token[] xformOpOrder = ["xformOp:transform"]
}
def DistantLight "Sun" {
    float inputs:angle = 0.53
    float inputs:exposure = 2
    float3 xformOp:rotateXYZ = (-45, 10, 0)
    uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]
    rel collection:lightLink:includes = </Box>
    uniform token collection:lightLink:expansionRule = "expandPrims"
}
def DomeLight "Sky" {
    color3f inputs:color = (0.4, 0.5, 0.6)
    asset inputs:texture:file = @nowhere.hdr@
    token inputs:texture:format = "latlong"
}
def Camera "Camera" {
    float focalLength = 35
    float fStop = 4
    float focusDistance = 10
    float2 clippingRange = (0.1, 1000)
    token projection = "perspective"
    double3 xformOp:translate = (0, 0, 10)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def "Render" {
    def RenderSettings "Settings" {
        rel camera = </Camera>
        uniform int2 resolution = (8, 6)
        uniform float pixelAspectRatio = 1
        uniform float4 dataWindowNDC = (0, 0, 1, 1)
    }
}
""",
}

INTEGERS = ["0", "1", "-1", "2", "3", "-7", "255", "256", "65536", "2147483647", "-2147483648"]
NUMBERS = ["0", "-0", "1", "-1", "0.5", "1e-30", "1e30", "-1e30", "1e300", "1e-300", "nan", "inf", "-inf", "1e19"]
NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[+-]?\d+)?(?![\w.])")
STRING = re.compile(r'"[^"\n]*"')
WORD = re.compile(r"[A-Za-z_]\w*")


# ---- texts ----------------------------------------------------------------------------------------------------------


@cache
def seeds() -> tuple[str, ...]:
    """What is mutated: small texts, and every scene once for each of them, so that half of the texts are small."""
    scenes = sorted(USD_SCENES.glob("*/scene.usda"))
    return (*TEXTS.values(), *(scene.read_text(encoding="utf-8") for scene in scenes))


def replaced(rng: random.Random, text: str, pattern: re.Pattern[str], others: list[str]) -> str:
    """One occurrence of the pattern replaced by one of the others."""
    found = list(pattern.finditer(text))
    if not found or not others:
        return text
    one = rng.choice(found)
    return text[: one.start()] + rng.choice(others) + text[one.end() :]


def mutated(rng: random.Random, text: str) -> str:
    """The text with one thing wrong: mostly a value, so that most texts can still be parsed."""
    kind = rng.choices(
        ("evil number", "other number", "string", "word", "line twice", "line lost", "lines swapped", "character"),
        (8, 4, 3, 1, 2, 1, 1, 1),
    )[0]
    if kind == "evil number":
        return replaced(rng, text, NUMBER, rng.choice((INTEGERS, NUMBERS)))
    if kind == "other number":
        return replaced(rng, text, NUMBER, [found.group() for found in NUMBER.finditer(text)])
    if kind == "string":
        return replaced(rng, text, STRING, STRING.findall(rng.choice(seeds())))
    if kind == "word":
        return replaced(rng, text, WORD, WORD.findall(rng.choice(seeds())))
    if kind == "character":
        at = rng.randrange(len(text) + 1)
        return text[:at] + rng.choice(["", "[", ")", "{", '"', ",", "\0", "é", "@"]) + text[at + 1 :]
    lines = text.split("\n")
    one, other = rng.randrange(len(lines)), rng.randrange(len(lines))
    if kind == "line twice":
        lines.insert(one, lines[one])
    if kind == "line lost":
        del lines[one]
    if kind == "lines swapped":
        lines[one], lines[other] = lines[other], lines[one]
    return "\n".join(lines)


def text_of(number: int) -> str:
    rng = random.Random(number)
    text = rng.choice(seeds())
    for _ in range(rng.randrange(1, 5)):
        text = mutated(rng, text)
    return text


# ---- a worker -------------------------------------------------------------------------------------------------------


def work(first: int, end: int, render_every: int) -> None:
    """Reads the texts `first` to `end` - 1; says which one on standard output before, and how it went after."""
    import warp as wp

    import warpmis
    from warpmis.scene.features import Features

    wp.config.log_level = wp.LOG_ERROR
    warnings.simplefilter("error", RuntimeWarning)
    with tempfile.TemporaryDirectory() as folder:
        for number in range(first, end):
            print("text", number, flush=True)
            path = Path(folder) / f"{number}.usda"
            text = text_of(number)
            path.write_text(text, encoding="utf-8")
            try:
                scene = warpmis.load_stage(path, width=4, complexity="high" if len(text) < FINE else "low")
                if number % render_every == 0 and max(scene.resolution) <= 64:
                    check(warpmis.render(scene, spp=1, method="nee", features=Features.all(), threads=1))
                said = "read"
            except warpmis.WarpmisError as error:
                said = "refused" if len(str(error).splitlines()) == 1 else "refused in several lines"
            except Exception:
                said = "raised " + traceback.format_exc(limit=-4).replace("\n", " | ")
            path.unlink()
            print("went", number, said, flush=True)


def check(result: object) -> None:
    import numpy as np

    for name, picture in result.channels().items():  # type: ignore[attr-defined]
        assert np.isfinite(picture).all(), f"{name} is not finite"


# ---- the run --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Fall:
    number: int
    why: str


def fuzz(first: int, count: int, render_every: int) -> tuple[dict[str, int], list[Fall]]:
    """How many texts were read and refused, and those that fell."""
    counts = {"read": 0, "refused": 0}
    falls: list[Fall] = []
    at, end = first, first + count
    while at < end:
        for kind, number, said in worker(at, end, render_every):
            at = number + 1
            if kind == "fell" or said not in counts:
                falls.append(Fall(number, said))
            else:
                counts[said] += 1
    return counts, falls


def worker(first: int, end: int, render_every: int) -> Iterator[tuple[str, int, str]]:
    """What one worker process says of each text, until it ends; the text that it dies or hangs over is the last."""
    command = [sys.executable, __file__, "--work", f"{first},{end},{render_every}"]
    with (
        tempfile.TemporaryFile("w+") as errors,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, text=True) as process,
    ):
        current, busy = first, True
        for kind, number, said in spoken(process, first + render_every):
            if kind == "hung":
                yield "fell", current, said
                return
            current, busy = number, kind == "text"
            if kind == "went":
                yield kind, number, said
        if busy or process.wait() != 0:
            errors.seek(0)
            tail = " | ".join(errors.read().splitlines()[-6:])
            yield "fell", current, f"ended the process with status {process.wait()}: {tail}"


def spoken(process: subprocess.Popen[str], first_rendered: int) -> Iterator[tuple[str, int, str]]:
    """The process's lines as (kind, number, rest), until it ends; ("hung", -1, why) if it falls silent, and its end."""
    lines: queue.Queue[str] = queue.Queue()

    def listen() -> None:
        assert process.stdout is not None
        for line in process.stdout:
            lines.put(line)
        lines.put("")

    listener = threading.Thread(target=listen)
    listener.start()
    patience = PATIENCE_OF_FIRST
    while True:
        try:
            line = lines.get(timeout=patience)
        except queue.Empty:
            process.kill()
            yield "hung", -1, f"hung for {patience:g} s"
            line = ""
        if not line:
            listener.join()
            return
        kind, number, said = (*line.strip().split(" ", 2), "")[:3]
        yield kind, int(number), said
        patience = PATIENCE if int(number) > first_rendered else PATIENCE_OF_FIRST


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--first", type=int, default=0, help="number of the first text")
    parser.add_argument(
        "--render-every", type=int, default=10, metavar="N", help="render every Nth, at 4 pixels across"
    )
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="write the texts that fell there")
    parser.add_argument("--print", type=int, dest="shown", metavar="N", help="write text N and do nothing else")
    parser.add_argument("--work", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.work:
        work(*map(int, arguments.work.split(",")))
        return 0
    if arguments.shown is not None:
        print(text_of(arguments.shown))
        return 0
    counts, falls = fuzz(arguments.first, arguments.count, arguments.render_every)
    print(f"{arguments.count} texts: {counts['read']} read, {counts['refused']} refused, {len(falls)} fell")
    for fall in falls:
        print(f"text {fall.number}: {fall.why}")
        if arguments.keep:
            arguments.keep.mkdir(parents=True, exist_ok=True)
            (arguments.keep / f"{fall.number}.usda").write_text(text_of(fall.number), encoding="utf-8")
    return int(bool(falls))


if __name__ == "__main__":
    sys.exit(main())
