"""Whether two checkouts of this program render the same pictures, and how their times compare:

    python scripts/bench/same_pictures.py --before PATH [STAGE ...] [--methods nee auto ...] [--times]
    python scripts/bench/same_pictures.py --before PATH --write FILE      keep its pictures, to be compared with later
    python scripts/bench/same_pictures.py --before FILE

The stages are the four scenes of usd_scenes, many_effects.usda beside this file for lights and cameras that these lack,
and, under the name `hard`, those of tests/hard, each checkout's own. The methods are all that there are, and a few
settings beside them (VARIANTS). A row shows, over all pixels of one stage (or of all hard cases) and one method:

identical  share of the pixels whose colour is the same bit for bit
within     share of those whose colours differ by at most 1e-4 of the brighter one
others     share of identical numbers in alpha, albedo, normal, depth, samples, variance and allocation

--times: CPU seconds of a render by one thread, `after` over `before`, median and quartiles of renders in turn; and the
CPU seconds that the first render spent on compiling, from an empty kernel cache. For scenes of usd_scenes alone.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

CHECKOUT = Path(__file__).resolve().parents[2]
SCENES = ("cornell_box", "ajar_door", "veach_plates", "open_terrace")
EFFECTS = Path(__file__).with_name("many_effects.usda")
HARD = "hard"
EIGHT = ("bsdf", "light", "uniform", "cosine", "area", "dome", "diffuse", "specular")

# Settings beside the methods by name.
VARIANTS: dict[str, dict[str, Any]] = {
    "balance, eight strategies": {"method": "balance", "strategies": EIGHT},
    "cost-aware, eight strategies": {"method": "cost-aware", "strategies": EIGHT},
    "balance, random choice": {"method": "balance", "strategy_choice": "random", "sampler": "independent"},
    "nee, independent": {"method": "nee", "sampler": "independent"},
    "auto, target error": {"method": "auto", "target_error": 0.5},
}
OTHERS = ("alpha", "albedo", "normal", "depth", "samples", "variance", "allocation")
TOLERANCE = 1e-4
WIDTH, SPP = 48, 32  # of a picture that is compared
HARD_SPP = 16
TIMED_WIDTH, TIMED_SECONDS, REPEATS = 64, 0.4, 15
REFUSED = "refused"

Pictures = dict[str, NDArray[Any]]


class Stages:
    """The stages of a checkout, read once."""

    def __init__(self, checkout: Path) -> None:
        self.checkout = checkout
        self.loaded: dict[str, dict[str, Any]] = {}
        self.settings: dict[str, dict[str, Any]] = {}
        self.effects: Any = None

    def of(self, name: str, width: int) -> dict[str, Any]:
        """The scenes of a stage's name: one, or all hard cases by name."""
        key = f"{name}/{width}"
        if key not in self.loaded:
            self.loaded[key] = self._hard() if name == HARD else {"": self._load(name, width)}
        return self.loaded[key]

    def _load(self, name: str, width: int) -> Any:
        import warpmis

        folder = self.checkout / "usd_scenes" / name
        return warpmis.load_stage(EFFECTS if name == EFFECTS.stem else folder / "scene.usda", width=width)

    def _hard(self) -> dict[str, Any]:
        """All cases; their settings, and the effects that any of them calls for: one kernel a method for all."""
        sys.path.insert(0, str(self.checkout / "tests"))
        from hard.checks import scene_of
        from hard.every import cases, effects_of

        scenes = {case.name: scene_of(case) for case in cases()}
        self.settings = {case.name: case.settings for case in cases()}
        self.effects = effects_of(scenes.values())
        return scenes

    def render(self, name: str, settings: dict[str, Any], width: int) -> Pictures:
        """The pictures of a stage, by case and kind."""
        import warpmis

        pictures: Pictures = {}
        for case, scene in self.of(name, width).items():
            own = {**self.settings[case], "features": self.effects, "spp": HARD_SPP} if name == HARD else {}
            try:
                result = warpmis.render(scene, **{"max_depth": 8, **own, **settings})
            except warpmis.ConfigError:
                pictures[f"{case}|{REFUSED}"] = np.zeros(1)
                continue
            for kind in ("image", *OTHERS):
                pictures[f"{case}|{kind}"] = getattr(result, kind)
        return pictures


def variants() -> dict[str, dict[str, Any]]:
    """The settings of every row."""
    from warpmis.methods import METHODS

    plain: dict[str, dict[str, Any]] = {name: {"method": name} for name in METHODS}
    plain["fixed"]["allocation"] = (0.3, 0.7)
    return {**plain, **VARIANTS}


def serve(checkout: Path) -> None:
    """A checkout's program: render what each line of the input asks for, and answer with the CPU seconds."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what Warp prints is no answer
    sys.path[0] = str(checkout)
    import warpmis

    assert Path(warpmis.__file__).resolve().parents[1] == checkout.resolve(), warpmis.__file__
    stages = Stages(checkout)
    for line in sys.stdin:
        asked = json.loads(line)
        stages.of(asked["stage"], asked["width"])
        start = time.process_time()
        pictures = stages.render(asked["stage"], asked["settings"], asked["width"])
        spent = time.process_time() - start
        if asked["file"]:
            np.savez(asked["file"], **pictures)  # type: ignore[arg-type]
        print(json.dumps(spent), file=answers, flush=True)


class Program:
    """A checkout's program in a process of its own, with a kernel cache of its own if it is to be timed."""

    def __init__(self, checkout: Path, cache: Path | None = None) -> None:
        command = [sys.executable, __file__, "--serve", str(checkout)]
        environment = {**os.environ, "PYTHONPATH": str(checkout)}
        if cache is not None:
            environment["WARP_CACHE_PATH"] = str(cache)
        self.process = subprocess.Popen(
            command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def ask(self, stage: str, settings: dict[str, Any], width: int, file: Path | None = None) -> float:
        """CPU seconds of the render."""
        assert self.process.stdin is not None and self.process.stdout is not None
        request = {"stage": stage, "settings": settings, "width": width, "file": str(file) if file else None}
        self.process.stdin.write(json.dumps(request) + "\n")
        self.process.stdin.flush()
        answer = self.process.stdout.readline()
        if not answer:
            raise SystemExit(f"the program failed on {stage} with {settings}")
        return float(json.loads(answer))

    def pictures(self, stage: str, settings: dict[str, Any]) -> Pictures:
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "pictures.npz"
            self.ask(stage, {"spp": SPP, **settings}, WIDTH, file)
            with np.load(file) as stored:
                return dict(stored)


class Stored:
    """Pictures that --write has kept."""

    def __init__(self, file: Path) -> None:
        with np.load(file) as stored:
            self.all = dict(stored)

    def pictures(self, stage: str, settings: dict[str, Any]) -> Pictures:
        start = key_of(stage, settings)
        return {name.removeprefix(start): array for name, array in self.all.items() if name.startswith(start)}


def key_of(stage: str, settings: dict[str, Any]) -> str:
    return f"{stage}|{json.dumps(settings, sort_keys=True)}|"


def compared(before: Pictures, after: Pictures) -> tuple[float, float, float, list[str]]:
    """Shares of identical pixels, of those within the tolerance, of other identical numbers; and what differs most."""
    same, near, others, different = [], [], [], []
    for name in sorted(before.keys() & after.keys()):
        a, b = before[name], after[name]
        case, kind = name.split("|")
        if kind != "image":
            others.append((a == b).ravel())
            continue
        same.append((a == b).all(axis=-1).ravel())
        brighter = np.maximum(np.abs(a), np.abs(b)).max(axis=-1)
        near.append((np.abs(a - b).max(axis=-1) <= TOLERANCE * brighter).ravel())
        if not near[-1].all():
            different.append(case)
    missing = before.keys() ^ after.keys()
    different += sorted({f"{name.split('|')[0]} in one alone" for name in missing})
    if not same:
        return 1.0, 1.0, 1.0, different
    return *(float(np.concatenate(parts).mean()) for parts in (same, near, others)), different


def rows(stages: list[str], methods: list[str]) -> Iterator[tuple[str, str, dict[str, Any]]]:
    every = variants()
    for stage in stages:
        for name in methods or every:
            if stage == HARD and name not in every.keys() - VARIANTS.keys() and not methods:
                continue
            yield stage, name, every[name]


def compare(before: Program | Stored, stages: list[str], methods: list[str]) -> bool:
    """Print a row a stage and method; whether 99.9 % of all pixels are within the tolerance in each."""
    after = Program(CHECKOUT)
    alike = True
    print("| stage | method | identical | within 1e-4 | others identical | different |\n|---|---|---|---|---|---|")
    for stage, name, settings in rows(stages, methods):
        identical, within, others, different = compared(
            before.pictures(stage, settings), after.pictures(stage, settings)
        )
        alike = alike and within >= 0.999
        figures = " | ".join(f"{100.0 * share:.3f} %" for share in (identical, within, others))
        print(f"| {stage} | {name} | {figures} | {', '.join(different[:4])} |", flush=True)
    return alike


def write(checkout: Path, file: Path, stages: list[str], methods: list[str]) -> None:
    program = Program(checkout)
    kept: Pictures = {}
    for stage, name, settings in rows(stages, methods):
        print(stage, name, flush=True)
        found = program.pictures(stage, settings)
        kept.update({key_of(stage, settings) + kind: picture for kind, picture in found.items()})
    np.savez_compressed(file, **kept)  # type: ignore[arg-type]


def compare_times(before: Path, stages: list[str], methods: list[str]) -> None:
    """Print a row a scene and method."""
    print("| scene | method | time after / before | quartiles | compiling before | after |\n|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        programs = [
            Program(checkout, Path(folder) / name) for name, checkout in (("before", before), ("after", CHECKOUT))
        ]
        for stage, name, settings in rows([stage for stage in stages if stage != HARD], methods):
            asked = {**settings, "threads": 1, "spp": SPP}
            first = [program.ask(stage, asked, TIMED_WIDTH) for program in programs]
            again = [program.ask(stage, asked, TIMED_WIDTH) for program in programs]
            asked["spp"] = max(SPP, round(SPP * TIMED_SECONDS / again[0]))
            ratios = []
            for turn in range(REPEATS):
                order = programs if turn % 2 == 0 else programs[::-1]
                spent = {program: program.ask(stage, asked, TIMED_WIDTH) for program in order}
                ratios.append(spent[programs[1]] / spent[programs[0]])
            low, median, high = statistics.quantiles(ratios, n=4)
            compiling = " | ".join(f"{a - b:.1f} s" for a, b in zip(first, again, strict=True))
            print(f"| {stage} | {name} | {median:.3f} | {low:.3f} to {high:.3f} | {compiling} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("stages", nargs="*", default=[*SCENES, EFFECTS.stem, HARD])
    parser.add_argument("--methods", nargs="+", default=[], help="methods or settings of VARIANTS; all of them")
    parser.add_argument("--before", type=Path, help="another checkout, or a file that --write has made")
    parser.add_argument("--write", type=Path, help="file for the pictures of the other checkout")
    parser.add_argument("--times", action="store_true")
    parser.add_argument("--serve", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.serve is not None:
        serve(arguments.serve)
        return
    sys.path[0] = str(CHECKOUT)
    if arguments.before is None:
        parser.error("name what to compare with: --before")
    elif arguments.write is not None:
        write(arguments.before, arguments.write, arguments.stages, arguments.methods)
    elif arguments.times:
        compare_times(arguments.before, arguments.stages, arguments.methods)
    else:
        program = Stored(arguments.before) if arguments.before.is_file() else Program(arguments.before)
        raise SystemExit(0 if compare(program, arguments.stages, arguments.methods) else 1)


if __name__ == "__main__":
    main()
