"""Stages that are broken at random, read and partly rendered, to see that none ends the process:

    python scripts/fuzz_stages.py [--count 10000] [--first 0] [--render-every 10] [--keep FOLDER]

The text of number N follows from N alone: prims of USD's schemas with any attributes (fuzz_schemas.py), or a scene of
usd_scenes or one of fuzz_texts.py, mutated one to four times: numbers, words, lines, types of attributes, targets.
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

sys.path.insert(0, str(Path(__file__).parent))
from fuzz_schemas import INTEGERS, NUMBERS, PATHS, any_type, literal, schema_text
from fuzz_texts import TEXTS

USD_SCENES = Path(__file__).parents[1] / "usd_scenes"

# Seconds that one text may take, on a machine with other work; the first render compiles its kernel.
PATIENCE = 240.0
PATIENCE_OF_FIRST = 480.0

# Texts longer than this are read coarsely, or most of the time would go into tessellating their spheres.
FINE = 5000

NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[+-]?\d+)?(?![\w.])")
STRING = re.compile(r'"[^"\n]*"')
WORD = re.compile(r"[A-Za-z_]\w*")
# An attribute up to its value, a relationship up to its targets, and what they begin with.
ATTRIBUTE = re.compile(
    r"^(?P<head>[ \t]*(?:(?:custom|uniform|prepend)[ \t]+)*)(?!rel\b|def\b|over\b|class\b)"
    r"(?P<type>[A-Za-z]\w*(?:\[\])?)(?P<name>[ \t]+[\w:]+)(?P<samples>\.timeSamples)?[ \t]*=[ \t]*",
    re.MULTILINE,
)
LINES = ("line twice", "line lost", "lines swapped")
TARGET = re.compile(r"<[^>\n]*>")
RELATIONSHIP = re.compile(
    r"^(?P<head>[ \t]*(?:(?:custom|uniform|prepend)[ \t]+)*)rel(?P<name>[ \t]+[\w:]+)", re.MULTILINE
)


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


def retyped(rng: random.Random, text: str) -> str:
    """One attribute of another type, with a value of that type."""
    found = list(ATTRIBUTE.finditer(text))
    if not found:
        return text
    one, type_name = rng.choice(found), any_type(rng)
    value = literal(rng, type_name)
    if one["samples"]:
        value = f"{{ 0: {value}, 1: {literal(rng, type_name)} }}"
    head = f"{one['head']}{type_name}{one['name']}{one['samples'] or ''} = "
    return text[: one.start()] + head + value + text[end_of_value(text, one.end()) :]


def related(rng: random.Random, text: str) -> str:
    """One attribute as a relationship, or the other way round."""
    attributes, relationships = list(ATTRIBUTE.finditer(text)), list(RELATIONSHIP.finditer(text))
    if relationships and (not attributes or rng.random() < 0.5):
        one, type_name = rng.choice(relationships), any_type(rng)
        line_end = text.find("\n", one.end())
        return (
            f"{text[: one.start()]}{one['head']}{type_name}{one['name']} = {literal(rng, type_name)}{text[line_end:]}"
        )
    if not attributes:
        return text
    one = rng.choice(attributes)
    return f"{text[: one.start()]}rel{one['name']} = {rng.choice(PATHS)}{text[end_of_value(text, one.end()) :]}"


def end_of_value(text: str, start: int) -> int:
    """Where the value that begins at `start` ends: at the bracket that closes its first one, or before what follows."""
    depth, quote = 0, ""
    for at in range(start, len(text)):
        letter = text[at]
        if quote:
            quote = "" if letter == quote else quote
        elif letter in '"@':
            quote = letter
        elif letter in "([{":
            if depth == 0 and letter == "(" and at > start:
                return at  # metadata
            depth += 1
        elif letter in ")]}":
            depth -= 1
            if depth == 0:
                return at + 1
        elif depth == 0 and letter == "\n":
            return at
    return len(text)


def mutated(rng: random.Random, text: str) -> str:
    """The text with one thing wrong: mostly a value, so that most texts can still be parsed."""
    kind = rng.choices(
        ("evil number", "other number", "type", "target", "relation", "string", "word", "character", *LINES),
        (8, 4, 8, 2, 1, 3, 1, 1, 2, 1, 1),
    )[0]
    if kind == "type":
        return retyped(rng, text)
    if kind == "target":
        return replaced(rng, text, TARGET, PATHS)
    if kind == "relation":
        return related(rng, text)
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
    if rng.random() < 0.4:
        text = schema_text(rng)
        return mutated(rng, text) if rng.random() < 0.3 else text
    text = rng.choice(seeds())
    for _ in range(rng.randrange(1, 5)):
        text = mutated(rng, text)
    while text in seeds():  # a mutation that found nothing to change
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
                if "RenderProduct" in text:
                    read_products_of(path)
                scene = warpmis.load_stage(path, width=4, complexity="high" if len(text) < FINE else "low")
                if number % render_every == 0 and max(scene.resolution) <= 64:
                    check(warpmis.render(scene, spp=1, method="balance", features=Features.all(), threads=1))
                said = "read"
            except warpmis.WarpmisError as error:
                said = "refused" if len(str(error).splitlines()) == 1 else "refused in several lines"
            except Exception:
                said = "raised " + traceback.format_exc(limit=-4).replace("\n", " | ")
            path.unlink()
            print("went", number, said, flush=True)


def read_products_of(path: Path) -> None:
    import warpmis
    from warpmis.usd.products import read_products

    try:
        read_products(path)
    except warpmis.WarpmisError as error:
        assert len(str(error).splitlines()) == 1, str(error)


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
