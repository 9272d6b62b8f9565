"""What a render's time goes into, as ratios measured in one run on one machine:

    python scripts/bench/speed.py [SCENE ...] [--json FILE]

threads    samples per second with two threads over one, of three times as many repetitions: two cores are seldom left
           alone for long
roofline   the trace kernel's rays per second over a bare kernel's on the same rays, one thread each
learning   time of moments, solver and launches over the whole run's, on identical paths
solver     time of the solver with eight strategies over the whole run's, `murray20` and `pooled`, 256 samples per pixel
start      seconds from the command to a written picture, 128 pixels wide, 64 samples per pixel, without a kernel cache,
           and of these until all kernels are compiled; with one, and of these what is not rendering: all that
           comes before the first sample, and writing the picture

Each figure is the median of interleaved repetitions, with the smallest and the largest beside it (learning: with the
quartiles).
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
from collections.abc import Callable
from pathlib import Path
from typing import Any

import warp as wp
from closed_room import write_closed_room
from recorded_rays import bare_queries, record_rays, warp_mesh_of

import warpmis
from warpmis.config import STRATEGIES, LearnConfig, RenderConfig
from warpmis.device.upload import upload
from warpmis.learn.schedule import Round, schedule
from warpmis.rendering.integrator import Integrator, allocation_of
from warpmis.rendering.specialise import features_of
from warpmis.scene import DomeLight

USD_SCENES = Path(__file__).parents[2] / "usd_scenes"
# A scene that is made here: what a tree costs that no cache holds.
CLOSED_ROOM = "closed_room"
CLOSED_ROOM_TRIANGLES = 400_000
Figure = dict[str, float]


def figure(values: list[float]) -> Figure:
    return {"median": statistics.median(values), "min": min(values), "max": max(values)}


def interleaved(first: Callable[[], float], second: Callable[[], float], repeats: int) -> list[float]:
    """Quotients of two timings taken in turn, after one of each to warm up."""
    first(), second()
    return [first() / second() for _ in range(repeats)]


def seconds(work: Callable[[], object], clock: Callable[[], float] = time.perf_counter) -> float:
    start = clock()
    work()
    return clock() - start


def cpu_seconds(work: Callable[[], object]) -> float:
    """For work of one thread: not disturbed by what else runs on the machine."""
    return seconds(work, time.process_time)


def integrator(scene: warpmis.Scene, config: RenderConfig) -> Integrator:
    uploaded = upload(scene, config.device)
    return Integrator(uploaded, features_of(scene, config), config, allocation_of(config, *scene.resolution))


def threads(scene: warpmis.Scene, repeats: int) -> Figure:
    def run(count: int) -> float:
        run = integrator(scene, RenderConfig(method="balance", threads=count))
        return seconds(lambda: run.trace(Round(0, 256, learn=False), lambda samples: None))

    return figure(interleaved(lambda: run(1), lambda: run(2), 3 * repeats))


def roofline(scene: warpmis.Scene, repeats: int) -> Figure:
    samples = 16
    capacity = scene.resolution[0] * scene.resolution[1] * samples * 20
    rays = record_rays(scene, samples, max_depth=8, capacity=capacity)
    mesh = warp_mesh_of(upload(scene, "cpu").view)
    columns = [wp.array(rays.origins, dtype=wp.vec3), wp.array(rays.directions, dtype=wp.vec3), wp.array(rays.lengths)]
    hits = wp.zeros(len(rays.lengths), dtype=float)
    run = integrator(scene, RenderConfig(method="nee", threads=1))

    def bare() -> float:
        inputs = [mesh.id, *columns, hits]
        return cpu_seconds(lambda: wp.launch(bare_queries, dim=len(hits), inputs=inputs)) / len(rays.lengths)

    def traced() -> float:
        before = run.rays()
        spent = cpu_seconds(lambda: run.trace(Round(0, samples, learn=False), lambda done: None))
        return spent / (run.rays() - before)

    return figure(interleaved(bare, traced, repeats))


def learning(scene: warpmis.Scene, repeats: int) -> Figure:
    """One learn round against one plain round of the same samples, many times over, for the machine's speed drifts.

    The allocation is put back after every solve, so that both trace the very same paths. A launch holds a number of
    samples, not of rounds, so rounds add no launches but the solver's.
    """
    spp = 32
    learn = LearnConfig(rounds=1, spp=spp)
    run = integrator(scene, RenderConfig(method="murray20", spp=2 * spp, threads=1, learn=learn))
    equal = wp.clone(run.shares)

    def with_learning() -> None:
        run.trace(Round(0, spp, learn=True), lambda samples: None)
        run.solve(Round(0, spp, learn=True, following=spp))
        wp.copy(run.shares, equal)

    def without() -> None:
        run.trace(Round(0, spp, learn=False), lambda samples: None)

    shares = interleaved(lambda: cpu_seconds(with_learning), lambda: cpu_seconds(without), 8 * repeats)
    quartiles = statistics.quantiles([1.0 - 1.0 / share for share in shares], n=4)
    return dict(zip(("lower quartile", "median", "upper quartile"), quartiles, strict=True))


def solver(scene: warpmis.Scene, method: str, repeats: int) -> Figure:
    """Of one thread; the rounds are those of a render."""
    config = RenderConfig(method=method, strategies=STRATEGIES, threads=1)

    def share() -> float:
        run = integrator(scene, config)
        solving = 0.0

        def rounds() -> None:
            nonlocal solving
            for part in schedule(config):
                run.trace(part, lambda samples: None)
                if part.learn:
                    solving += cpu_seconds(lambda part=part: run.solve(part))

        whole = cpu_seconds(rounds)
        return solving / whole

    share()  # warms up
    return figure([share() for _ in range(repeats)])


def start(stage: Path) -> dict[str, float]:
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "warpmis", "render", str(stage), f"{folder}/out.exr", "-w", "128"]
        command += ["--spp", "64", "--quiet", "--json"]
        environment = {**os.environ, "WARP_CACHE_PATH": f"{folder}/cache"}

        def run() -> tuple[float, dict[str, Any]]:
            begin = time.perf_counter()
            done = subprocess.run(command, env=environment, check=True, capture_output=True)
            return time.perf_counter() - begin, json.loads(done.stdout)["stats"]

        cold, compiled = run()
        _, (warm, stats), _ = sorted((run() for _ in range(3)), key=lambda one: one[0])
        rendering = stats["seconds"]["learn"] + stats["seconds"]["render"]
        return {"cold": cold, "compiling": compiled["compile_seconds"], "warm": warm, "not rendering": warm - rendering}


def measure(stage: Path, width: int, repeats: int) -> dict[str, dict[str, float]]:
    scene = warpmis.load_stage(stage, width=width)
    report = {"threads": threads(scene, repeats)}
    if not any(isinstance(light, DomeLight) for light in scene.lights):
        report["roofline"] = roofline(scene, repeats)
    report["learning"] = learning(scene, repeats)
    report["solver m."] = solver(scene, "murray20", repeats)
    report["solver p."] = solver(scene, "pooled", repeats)
    report["start"] = start(stage)
    return report


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    help_of_scenes = f"folders in usd_scenes, or {CLOSED_ROOM}: {CLOSED_ROOM_TRIANGLES:,} triangles about a lamp"
    parser.add_argument("scenes", nargs="*", default=["cornell_box"], help=help_of_scenes)
    parser.add_argument("--width", type=int, default=96)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    report = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in arguments.scenes:
            stage = USD_SCENES / name / "scene.usda"
            if name == CLOSED_ROOM:
                stage = Path(folder) / "closed_room.usdc"
                write_closed_room(stage, CLOSED_ROOM_TRIANGLES)
            report[name] = measure(stage, arguments.width, arguments.repeats)
            for label, values in report[name].items():
                figures = "  ".join(f"{key} {value:.3f}" for key, value in values.items())
                print(f"{name:14} {label:10}", figures, flush=True)
    if arguments.json:
        arguments.json.write_text(json.dumps(report, indent=2))


if __name__ == "__main__":
    main()
