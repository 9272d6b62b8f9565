"""Rare bright paths by Metropolis chains, after Bitterli and Jarosz (2019), against `nee` and the cache's guide:

    python scripts/bench/complex_paths.py [SCENE ...] [--spp 64 256] [--width 48] [--seeds 12] [--json FILE]

A SCENE is a folder of usd_scenes, `glass_block` (below: a glass block under a small lamp), or a stage's path.
primary_samples.py has the kernels. A render of the prototype goes like this:

1. A pilot takes an eighth of the samples, by next-event estimation. It tells what luminance to expect of each pixel:
   the mean over 5 x 5 pixels without the two brightest samples, or that of the pixel's own samples without the
   brightest one where that is larger.
2. What a path brings above `factor` times as much is complex. Factor and the chains' share of the remaining samples are
   those of the least predicted error, sqrt(error) = sqrt(V) + sqrt(TIME) b. V is the relative variance of what stays,
   b the mean of what goes, relative to the pixels, and TIME the steps in which a chain forgets where it was. Where
   that is not WORTH_IT times better than no chains, there are none.
3. Next-event estimation on a lattice renders what is simple. Its samples also give the chains' first states, drawn by
   what is complex of them, and the mean of that, by which the chains are scaled.
4. The chains render what is complex. No sample of the pilot is in the picture.

So a picture is unbiased: the split is a function of the path, fixed before anything that it splits is drawn.

The printed columns:

relMSE of nee    mean over the seeds, without the worst 0.1 % of each picture's pixels; then of all pixels
guided, chains   how many times as efficient as `nee`: 1 / (relMSE x time), for both; ± by a jackknife over the seeds
share            chains' share of the samples after the pilot, mean over the seeds; 0 is next-event estimation
complex          mean of what the chains render, relative to their pixels' brightness
accepted         share of accepted steps
p                that the means of the prototype and of `nee` over 4 x 3 parts of the picture differ no more than that
                 by chance: Welch's test, the smallest of 12, times 12. `!` marks one below 1 %

The reference is the mean of a picture by the guide and one by the prototype, of REFERENCE samples each. Time is CPU
time of one thread, pilots, learning and chains included.
"""

from __future__ import annotations

import argparse
import json
import math
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp
from interiors import GREY, RED, WHITE, Stage
from numpy.typing import NDArray
from primary_samples import SLOTS, Chains, base_kernels, chain_kernel
from pxr import Sdf, UsdShade
from scipy import stats

import warpmis
from warpmis.device.upload import upload
from warpmis.device.views import vec_lattice
from warpmis.film.metrics import DARK, LUMINANCE, OUTLIERS, relative_mse
from warpmis.rendering.generating_vector import lattice_length, lattice_steps
from warpmis.scene import Scene
from warpmis.scene.features import detect

ROOT = Path(__file__).parents[2]
SCENES = ("open_terrace", "ajar_door", "cornell_box", "glass", "glass_block")
METHODS = ("nee", "guided", "chains")
FACTORS = (2.0, 4.0, 8.0, 16.0, 32.0, 64.0)
TIME, WORTH_IT = 100.0, 1.3
PILOT_PART, FEWEST = 8, 4
LARGE_STEPS, STEPS = 0.1, 512
SMALLEST, LARGEST = 2.0**-14, 2.0**-4
MAX_DEPTH = 8
REFERENCE = 4096
SIGNIFICANCE = 0.01
Array = NDArray[np.floating[Any]]


@dataclass(frozen=True, eq=False)
class Rule:
    """threshold: above which luminance is complex [nit], shape (pixels,); worth: 1 / expected luminance [1/nit], shape
    (pixels,); share: of the samples after the pilot that are the chains'."""

    threshold: NDArray[np.float32]
    worth: NDArray[np.float32]
    share: float


@dataclass(frozen=True, eq=False)
class Picture:
    """image: shape (H, W, 3); share, complex, accepted: as printed; replay: median relative error of the chains'
    first y, traced from the table."""

    image: Array
    share: float
    complex: float
    accepted: float
    replay: float


def expected_luminance(found: Array, width: int) -> Array:
    """Of each pixel, from the pilot's luminances, shape (pixels, samples); all but the brightest samples count."""
    count = found.shape[1]
    own = (found.sum(axis=1) - found.max(axis=1)) / (count - 1)
    rows = np.pad(found.reshape(-1, width, count), ((2, 2), (2, 2), (0, 0)), mode="edge")
    squares = np.lib.stride_tricks.sliding_window_view(rows, (5, 5), axis=(0, 1)).reshape(len(found), -1)
    around = np.partition(squares, -3, axis=1)[:, :-2].mean(axis=1)
    expected = np.maximum(own, around)
    return np.sqrt(expected**2 + (DARK * expected.mean()) ** 2 + 1e-30)


def learn(found: Array, width: int) -> Rule:
    """The rule from the pilot's luminances, shape (pixels, samples)."""
    expected = expected_luminance(found, width)
    relative = found / expected[:, None]
    plain = math.sqrt(relative.var(axis=1, ddof=1).mean())
    best, factor, share = plain / math.sqrt(WORTH_IT), math.inf, 0.0
    for tried in FACTORS:
        simple = math.sqrt(np.minimum(relative, tried).var(axis=1, ddof=1).mean())
        chains = math.sqrt(TIME) * float(np.maximum(relative - tried, 0.0).mean())
        if simple + chains < best:
            best, factor, share = simple + chains, tried, chains / (simple + chains)
    # Half of the samples at least are ordinary ones, which have to find where chains begin, and what scales them.
    share = min(max(share, 0.1), 0.5) if math.isfinite(factor) else 0.0
    threshold = np.minimum(factor * expected, np.finfo(np.float32).max)
    return Rule(threshold.astype(np.float32), (1.0 / expected).astype(np.float32), share)


class Prototype:
    """Renders one scene, on the CPU."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        features = detect(scene).with_depth(MAX_DEPTH)
        self.base, self.walk = base_kernels(features), chain_kernel(features)

    def render(self, spp: int, seed: int) -> Picture:
        with wp.ScopedDevice("cpu"):
            self.on_device = upload(self.scene, "cpu")
            self.width, self.height = self.on_device.camera.width, self.on_device.camera.height
            self.pixels = self.width * self.height
            pilot = max(FEWEST, spp // PILOT_PART)
            all_complex = Rule(np.zeros(self.pixels, np.float32), np.ones(self.pixels, np.float32), 0.0)
            rule = learn(self._sample(all_complex, pilot, 2 * seed)[1], self.width)
            count = max(1, round((spp - pilot) * (1.0 - rule.share)))
            simple, y = self._sample(rule, count, 2 * seed + 1)
            image, found = simple.astype(np.float64), (0.0, 0.0)
            if y.any() and rule.share > 0.0:
                light, *found = self._chains(rule, y, (spp - pilot - count) * self.pixels, 2 * seed + 1)
                image = image + light
        return Picture(image.reshape(self.height, self.width, 3), rule.share, float(y.mean()), *found)

    def _sample(self, rule: Rule, count: int, seed: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Means of what is simple, shape (pixels, 3); y, shape (pixels, count)."""
        simple, y = wp.zeros(self.pixels, dtype=wp.vec3), wp.zeros((self.pixels, count), dtype=float)
        inputs = [seed, steps_of(count), MAX_DEPTH, wp.array(rule.threshold), wp.array(rule.worth), simple, y]
        wp.launch(self.base.sample, dim=self.pixels, inputs=[self.on_device.view, self.on_device.camera, *inputs])
        return simple.numpy(), y.numpy()

    def _chains(self, rule: Rule, y: NDArray[np.float32], steps: int, seed: int) -> tuple[Array, float, float]:
        """Light of the complex part, shape (pixels, 3), from so many steps in all; `accepted`, `replay`."""
        count = max(1, steps // STEPS)
        generator = np.random.default_rng(seed)
        # Even steps through the samples' sum: each has its probability, and the picture's parts their share.
        sums = np.cumsum(y, dtype=np.float64)
        places = (np.arange(count) + generator.random()) / count * sums[-1]
        chosen = np.minimum(np.searchsorted(sums, places, side="right"), np.flatnonzero(y)[-1])
        pixels, samples = (part.astype(np.int32) for part in np.divmod(chosen, y.shape[1]))
        rows = wp.zeros(count * SLOTS, dtype=wp.vec4)
        inputs = [self.on_device.camera, seed, steps_of(y.shape[1]), wp.array(pixels), wp.array(samples), rows]
        wp.launch(self.base.put_seed, dim=count, inputs=inputs)
        chains = Chains()
        chains.seed, chains.steps, chains.large = seed, STEPS, LARGE_STEPS
        chains.largest, chains.ratio = LARGEST, math.log(LARGEST / SMALLEST)
        chains.low, chains.high = rows.ptr & 0xFFFFFFFF, rows.ptr >> 32
        light, log = wp.zeros(self.pixels, dtype=wp.vec3), wp.zeros((count, 2), dtype=float)
        inputs = [chains, MAX_DEPTH, wp.array(rule.threshold), wp.array(rule.worth), light, log]
        wp.launch(self.walk, dim=count, inputs=[self.on_device.view, self.on_device.camera, *inputs])
        scale = self.pixels * float(y.mean(dtype=np.float64)) / (count * STEPS)
        logged, known = log.numpy(), y.ravel()[chosen]
        replay = float(np.median(np.abs(logged[:, 0] / known - 1.0)))
        return light.numpy().astype(np.float64) * scale, float(logged[:, 1].mean()), replay


def steps_of(count: int) -> vec_lattice:
    return vec_lattice(*lattice_steps(lattice_length(count)))


def glass_block(folder: Path) -> Path:
    """A block of glass and a matt one on a table, under a small lamp and a faint sky."""
    path = folder / "glass_block.usda"
    stage = Stage(path)
    stage.box((-3, -0.1, -3), (3, 0, 3), WHITE)
    stage.box((-3, 0, -1.6), (3, 2.5, -1.5), GREY)
    stage.box((0.7, 0, -0.9), (1.2, 0.8, -0.4), RED)
    stage.box((-0.5, 0.3, -0.4), (0.4, 0.9, 0.3), WHITE)
    material = UsdShade.Material(stage.usd.GetPrimAtPath(f"/World/Material{stage.count}"))
    stage.usd.RemovePrim(material.GetPath().AppendChild("Surface"))
    material.GetSurfaceOutput().ClearSources()
    glass = UsdShade.Shader.Define(stage.usd, material.GetPath().AppendChild("Glass"))
    glass.CreateIdAttr("ND_standard_surface_surfaceshader")
    for name, value in {"base": 0.0, "transmission": 1.0, "specular_roughness": 0.0}.items():
        glass.CreateInput(name, Sdf.ValueTypeNames.Float).Set(value)
    out = glass.CreateOutput("out", Sdf.ValueTypeNames.Token)
    material.CreateSurfaceOutput("mtlx").ConnectToSource(out)
    stage.panel((-0.4, 2.2, 0.3), (0.15, 0.15), (-90, 0, 0), 300.0)
    stage.sky((0.05, 0.06, 0.08))
    stage.camera((0.6, 1.6, 3.2), (0.0, 0.3, -0.2), 28.0)
    stage.usd.Save()
    return path


def jackknife(a: Array, b: Array) -> tuple[float, float]:
    """mean a / mean b and its standard error, by leaving out one seed at a time."""
    without = (a.sum() - a) / (b.sum() - b)
    return float(a.mean() / b.mean()), float(without.std() * math.sqrt(len(a) - 1))


def p_value(a: Array, b: Array) -> float:
    """That pictures, shape (seeds, H, W), have the same means in 4 x 3 parts; Bonferroni."""

    def parts(pictures: Array) -> Array:
        rows = [part.mean(axis=1) for part in np.array_split(pictures, 3, axis=1)]
        return np.stack([part.mean(axis=1) for row in rows for part in np.array_split(row, 4, axis=1)], axis=1)

    found = stats.ttest_ind(parts(a), parts(b), equal_var=False).pvalue
    return float(min(1.0, 12 * np.nanmin(found)))


class Bench:
    """Renders one scene by all methods."""

    def __init__(self, scene: Scene) -> None:
        self.scene, self.prototype = scene, Prototype(scene)
        self.details: list[Picture] = []
        for name in METHODS:
            self.render(name, 64, 10_000)  # compiles
        self.reference = np.mean([self.render(name, REFERENCE, 20_000) for name in ("guided", "chains")], axis=0)

    def render(self, name: str, spp: int, seed: int) -> Array:
        if name == "chains":
            self.details.append(self.prototype.render(spp, seed))
            return self.details[-1].image
        return warpmis.render(self.scene, method=name, spp=spp, seed=seed, threads=1, max_depth=MAX_DEPTH).image

    def measure(self, spp: int, seeds: int) -> dict[str, Any]:
        """A row of the table."""
        pictures: dict[str, list[Array]] = {name: [] for name in METHODS}
        seconds: dict[str, list[float]] = {name: [] for name in METHODS}
        self.details.clear()
        for seed in range(seeds):
            for name in METHODS:  # in turns, so that a change of the machine's speed falls on all
                begun = time.process_time()
                pictures[name].append(self.render(name, spp, seed))
                seconds[name].append(time.process_time() - begun)
        row: dict[str, Any] = {"seconds": {name: float(np.median(of)) for name, of in seconds.items()}}
        for outliers, suffix in ((OUTLIERS, ""), (0.0, " all")):
            error = {
                name: np.array([relative_mse(image, self.reference, outliers) for image in of])
                for name, of in pictures.items()
            }
            for name in METHODS[1:]:
                cost = row["seconds"][name] / row["seconds"]["nee"]
                gain, spread = jackknife(error["nee"], error[name])
                row[name + suffix] = gain / cost, spread / cost
            row["nee" + suffix] = float(error["nee"].mean())
            row["error" + suffix] = {name: of.tolist() for name, of in error.items()}
        for name in ("share", "complex", "accepted", "replay"):
            row[name] = float(np.mean([getattr(detail, name) for detail in self.details]))
        luminance = {name: np.array(of) @ LUMINANCE for name, of in pictures.items()}
        row["p"] = p_value(luminance["chains"], luminance["nee"])
        return row


def scene_of(name: str, width: int, folder: Path) -> Scene:
    if name == "glass_block":
        return warpmis.load_stage(str(glass_block(folder)), width=width)
    stage = Path(name) if Path(name).exists() else ROOT / "usd_scenes" / name / "scene.usda"
    return warpmis.load_stage(str(stage), width=width)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=SCENES, help="folders in usd_scenes, glass_block, or paths")
    parser.add_argument("--spp", type=int, nargs="+", default=[64, 256])
    parser.add_argument("--width", type=int, default=48)
    parser.add_argument("--seeds", type=int, default=12)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    report: dict[str, dict[int, dict[str, Any]]] = {}
    print(
        "| scene, spp | relMSE of nee | guided over nee | chains over nee | share | complex | accepted | p |",
        flush=True,
    )
    print("|---|---|---|---|---|---|---|---|", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        for name in arguments.scenes:
            bench = Bench(scene_of(name, arguments.width, Path(folder)))
            for spp in arguments.spp:
                row = report.setdefault(name, {})[spp] = bench.measure(spp, arguments.seeds)
                cells = [f"{row['nee']:.4f}, {row['nee all']:.4f}"]
                for gains in ((row[name], row[name + " all"]) for name in METHODS[1:]):
                    cells.append(", ".join(f"{gain:.2f} ± {spread:.2f}" for gain, spread in gains))
                mark = "!" if row["p"] < SIGNIFICANCE else ""
                rest = f"{row['share']:.0%} | {row['complex']:.3f} | {row['accepted']:.0%} | {row['p']:.2f}{mark}"
                print(f"| {name}, {spp} | {' | '.join(cells)} | {rest} |", flush=True)
    if arguments.json:
        arguments.json.write_text(json.dumps(report, indent=1))


if __name__ == "__main__":
    main()
