"""Efficiency of warpmis against Mitsuba 3's `path` integrator, on the same scenes at equal samples:

    python scripts/bench/against_mitsuba.py [SCENE ...] [--spp 64] [--seeds 8] [--repeats 5] [--variants llvm_ad_rgb]
        [--json FILE]

Needs the extra `peer`. Scenes are folders of usd_scenes, or files, that tests/peer/mitsuba_scene.py converts, with the
nearest material where there is no equal one (tests/peer/mitsuba_material.py says which, and what differs); both
renderers have the same resolution, box filter and number of bounces, begin Russian roulette at the same bounce, and
take all the threads there are. Each has its own sampler: warpmis the one by default, Mitsuba that of --their-sampler,
"independent" if nothing is said. Mitsuba's roulette goes by the throughput, ours by five times as much.
Mitsuba's multiple importance sampling is by the power heuristic. Where a path passes one of our lights or
goes straight through a surface, Mitsuba counts a bounce: its paths are a little shorter there.

variance    of a pixel between the pictures of `--seeds` seeds, relative to its squared brightness (warpmis/metrics.py:
            squared_scale, of the mean of all pictures), mean over the pixels without each renderer's worst 0.1 %
time        wall time of one picture of a loaded scene, after one to warm up: learning included, but neither reading,
            uploading nor compiling; the median over the seeds
efficiency  1 / (variance x time)

All figures are quotients ours / theirs: geometric means over the repeats, of other seeds each, in brackets the smallest
and the largest. The renderers take turns seed by seed, so that a change of the machine's speed falls on all of them.

mean        of the pictures: 1 where both renderers transport the same light
blocks      by how much the pictures differ: the median and the 95th percentile over blocks of 8 x 8 pixels of the
            difference of their mean luminances, relative to theirs, or to a twentieth of the picture's mean where that
            is more; in brackets what the noise of both pictures makes of it alone (from two repeats on)

The variant llvm_ad_rgb needs the library of LLVM, newer than 15 (19 works), where the loader finds it or in
DRJIT_LIBLLVM_PATH. On Debian: `apt-get install libllvm19`, or without installing it

    apt-get download libllvm19 && dpkg -x libllvm19_*.deb llvm
    export DRJIT_LIBLLVM_PATH=$PWD/llvm/usr/lib/x86_64-linux-gnu/libLLVM.so.19.1
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

import warpmis
from warpmis.film.metrics import LUMINANCE, squared_scale, without_outliers
from warpmis.kernels import roulette

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))
from peer.mitsuba_scene import to_mitsuba

USD_SCENES = Path(__file__).parents[2] / "usd_scenes"
SCENES = ("cornell_box", "veach_plates", "ajar_door", "open_terrace")
METHODS = ("auto", "nee")
VARIANTS = ("scalar_rgb", "llvm_ad_rgb")
WARM_UP_SEED = 1 << 30

BLOCK = 8  # [pixel]
DARK = 0.05  # share of the picture's mean below which a block counts as if it were that bright

# An LLVM that is too old ends the process that tries it.
PROBE = "import mitsuba as mi; mi.set_variant('{}'); mi.render(mi.load_dict(mi.cornell_box()), spp=1).numpy()"

Picture = NDArray[np.float32]
Renderer = Callable[[int], tuple[Picture, float]]
Quotients = dict[str, float]
Apart = dict[str, dict[str, float]]


@dataclass
class Runs:
    pictures: list[Picture] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)


def works(variant: str) -> bool:
    """Whether the variant renders on this machine."""
    probe = [sys.executable, "-c", PROBE.format(variant)]
    return subprocess.run(probe, check=False, capture_output=True).returncode == 0


def ours(scene: warpmis.Scene, method: str, spp: int, max_depth: int) -> Renderer:
    def render(seed: int) -> tuple[Picture, float]:
        start = time.perf_counter()
        result = warpmis.render(scene, method=method, spp=spp, max_depth=max_depth, seed=seed)
        whole = time.perf_counter() - start
        return result.image, whole - result.stats["seconds"]["load"] - result.stats["seconds"]["compile"]

    return render


def theirs(scene: warpmis.Scene, variant: str, sampler: str, spp: int, max_depth: int) -> Renderer:
    width, height = scene.resolution
    mi.set_variant(variant)
    built = to_mitsuba(
        scene,
        spp=spp,
        max_depth=max_depth,
        width=width,
        height=height,
        roulette_depth=int(roulette.DEPTH),
        sampler=sampler,
        approximate=True,
    )

    def render(seed: int) -> tuple[Picture, float]:
        mi.set_variant(variant)
        start = time.perf_counter()
        picture = np.array(mi.render(built, seed=seed, spp=spp))[..., :3]
        return picture, time.perf_counter() - start

    return render


def measure(renderers: dict[str, Renderer], seeds: range) -> dict[str, Runs]:
    runs = {name: Runs() for name in renderers}
    for seed in seeds:
        for name, render in renderers.items():
            picture, seconds = render(seed)
            runs[name].pictures.append(picture)
            runs[name].seconds.append(seconds)
    return runs


def variance(pictures: list[Picture], scale: NDArray[np.float64]) -> float:
    spread = np.var(pictures, axis=0, ddof=1, dtype=np.float64) @ LUMINANCE
    return float(without_outliers(spread / scale).mean())


def quotients(own: Runs, other: Runs, scale: NDArray[np.float64]) -> Quotients:
    """Ours over theirs; `mean` is that of the pictures' means, which tells whether both render the same."""
    of_variance = variance(own.pictures, scale) / variance(other.pictures, scale)
    of_time = statistics.median(own.seconds) / statistics.median(other.seconds)
    of_mean = float(np.mean(own.pictures) / np.mean(other.pictures))
    return {"variance": of_variance, "time": of_time, "efficiency": 1.0 / (of_variance * of_time), "mean": of_mean}


def blocks(picture: NDArray[np.floating]) -> NDArray[np.float64]:
    """Mean luminances of blocks; what is left of blocks at the right and the lower edge is left out."""
    luminance = np.asarray(picture, np.float64) @ LUMINANCE
    rows, columns = (size // BLOCK for size in luminance.shape)
    return luminance[: rows * BLOCK, : columns * BLOCK].reshape(rows, BLOCK, columns, BLOCK).mean(axis=(1, 3))


def blocks_apart(own: list[Picture], other: list[Picture]) -> Apart:
    """How far apart the means of two lists of pictures are, and how far the noise of both alone would bring them.

    Half the difference between the pictures at even and at odd places is as noisy as the mean of all.
    """
    of_own, of_other = (np.array([blocks(picture) for picture in pictures]) for pictures in (own, other))
    level = of_other.mean(axis=0)
    level = np.maximum(level, DARK * level.mean())
    found = {"difference": np.abs(of_own.mean(axis=0) - of_other.mean(axis=0)) / level}
    if len(own) > 1:
        halves = [0.5 * (all_[::2].mean(axis=0) - all_[1::2].mean(axis=0)) for all_ in (of_own, of_other)]
        found["noise"] = np.abs(halves[0] - halves[1]) / level
    return {name: {"median": float(np.median(v)), "95 %": float(np.quantile(v, 0.95))} for name, v in found.items()}


def compare(
    scene: warpmis.Scene, variants: list[str], arguments: argparse.Namespace
) -> tuple[dict[str, list[Quotients]], dict[str, Apart]]:
    """Of each pair "method / variant" the quotients, one a repeat, and how far apart the pictures are."""
    spp, max_depth, seeds = arguments.spp, arguments.max_depth, arguments.seeds
    renderers = {name: ours(scene, name, spp, max_depth) for name in METHODS}
    renderers |= {name: theirs(scene, name, arguments.their_sampler, spp, max_depth) for name in variants}
    for render in renderers.values():
        render(WARM_UP_SEED)
    names = {f"{method} / {variant}": (method, variant) for variant in variants for method in METHODS}
    pairs: dict[str, list[Quotients]] = {pair: [] for pair in names}
    means: dict[str, list[Picture]] = {name: [] for name in renderers}
    for repeat in range(arguments.repeats):
        runs = measure(renderers, range(repeat * seeds, (repeat + 1) * seeds))
        scale = squared_scale(np.mean([own.pictures for own in runs.values()], axis=(0, 1), dtype=np.float64))
        for pair, (method, variant) in names.items():
            pairs[pair].append(quotients(runs[method], runs[variant], scale))
        for name, own in runs.items():
            means[name].append(np.mean(own.pictures, axis=0))
    apart = {pair: blocks_apart(means[method], means[variant]) for pair, (method, variant) in names.items()}
    return pairs, apart


def rows(pairs: dict[str, list[Quotients]]) -> Iterator[str]:
    yield "| ours / theirs | variance | time | efficiency | mean |\n|---|---|---|---|---|"
    for pair, found in pairs.items():
        columns = {name: [repeat[name] for repeat in found] for name in found[0]}
        texts = [f"{statistics.geometric_mean(v):.2f} ({min(v):.2f} to {max(v):.2f})" for v in columns.values()]
        texts[-1] = f"{statistics.geometric_mean(columns['mean']):.4f}"
        yield f"| {pair} | {' | '.join(texts)} |"


def rows_apart(apart: dict[str, Apart]) -> Iterator[str]:
    for pair, found in apart.items():
        texts = []
        for which, difference in found["difference"].items():
            noise = f" ({found['noise'][which]:.1%})" if "noise" in found else ""
            texts.append(f"{which} {difference:.1%}{noise}")
        yield f"blocks, {pair}: {', '.join(texts)}"


def over_scenes(report: dict[str, dict[str, list[Quotients]]]) -> dict[str, list[Quotients]]:
    """Geometric means over the scenes, repeat by repeat."""
    means: dict[str, list[Quotients]] = {}
    for pair, found in next(iter(report.values())).items():
        means[pair] = [
            {name: statistics.geometric_mean(pairs[pair][repeat][name] for pairs in report.values()) for name in first}
            for repeat, first in enumerate(found)
        ]
    return means


def parsed() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=SCENES, help="names of folders in usd_scenes, or files")
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--width", type=int, default=128)
    parser.add_argument("--max-depth", type=int, default=8)
    parser.add_argument("--seeds", type=int, default=8, help="pictures of each renderer and repeat, at least 2")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--their-sampler", default="independent", help="Mitsuba's: multijitter is among its best")
    parser.add_argument("--variants", nargs="+", default=VARIANTS, help="Mitsuba's")
    parser.add_argument("--json", type=Path)
    return parser.parse_args()


def usable(variants: list[str]) -> list[str]:
    """Those of the variants that render here; what is left out is told."""
    found = [variant for variant in variants if works(variant)]
    for variant in variants:
        if variant not in found:
            print(f"{variant} is left out: it does not render on this machine (--help says what it needs)")
    return found


def main() -> None:
    arguments = parsed()
    variants = usable(arguments.variants)
    report: dict[str, dict[str, list[Quotients]]] = {}
    apart: dict[str, dict[str, Apart]] = {}
    for name in arguments.scenes:
        path = Path(name) if Path(name).is_file() else USD_SCENES / name / "scene.usda"
        scene = warpmis.load_stage(path, width=arguments.width)
        report[name], apart[name] = compare(scene, variants, arguments)
        print(f"\n{name}, {arguments.width} pixels wide, {arguments.spp} samples per pixel")
        print(*rows(report[name]), "", *rows_apart(apart[name]), sep="\n")
        sys.stdout.flush()
    if len(report) > 1:
        report["geometric mean"] = over_scenes(report)
        print("\ngeometric mean", *rows(report["geometric mean"]), sep="\n")
    if arguments.json:
        arguments.json.write_text(json.dumps({**report, "blocks": apart}, indent=1))


if __name__ == "__main__":
    main()
