"""What an effect costs a scene that does not call for it, and what leaving it out saves:

    python scripts/bench/effects.py [SCENE ...] [--json FILE]

time      of a round by a kernel with that one effect added, over the kernel with what the scene calls for alone
universal the same of the kernel with every effect: the quotient is what specialisation gains
compile   seconds to compile the trace kernel into an empty cache, as a process compiles its second one (the first also
          compiles Warp's headers)
source    lines of the trace kernel's generated source
start     seconds from the command to a written picture, 64 pixels wide, 1 sample per pixel, with a warm cache; `cpu`
          is the processor's time in it

CPU time of one thread, medians of interleaved rounds of the same samples, with their quartiles.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import warp as wp

import warpmis
from warpmis.config import RenderConfig
from warpmis.device.compilation import load_kernels
from warpmis.device.upload import upload
from warpmis.kernels.trace import make_trace
from warpmis.learn.schedule import Round
from warpmis.rendering.integrator import Integrator, allocation_of
from warpmis.rendering.specialise import features_of
from warpmis.scene.features import Features

USD_SCENES = Path(__file__).parents[2] / "usd_scenes"
SPP = 8

# Effects that add nothing alone are added with what they go with.
TOGETHER = {
    "clearcoat": ("specular",),
    "smooth": ("specular",),
    "ies": ("shaping",),
    "rough_transmission": ("transmission",),
    "absorption": ("transmission",),
    "emissive_instances": ("instances", "light_tree", "mesh_light"),
}


def effect_names() -> list[str]:
    """All but the spatial cache, which is a method's."""
    return [field.name for field in dataclasses.fields(Features) if field.type == "bool" and field.name != "cache"]


def with_effect(features: Features, name: str) -> Features:
    return replace(features, **dict.fromkeys((name, *TOGETHER.get(name, ())), True))


def quartiles(values: list[float]) -> dict[str, float]:
    low, median, high = statistics.quantiles(values, n=4)
    return {"lower quartile": low, "median": median, "upper quartile": high}


class Contest:
    """Kernels of one scene that trace the same samples in turn."""

    def __init__(self, scene: warpmis.Scene, config: RenderConfig) -> None:
        self.config = config
        self.uploaded = upload(scene, config.device)
        self.allocation = allocation_of(config, *scene.resolution)
        self.runs: dict[str, Integrator] = {}
        self.compile_seconds: dict[str, float] = {}

    def add(self, name: str, features: Features) -> None:
        self.compile_seconds[name] = load_kernels([make_trace(features)], self.config.device).seconds
        self.runs[name] = Integrator(self.uploaded, features, self.config, self.allocation)

    def seconds(self, name: str) -> float:
        start = time.process_time()
        self.runs[name].trace(Round(0, SPP, learn=False), lambda samples: None)
        return time.process_time() - start

    def ratios(self, base: str, repeats: int) -> dict[str, dict[str, float]]:
        """Time of every kernel over that of `base`, each beside a round of `base` of its own."""
        others = [name for name in self.runs if name != base]
        for name in self.runs:
            self.seconds(name)
        found: dict[str, list[float]] = {name: [] for name in others}
        for _ in range(repeats):
            for name in others:
                found[name].append(self.seconds(name) / self.seconds(base))
        return {name: quartiles(values) for name, values in found.items()}


def source_lines(kernel: wp.Kernel) -> int:
    folder = Path(wp.config.kernel_cache_dir) / kernel.module.get_module_identifier(1)
    (source,) = folder.glob("*.cpp")
    return len(source.read_text().splitlines())


def measure(stage: Path, width: int, method: str, repeats: int, names: list[str]) -> dict[str, Any]:
    scene = warpmis.load_stage(stage, width=width)
    config = RenderConfig(method=method, threads=1)
    special = features_of(scene, config)
    contest = Contest(scene, config)
    contest.add("warm up", replace(special, orthographic=not special.orthographic))
    del contest.runs["warm up"]
    contest.add("special", special)
    for name in names:
        if not getattr(special, name):
            contest.add(name, with_effect(special, name))
    contest.add("universal", features_of(scene, config, Features.all()))
    ratios = contest.ratios("special", repeats)
    return {
        name: {
            "time": ratios.get(name, quartiles([1.0, 1.0])),
            "compile": contest.compile_seconds[name],
            "source": source_lines(run.kernel),
        }
        for name, run in contest.runs.items()
    }


def start(stage: Path, repeats: int) -> dict[str, float]:
    walls, cpus = [], []
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "warpmis", "render", str(stage), f"{folder}/out.exr", "-w", "64"]
        command += ["--spp", "1", "--quiet"]
        for _ in range(repeats + 1):
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            began = time.perf_counter()
            subprocess.run(command, check=True)
            walls.append(time.perf_counter() - began)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            cpus.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return {"seconds": statistics.median(walls[1:]), "cpu": statistics.median(cpus[1:])}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=["cornell_box"], help="names of folders in usd_scenes")
    parser.add_argument("--effects", nargs="*", default=effect_names(), metavar="NAME", help="which ones to add")
    parser.add_argument("--method", default="nee")
    parser.add_argument("--width", type=int, default=64)
    parser.add_argument("--repeats", type=int, default=15)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    wp.config.log_level = wp.LOG_ERROR
    wp.init()
    report = {}
    for name in arguments.scenes:
        stage = USD_SCENES / name / "scene.usda"
        report[name] = {"start": start(stage, 5)}
        with tempfile.TemporaryDirectory() as cache:
            own, wp.config.kernel_cache_dir = wp.config.kernel_cache_dir, cache
            report[name]["kernels"] = measure(
                stage, arguments.width, arguments.method, arguments.repeats, arguments.effects
            )
            wp.config.kernel_cache_dir = own
        print(f"{name}: warm start {report[name]['start']['seconds']:.2f} s")
        for kernel, found in sorted(report[name]["kernels"].items(), key=lambda item: item[1]["time"]["median"]):
            low, median, high = found["time"].values()
            print(
                f"  {kernel:16} time {median:.3f} ({low:.3f} to {high:.3f}), compile {found['compile']:.1f} s, "
                f"source {found['source']} lines",
                flush=True,
            )
    if arguments.json:
        arguments.json.write_text(json.dumps(report, indent=2))


if __name__ == "__main__":
    main()
